"""`AutoSolver`: a simulator that keeps a time budget by changing its level."""

import time
import warnings
from collections import deque
from collections.abc import Callable, Sequence
from copy import deepcopy
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any, ClassVar, Self

import numpy as np
import numpy.typing as npt
from pydantic import PrivateAttr

from hybridmpm import _core
from hybridmpm._support.arguments import flag
from hybridmpm._support.packing import as_snapshot_error, from_bytes, to_bytes
from hybridmpm.coarse import CoarseParticles, CoarseSimulator, Upsampler
from hybridmpm.decisions import Decision, Mode
from hybridmpm.errors import ConfigError
from hybridmpm.planner.candidates import Candidate
from hybridmpm.planner.planning import Estimate, Plan, estimates, plan
from hybridmpm.probes.probe import PressureSamples
from hybridmpm.scene import Particles, Scene
from hybridmpm.simulator import Kind

_MAGIC, _VERSION = b"HMPMAUTO", 3
WINDOW = 20
"""Number of the latest frames that a decision is based on: five updates of the particles shown."""
_NTH_LONGEST = 2
"""The second longest time of the window has to keep within the budget: one frame in twenty may exceed it."""
_ROOM = 0.8
"""Largest share of the budget that a more accurate level may take, by its estimate, to be tried."""
_FIRST_WAIT, _LONGEST_WAIT = 2 * WINDOW, 1024
"""Frames at a level before a more accurate one is tried, and the most of them after failed attempts."""
_QUIET = 8 * WINDOW
"""Frames in a row that must leave room, after busy ones, for the machine to count as quiet again."""

_Floats = npt.NDArray[np.float32]


@dataclass(frozen=True, kw_only=True)
class Change:
    """A change of level."""

    frame: int
    """Number of the last frame of the former level."""
    before: str
    """Name of the former level."""
    after: str
    """Name of the new level."""
    ms_per_frame: float
    """Time of the frames before [ms]."""


@dataclass
class Controller:
    """Chooses among levels by the times of frames, with neither clock nor simulator.

    Parameters
    ----------
    expected : sequence of float
        Expected times of the coarse levels [ms], ascending.
    budget : float
        Time that a frame may take [ms].
    index : int
        Index of the present coarse level.
    """

    expected: Sequence[float]
    budget: float
    index: int
    _times: deque[float] = field(default_factory=lambda: deque(maxlen=WINDOW))
    _frames: int = 0
    _wait: int = _FIRST_WAIT
    _climbed: bool = False
    _with_room: int = 0
    _was_busy: bool = False

    @property
    def time(self) -> float | None:
        """Time of a frame [ms]: the second longest of the window; None until it is full."""
        return sorted(self._times)[-_NTH_LONGEST] if len(self._times) == WINDOW else None

    def enter(self, milliseconds: float) -> int:
        """Enter the time of a frame, and return the level for the next ones.

        Above the budget it is the most accurate of the faster levels whose estimate is within, else the
        fastest. Otherwise it is the next more accurate level, if the budget has room for it. After a level
        that exceeded the budget, the next attempt takes twice as many frames, until one lasts. Where the
        budget had no room for a while, for other programs slowed the machine, the attempt is made as soon as
        it is quiet again.
        """
        self._times.append(milliseconds)
        self._frames += 1
        time = self.time
        if time is None:
            return self.index
        factor = time / self.expected[self.index]
        if time > self.budget and self.index > 0:
            within = [i for i in range(self.index) if factor * self.expected[i] <= self.budget]
            if self._climbed:
                self._wait = min(2 * self._wait, _LONGEST_WAIT)
            self._change(max(within, default=0), climbed=False)
            return self.index
        if self._climbed and self._frames >= _FIRST_WAIT:
            self._climbed, self._wait = False, _FIRST_WAIT
        if self.index + 1 < len(self.expected):
            has_room = factor * self.expected[self.index + 1] <= _ROOM * self.budget
            self._with_room = self._with_room + 1 if has_room else 0
            self._was_busy |= not has_room
            is_quiet_again = self._was_busy and self._with_room >= _QUIET
            if has_room and (self._frames >= self._wait or is_quiet_again):
                self._change(self.index + 1, climbed=True)
        return self.index

    def _change(self, index: int, *, climbed: bool) -> None:
        self.index, self._climbed, self._frames = index, climbed, 0
        self._with_room, self._was_busy = 0, False
        self._times.clear()


class _ContinuedScene(Scene):
    """A scene whose particles are given: a solver of it begins at their positions and velocities."""

    _particles: Particles = PrivateAttr()

    @classmethod
    def of(cls, scene: Scene, x: _Floats, v: _Floats) -> "_ContinuedScene":
        """Return a scene with its own particles at `x` (N, D) [m] with velocities `v` (N, D) [m/s]."""
        # The fields of the scene have been validated.
        found = cls.model_construct(**{name: getattr(scene, name) for name in Scene.model_fields})
        found._particles = replace(scene.sample(), x=x, v=v)  # noqa: SLF001 - of this class
        return found

    def sample(self) -> Particles:
        """Return the particles."""
        return self._particles


