"""Probes: what a gauge in the scene would read, now or over time.

`Simulator.probe` reads one now, `record` reads several while a simulator advances. Places outside of the
walls are refused. D is the dimension, K a number of points.
"""

from hybridmpm.probes.forces import Force, Torque
from hybridmpm.probes.gauges import FillLevel, Flow, HeightGauge, Submerged
from hybridmpm.probes.probe import PressureSamples, Probe
from hybridmpm.probes.quantities import Density, PatchDensity, PatchPressure, Pressure
from hybridmpm.probes.series import TimeSeries, record

__all__ = [
    "Density",
    "FillLevel",
    "Flow",
    "Force",
    "HeightGauge",
    "PatchDensity",
    "PatchPressure",
    "Pressure",
    "PressureSamples",
    "Probe",
    "Submerged",
    "TimeSeries",
    "Torque",
    "record",
]
