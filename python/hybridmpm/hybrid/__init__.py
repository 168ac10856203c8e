"""A network and MPM in one simulator: guards watch the network, and MPM takes over at an alarm.

- `HybridSimulator` is the simulator; `physics.Stepper` is the interface of its network.
- `GUARDS` are the guards by name; `Guard` is their interface, for guards of your own.
- `Decision` is an entry of the log; `StepCounts` counts frames by the source of their steps.
"""

from hybridmpm.decisions import Decision, StepCounts
from hybridmpm.hybrid.guard import Guard, GuardInput, Stage
from hybridmpm.hybrid.guards import (
    DEFAULT,
    GUARDS,
    Audit,
    Cosine,
    Density,
    Drift,
    Energy,
    NonFinite,
    Outside,
)
from hybridmpm.hybrid.simulator import HybridSimulator

__all__ = [
    "DEFAULT",
    "GUARDS",
    "Audit",
    "Cosine",
    "Decision",
    "Density",
    "Drift",
    "Energy",
    "Guard",
    "GuardInput",
    "HybridSimulator",
    "NonFinite",
    "Outside",
    "Stage",
    "StepCounts",
]