class AutoSolver(CoarseSimulator):
    """Simulator within a time budget: it changes between levels, methods of different cost.

    The first level is the method of `plan(scene, budget_ms=...)`. Frames are timed. Where they exceed the
    budget, a faster level goes on; where they leave much of it, a more accurate one. All particles of the
    scene are shown throughout, and a change moves none of them: the particles simulated are merged anew from
    those shown, at their velocities. Other state of the material (J, F) starts anew. A change takes some 20
    to 60 ms at 4000 particles.

    Levels depend on a clock, so two runs need not have the same bits; `changes` lists the changes.

    Parameters
    ----------
    scene : Scene
        Scene without emitters, sinks and moving obstacles.
    budget_ms : float > 0
        Time budget of a frame, with what is shown [ms].
    threads : int in [1, 1024]
        Threads of the solver; plans count with one.
    measure : str
        Error by which levels are ranked; see `plan`.
    learned : bool
        Whether hybrids and networks that show all particles are levels, too. Networks are candidates only if
        no MPM setting is both faster and more accurate. Each begins with frames of MPM, its history.
    calibration : str or Path, optional
        As for `plan`.
    clock : callable
        Returns the time [s].

    Raises
    ------
    ConfigError
        The scene has emitters, sinks or moving obstacles, or as `plan`.
    DataError, SceneError
        As `plan`.
    """

    kind: ClassVar[Kind] = "mpm"

    def __init__(
        self,
        scene: Scene,
        *,
        budget_ms: float,
        threads: int = 1,
        measure: str = "grid_rmse",
        learned: bool = False,
        calibration: str | Path | None = None,
        clock: Callable[[], float] = time.perf_counter,
    ) -> None:
        self._plan = plan(scene, budget_ms=budget_ms, measure=measure, calibration=calibration)
        if scene.is_open or any(obstacle.motion is not None for obstacle in scene.obstacles):
            raise ConfigError(
                "an AutoSolver starts a new solver at each change, so its scene must have no emitters, sinks "
                "and moving obstacles; choose one method by plan(scene, budget_ms=...)"
            )
        self._scene, self._threads, self._clock = scene, threads, clock
        found = estimates(scene, measure=measure, calibration=calibration)
        self._levels, expected = _pareto_front(found, learned=flag("learned", learned))
        first = max((i for i, ms in enumerate(expected) if ms <= budget_ms), default=0)
        self._controller = Controller(expected, float(budget_ms), first)
        self._first_controller = self._controller
        self._offset, self._changes, self._earlier = 0, list[Change](), tuple[Decision, ...]()
        self._start: Scene = scene
        self._keeps_forces = False
        self._inner = self._made()
        self._first_inner = self._inner
        self.reset()

    def _made(self) -> CoarseSimulator:
        """Return a solver of the present level at the start of its frames."""
        with warnings.catch_warnings():
            if self._changes:
                warnings.simplefilter("ignore")  # raised at the start
            made = self._levels[self._controller.index].make(self._start, self._threads)
        if self._keeps_forces and made.kind == "mpm":
            made.keep_forces()
        return made

    @property
    def plan(self) -> Plan:
        """The plan at the start."""
        return self._plan

    @property
    def level_name(self) -> str:
        """Name of the present level."""
        return self._levels[self._controller.index].name

    @property
    def level_names(self) -> tuple[str, ...]:
        """Names of all levels, the fastest first."""
        return tuple(one.name for one in self._levels)

    @property
    def changes(self) -> tuple[Change, ...]:
        """All changes of level so far."""
        return tuple(self._changes)

    def _advance_frame(self, force: _Floats | None) -> None:
        began = self._clock()
        self._advance_coarse(force)
        _ = self._inner.positions
        took = 1e3 * (self._clock() - began)
        before, level = self._controller.index, self._controller.time
        if self._controller.enter(took) != before:
            self._change(before, took if level is None else level)

    def _advance_coarse(self, force: _Floats | None) -> None:
        """Advance the simulator of the present level, with the particles that it shows."""
        self._inner.advance(1, force)

    def _change(self, before: int, ms: float) -> None:
        names = [self._levels[level].name for level in (before, self._controller.index)]
        self._changes.append(Change(frame=self.frame, before=names[0], after=names[1], ms_per_frame=ms))
        self._start = _ContinuedScene.of(self._scene, self._inner.positions, self._inner.velocities)
        self._earlier, self._offset = self.log, self.frame
        self._inner = self._made()

    @property
    def _coarse(self) -> CoarseParticles:
        return self._inner._coarse  # noqa: SLF001 - of this class's family

    @property
    def _upsampler(self) -> Upsampler | None:
        return self._inner._upsampler  # noqa: SLF001 - of this class's family

    @property
    def scene(self) -> Scene:
        """The scene that this simulator was made from."""
        return self._scene

    @property
    def r_p(self) -> float:
        """Ratio of the particles that are simulated to those of the scene, in (0, 1]."""
        return self._inner.r_p

    @property
    def r_t(self) -> int:
        """Frames of a step of the present level: 1 of MPM."""
        return self._inner.r_t

    @property
    def mode(self) -> Mode:
        """Simulator of the next frame: "mpm" or "neural"."""
        return self._inner.mode

    @property
    def log(self) -> tuple[Decision, ...]:
        """Decisions of networks and guards so far, by frames since the start; empty of MPM."""
        later = self._offset
        present = (
            replace(one, frame=one.frame + later, noticed=one.noticed + later) for one in self._inner.log
        )
        return (*self._earlier, *present)

    @property
    def frame(self) -> int:
        """Number of frames since the start."""
        return self._offset + self._inner.frame

    @property
    def last_frame(self) -> _core.FrameReport | None:
        """Substeps of the latest frame; None before the first of a level."""
        return self._inner.last_frame

    def diagnostics(self) -> _core.Diagnostics:
        """Mass, momentum, energies and extremes over the particles simulated, at this instant."""
        return self._inner.diagnostics()

    def pressure_samples(self) -> PressureSamples:
        """Return the pressures of the particles simulated, where MPM simulates."""
        return self._inner.pressure_samples()

    def keep_forces(self) -> None:
        """Sum the forces on walls and obstacles in all later frames that MPM simulates."""
        self._inner.keep_forces()
        self._keeps_forces = True

    def frame_forces(self) -> npt.NDArray[np.float64]:
        """Return the forces on walls and obstacles in the latest frame, where MPM simulates."""
        return self._inner.frame_forces()

    def reset(self) -> None:
        """Go back to frame 0, at the level of the plan."""
        self._controller = deepcopy(self._first_controller)
        self._offset, self._changes, self._earlier, self._start = 0, [], (), self._scene
        self._inner = self._first_inner.copy()
        if self._keeps_forces:
            self._inner.keep_forces()

    def copy(self) -> Self:
        """Return an independent simulator in the same state."""
        twin = self._shallow()
        twin.__dict__.update(
            _controller=deepcopy(self._controller), _changes=list(self._changes), _inner=self._inner.copy()
        )
        return twin

    def snapshot(self) -> bytes:
        """Return state and level, versioned and checksummed; the times of the latest frames are not kept."""
        start = self._start.sample()
        tree = {
            "level": self._controller.index,
            "offset": self._offset,
            "x": start.x,
            "v": start.v,
            "inner": self._inner.snapshot(),
            "changes": [asdict(change) for change in self._changes],
            "earlier": [asdict(decision) for decision in self._earlier],
        }
        return to_bytes(_MAGIC, _VERSION, tree)

    def restore(self, data: bytes) -> None:
        """Take the state of a snapshot of the same scene and budget.

        Raises
        ------
        SnapshotError
            The bytes are damaged or of another scene; the present state is then untouched.
        """
        twin = self.copy()
        with as_snapshot_error("snapshot"):
            twin._take(from_bytes(_MAGIC, _VERSION, data))  # noqa: SLF001 - of this very class
        self.__dict__.update(twin.__dict__)

    def _take(self, tree: dict[str, Any]) -> None:
        """Take the state of a snapshot's tree; where this raises, the state is incomplete."""
        self._controller = deepcopy(self._first_controller)
        self._controller.index = int(tree["level"])
        self._changes = [Change(**change) for change in tree["changes"]]
        self._earlier = tuple(Decision(**one) for one in tree["earlier"])
        self._offset = int(tree["offset"])
        self._start = _ContinuedScene.of(self._scene, tree["x"], tree["v"]) if self._changes else self._scene
        self._inner = self._made()
        self._inner.restore(tree["inner"])

    def __reduce__(self) -> tuple[Any, ...]:
        # A snapshot leaves out the times of the latest frames, on which the next level depends.
        return object.__new__, (type(self),), self.__dict__

    def _settings_to_save(self) -> dict[str, Any]:
        raise ConfigError(
            "an AutoSolver is not written to files: its level depends on a clock; record its states, or "
            "choose one method by plan(scene, budget_ms=...) and save the solver that it makes"
        )


def _pareto_front(
    found: list[tuple[Estimate, Candidate]], *, learned: bool
) -> tuple[list[Candidate], list[float]]:
    """Return the Pareto-optimal methods that show all particles, with their times [ms], ascending."""
    whole = [
        (expected, level)
        for expected, level in found
        if (learned or level.model is None) and level.softer == 1 and (level.show_all or level.r_p == 1)
    ]
    whole.sort(key=lambda one: (one[0].ms_per_frame, one[0].error))
    levels, times, least = [], [], float("inf")
    for expected, level in whole:
        if expected.error < least:
            levels.append(level)
            times.append(expected.ms_per_frame)
            least = expected.error
    return levels, times
