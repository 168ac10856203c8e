"""Records of one instant of a simulation, which other threads may read; they never change."""

import math
from collections import deque
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Literal, Self, TypeAlias

import numpy as np
import numpy.typing as npt
from pydantic import BaseModel, ConfigDict

from hybridmpm.decisions import Decision, Mode, without_undone
from hybridmpm.probes import PressureSamples
from hybridmpm.scene import WallFaces
from hybridmpm.simulator import Simulator, digest_of
from hybridmpm.stream_frames import Frame, FrameMessage, Population, Poses

_Floats = npt.NDArray[np.float64]

CELLS_PER_METRE = 20
"""Cells of a grid of forces."""
_PRESSURE_SPACINGS = 2.0
"""Side of a cell of pressures, in spacings of the simulated particles."""
HISTORY_FRAMES = 1000
"""Number of frames for which values of the safeguard are kept: the length of most scenarios."""
DIGITS = 4
"""Number of decimals of the safeguard's values in answers; its own noise is larger."""
MOST_SOLIDS = 64
"""Largest number of walls and obstacles whose forces are shown."""

Phase: TypeAlias = Literal["preparing", "steering", "out_of_reach", "holding", "done"]
"""Phase of a sketch."""


class _Record(BaseModel):
    """Base of records that are answers at the same time; the text below a field describes it in OpenAPI."""

    model_config = ConfigDict(frozen=True, use_attribute_docstrings=True)


class Control(_Record):
    """The newest sketch of a session and its progress. What is not known yet is null."""

    number: int
    """Number of the sketch in its session, counted from 1."""
    kind: Literal["arrow", "ellipse", "shape", "solid"]
    """Kind of the sketch; of several in turn that of the present one."""
    phase: Phase
    """preparing: it is being planned; an older one may steer meanwhile. steering: it leads the fluid to the
    goal. out_of_reach: as steering, but something is known to be in the way. holding: it keeps the goal.
    done: it no longer steers."""
    method: str | None = None
    """Name of the method that planned."""
    first_frame: int | None = None
    """Frame of the session at which the sketch began to steer."""
    frames_done: int = 0
    """Number of frames that the sketch has steered so far, those of `hold` included."""
    frames: int | None = None
    """Number of frames in which the goal is to be reached, of several the last."""
    keyframe: int | None = None
    """Number of the present goal among several, from 0 on; null where there is one."""
    hold: int | None = None
    """Number of frames for which the goal is kept after that."""
    inside: float | None = None
    """Share of the mass in the goal after `frames`; null before, and for an arrow that keeps the fluid's
    shape."""
    inside_drawn: float | None = None
    """Share of the mass in the oval as it was drawn, at the same time; null for an arrow."""
    miss: float | None = None
    """Distance of the centre of mass from its target, at the same time [m]."""


class LastFrame(_Record):
    """Report on the computation of the latest frame."""

    substeps: int | None
    """Number of MPM's substeps; null where a network made the frame."""
    bound: str | None
    """Bound that chose the length of the substeps: "sound", "speed", "obstacle", "frame", "reference" or
    "fixed"; null where a network made the frame."""
    ms: float
    """Time that the simulator took for the frame [ms]."""


@dataclass(frozen=True)
class Timing:
    """Times of the latest frames, and the resulting pace."""

    ms_per_frame: float
    """Median time of a frame [ms]; 0 before the first frame.

    A network does all the work of a step in the first of the step's frames. Its times are therefore means
    over as many frames as a step spans.
    """
    ms_p95: float
    """95th percentile of the same times [ms]."""
    time_scale: float
    """Simulated seconds per second, measured over the last second."""


