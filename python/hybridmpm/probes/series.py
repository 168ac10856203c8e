"""`TimeSeries`: readings of probes over time, and `record`, which makes them."""

import csv
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol

import numpy as np
import numpy.typing as npt

from hybridmpm._support.arguments import whole
from hybridmpm._support.files import replacing
from hybridmpm.errors import ConfigError
from hybridmpm.probes.probe import Floats, Probe, Probed

_MOST_FRAMES = 1_000_000


class Advancing(Probed, Protocol):
    """The part of a simulator that a recording of probes uses."""

    @property
    def frame(self) -> int:
        """Number of frames since the start."""

    def advance(self, frames: int = 1, force: Any = None) -> None:
        """Advance by whole frames."""


@dataclass(frozen=True, eq=False)
class TimeSeries:
    """Readings of probes at F frames."""

    frame: npt.NDArray[np.int64]
    """Frame numbers (F,), increasing."""
    time: Floats
    """Simulated times (F,) [s]."""
    values: Mapping[str, Floats]
    """Readings by the names of the probes, each (F,), or (F, K) of a probe at K points."""
    units: Mapping[str, str]
    """Units by the same names, such as "kg/m^3"."""

    def __getitem__(self, name: str) -> Floats:
        """Return the readings of one probe, (F,) or (F, K)."""
        return self.values[name]

    def __repr__(self) -> str:
        parts = ", ".join(f"{name} [{unit}]" for name, unit in self.units.items())
        return f"TimeSeries({parts}; {len(self.time)} readings from {self.time[0]:g} to {self.time[-1]:g} s)"

    def to_csv(self, path: str | Path) -> None:
        """Write a table: a row for each frame, a column for each number, names with units on top.

        Raises
        ------
        ExportError
            The file cannot be written.
        """
        heads, columns = ["frame", "time [s]"], [self.frame.tolist(), self.time.tolist()]
        for name, values in self.values.items():
            table = values.reshape(len(self.time), -1)
            points = [f"{name}[{k}]" for k in range(table.shape[1])] if values.ndim > 1 else [name]
            heads += [f"{point} [{self.units[name]}]" for point in points]
            columns += [column.tolist() for column in table.T]
        with replacing(Path(path)) as part, part.open("w", encoding="utf-8", newline="") as file:
            writer = csv.writer(file)
            writer.writerow(heads)
            writer.writerows(zip(*columns, strict=True))


def record(
    solver: Advancing, frames: int, probes: Mapping[str, Probe], *, every: int = 1, force: Any = None
) -> TimeSeries:
    """Advance a simulator, and read probes now, after every `every` frames, and at the end.

    Of forces and torques each reading is the mean over the frames since the one before, the first that of the
    frame before the recording; NaN where forces were not kept before.

    Parameters
    ----------
    solver : Simulator
        Simulator to advance; it stays at the last frame.
    frames : int in [0, 1000000]
        Number of frames to advance.
    probes : mapping
        Probes by name.
    every : int in [1, 1000000]
        Number of frames from one reading to the next; the last one may follow sooner.
    force : optional
        As `Simulator.advance` takes it, but one for each frame: give a function in the place of that.

    Raises
    ------
    ConfigError
        A number is out of range, an object is no probe or does not fit into the scene, or the simulator
        lacks the quantity; no frame was simulated.
    SimulationError
        A frame failed; see `Simulator.advance`.
    """
    frames, every = whole("frames", frames, 0, _MOST_FRAMES), whole("every", every, 1, _MOST_FRAMES)
    if not isinstance(probes, Mapping) or not probes:
        raise ConfigError('probes must be a mapping of names to probes, such as {"depth": HeightGauge(0.5)}')
    for probe in probes.values():
        checked_probe(probe).check(solver.scene)
    for probe in probes.values():
        probe.prepare(solver)
    stops = [*range(0, frames, every), frames]
    rows: dict[str, list[Floats]] = {name: [] for name in probes}
    means = {name: probe for name, probe in probes.items() if probe.is_mean}
    first, at = solver.frame, []
    for stop in stops:
        of_frames: dict[str, list[Floats]] = {name: [] for name in means}
        while solver.frame < first + stop:
            solver.advance(1 if means else first + stop - solver.frame, force)
            for name, probe in means.items():
                of_frames[name].append(probe.read(solver))
        at.append(solver.frame)
        for name, probe in probes.items():
            read = of_frames.get(name)
            rows[name].append(np.mean(read, axis=0) if read else probe.read(solver))
    frame = np.array(at, dtype=np.int64)
    return TimeSeries(
        frame=frame,
        time=(frame * solver.scene.frame_dt).astype(np.float64),
        values={name: np.array(values) for name, values in rows.items()},
        units={name: probe.unit for name, probe in probes.items()},
    )


def checked_probe(value: object) -> Probe:
    """Return a value that is a probe, or raise `ConfigError`, which says what to write instead."""
    if isinstance(value, Probe):
        return value
    raise ConfigError(f"this takes a probe, such as probes.Density((0.5, 0.2)); got a {type(value).__name__}")