class Forces(_Record):
    """Mean forces of the material on walls and obstacles over the latest frames."""

    frames: int
    """Number of these frames, at most 40."""
    solids: tuple[str, ...]
    """Names of the walls, such as "y_lower", and "obstacles[0]" and so on; the first 64."""
    force: tuple[tuple[float, ...], ...]
    """Force on each, D components [N]; in 2D per metre of depth."""
    torque: tuple[tuple[float, ...], ...]
    """Torque on each about the origin, 1 number in 2D, 3 in 3D [N m]."""

    @classmethod
    def over(cls, latest: Sequence[npt.NDArray[np.float64]], dim: int) -> "Forces | None":
        """Return the means of tables as `Simulator.frame_forces` returns them; None without one."""
        if not latest:
            return None
        rows = np.mean([table[:MOST_SOLIDS] for table in latest], axis=0)
        walls = tuple(WallFaces.model_fields)[: 2 * dim]
        names = (*walls, *(f"obstacles[{i}]" for i in range(len(rows) - len(walls))))

        def table(columns: npt.NDArray[np.float64]) -> tuple[tuple[float, ...], ...]:
            return tuple(tuple(round(float(number), DIGITS) for number in row) for row in columns)

        return cls(frames=len(latest), solids=names, force=table(rows[:, :dim]), torque=table(rows[:, dim:]))


@dataclass(frozen=True, kw_only=True)
class Safeguard:
    """Safeguard of a hybrid session, and its record, at one instant."""

    r_c: float | None
    """Mean cosine in [-1, 1] below which the safeguard alarms; None where other guards alone do."""
    value: float | None
    """Mean cosine in [-1, 1] at present; None until both windows of time are full."""
    mpm_share: float
    """Share of the frames so far that MPM simulated, in [0, 1]."""
    frames: tuple[int, ...]
    """Frames at which `values` were taken, ascending."""
    values: tuple[float, ...]
    """Mean cosines over the last `HISTORY_FRAMES` frames."""
    decisions: tuple[Decision, ...]
    """All decisions between MPM and the network since frame 0."""

    def phases(self, frame: int) -> list[tuple[int, Mode]]:
        """Return the first frame and the mode of each phase in the last `HISTORY_FRAMES` before `frame`."""
        all_phases: list[tuple[int, Mode]] = [(0, "mpm")]
        all_phases += [(decision.frame, decision.mode) for decision in without_undone(self.decisions)]
        first = max(0, frame - HISTORY_FRAMES)
        ends = [start for start, _ in all_phases[1:]] + [frame + 1]
        return [phase for phase, end in zip(all_phases, ends, strict=True) if end > first]


@dataclass(frozen=True, kw_only=True, eq=False)
class View:
    """State of a simulation that other threads may read."""

    frame: int
    """Number of frames since the start."""
    time: float
    """Simulated time since the start [s]."""
    particles: int
    """Number N of particles."""
    centroid: tuple[float, ...] | None
    """Centre of mass (D,) [m]; None where there is no particle."""
    control: Control | None
    """Newest sketch that has steered or steers; None where there was none since frame 0."""
    last_frame: LastFrame | None
    """Report on the latest frame; None before the first."""
    mode: Mode
    """Simulator of the next frame: "mpm" or "neural"."""
    safeguard: Safeguard | None
    """Safeguard of a hybrid session; None in other sessions."""
    message: FrameMessage
    """Binary frame for viewers, as docs/reference/http-api.md describes it."""

    @property
    def steers(self) -> bool:
        """Whether a sketch steers."""
        return self.control is not None and self.control.phase != "done"


@dataclass(frozen=True, kw_only=True, eq=False)
class Particles:
    """State of all particles."""

    frame: int
    """Number of frames since the start."""
    time: float
    """Simulated time since the start [s]."""
    positions: npt.NDArray[np.float32]
    """(N, D) [m]."""
    velocities: npt.NDArray[np.float32]
    """(N, D) [m/s]."""
    types: npt.NDArray[np.uint8]
    """DeepMind's particle types (N,): 5 water, 6 sand, 7 elastic (goop), 8 viscous liquid."""
    ids: npt.NDArray[np.uint64]
    """Permanent numbers (N,) of the particles, ascending."""
    rigid: npt.NDArray[np.float64]
    """Numbers (B, 13) of the rigid bodies, as `Simulator.rigid_numbers` returns them."""

    def digest(self) -> str:
        """Return the digest of the state, which is that of the simulator."""
        return digest_of(self.ids, self.positions, self.velocities, self.rigid)


@dataclass(frozen=True, eq=False)
class CellMeans:
    """Means over the particles of each occupied cell of a grid. C is the number of these cells."""

    frame: int
    """Number of frames since the start."""
    cell: float
    """Side of a cell [m]."""
    points: _Floats
    """Mean position (C, D) of the cell's particles [m]."""
    values: _Floats
    """Mean value (C, K) of the cell's particles."""

    @classmethod
    def of(
        cls, frame: int, cell: float, positions: npt.NDArray[np.float32], values: npt.NDArray[np.float32]
    ) -> Self:
        """Average the values (N, K) of particles at positions (N, D) [m] over cells of a side [m]."""
        cells = np.floor(positions / np.float32(cell)).astype(np.int64)
        _, member = np.unique(cells, axis=0, return_inverse=True)
        member = member.ravel()
        count = np.bincount(member)

        def mean(columns: npt.NDArray[np.float32]) -> _Floats:
            sums = [np.bincount(member, column, len(count)) for column in columns.T]
            return np.stack(sums, axis=1) / count[:, None]

        return cls(frame, cell, mean(positions), mean(values))

    @classmethod
    def of_force(cls, frame: int, positions: npt.NDArray[np.float32], force: npt.NDArray[np.float32]) -> Self:
        """Average accelerations (N, D) [m/s^2]; cells without any are left out."""
        means = cls.of(frame, 1 / CELLS_PER_METRE, positions, force)
        acting = (means.values != 0).any(axis=1)
        return cls(frame, means.cell, means.points[acting], means.values[acting])

    @classmethod
    def of_pressure(cls, frame: int, samples: PressureSamples) -> Self:
        """Average the pressures [Pa] of the simulated particles."""
        cell = _PRESSURE_SPACINGS * samples.spacing
        return cls.of(frame, cell, samples.x, samples.pressure[:, None])


class SafeguardRecorder:
    """Latest values of a hybrid simulator's safeguard, which alarms below `r_c`."""

    def __init__(self, simulator: Simulator, r_c: float | None) -> None:
        self._simulator, self._r_c = simulator, r_c
        self._r_t = simulator.r_t
        self._values: deque[tuple[int, float]] = deque(maxlen=max(2, HISTORY_FRAMES // self._r_t))

    def on(self, simulator: Simulator) -> "SafeguardRecorder":
        """Return a recorder of a copy of the simulator, with the values so far."""
        twin = SafeguardRecorder(simulator, self._r_c)
        twin.restore(self._values)
        return twin

    def note(self) -> None:
        """Keep the present value, in one frame of each step of the network: it changes no faster."""
        value, frame = finite(self._simulator.safeguard), self._simulator.frame
        if value is not None and frame % self._r_t == 0:
            self._values.append((frame, value))

    @property
    def values(self) -> list[tuple[int, float]]:
        """Frames and their values, as plain data."""
        return list(self._values)

    def restore(self, values: Iterable[Sequence[float]] = ()) -> None:
        """Replace all values by those of a `values` property."""
        self._values.clear()
        self._values.extend((int(frame), value) for frame, value in values)

    def view(self) -> Safeguard:
        """Return the present state of the safeguard and its record."""
        return Safeguard(
            r_c=self._r_c,
            value=finite(self._simulator.safeguard),
            mpm_share=self._simulator.mpm_share,
            frames=tuple(frame for frame, _ in self._values),
            values=tuple(value for _, value in self._values),
            decisions=self._simulator.log,
        )


def frame_of(simulator: Simulator, *, solver_ms: float = 0.0, steered: bool = True) -> Frame:
    """Return the present state of a simulator as a frame for viewers."""
    population, scene = None, simulator.scene
    if scene.is_open:
        population = Population(ids=simulator.ids.astype(np.uint32), types=simulator.materials.copy())
    return Frame(
        number=simulator.frame,
        time=simulator.time,
        solver_ms=solver_ms,
        steered=steered,
        positions=simulator.positions,
        length=max(scene.size),
        population=population,
        rigid=Poses.of(simulator.rigid_numbers(), scene.dim) if scene.rigid else None,
    )


def finite(value: float | None) -> float | None:
    """Return a number for JSON, rounded to `DIGITS`; None where it is not finite."""
    return None if value is None or not math.isfinite(value) else round(value, DIGITS)
