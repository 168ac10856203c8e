"""`AutoSolver`: a simulator that keeps a time budget by changing its level."""

import time
import warnings
from collections.abc import Callable
from copy import deepcopy
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any, ClassVar, Self

import numpy as np
import numpy.typing as npt

from hybridmpm import _core
from hybridmpm._support.arguments import flag
from hybridmpm._support.packing import pack, unfitting, unpack
from hybridmpm.decisions import Decision, Mode
from hybridmpm.errors import ConfigError
from hybridmpm.planner.candidates import Candidate
from hybridmpm.planner.controller import Controller
from hybridmpm.planner.ongoing import Ongoing
from hybridmpm.planner.planning import Plan, Prospect, plan, prospective
from hybridmpm.scene import Scene
from hybridmpm.simulator import Kind, Simulator

_MAGIC, _VERSION = b"HMPMAUTO", 2

_Floats = npt.NDArray[np.float32]


@dataclass(frozen=True, kw_only=True)
class Change:
    """A change of level."""

    frame: int
    """Frame after which the other coarse level goes on."""
    before: str
    """Name of the coarse level until then."""
    after: str
    """Name of the coarse level from then on."""
    ms_per_frame: float
    """What frames took before [ms]."""


class AutoSolver(Simulator):
    """The most accurate coarse level whose frames keep within a time.

    It begins at the coarse level of `plan(scene, budget_ms=...)`, takes the time of each frame, and changes to a
    cheaper or to a more accurate coarse level when frames leave the budget or leave much of it. All particles of the
    scene are shown throughout, and a change moves none of them: those that are simulated from then on are
    merged anew from those shown, at their velocities. What the material remembers beyond (J, F) begins anew.
    A change itself takes some 20 to 60 ms at 4000 particles.

    Which coarse level simulates depends on a clock, so two runs need not have the same bits; `changes` tells what
    happened.

    Parameters
    ----------
    scene : Scene
        Scene without emitters, sinks and moving obstacles.
    budget_ms : float > 0
        Time that a frame may take, with what is shown [ms].
    threads : int in [1, 1024]
        Threads of the solver; plans count with one.
    measure : str
        Error by which coarse levels are ranked; see `plan`.
    learned : bool
        Whether hybrids and networks that carry all particles are levels, too, where no MPM is both quicker and
        more accurate. Each begins with some frames of MPM, which it looks back on.
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
                "a solver that changes coarse level begins anew at each change, so its scene must have no emitters, "
                "sinks and moving obstacles; choose one coarse level by plan(scene, budget_ms=...)"
            )
        self._scene, self._threads, self._clock = scene, threads, clock
        found = prospective(scene, measure=measure, calibration=calibration)
        self._levels, expected = _front(found, learned=flag("learned", learned))
        first = max((i for i, ms in enumerate(expected) if ms <= budget_ms), default=0)
        self._controller = Controller(expected, float(budget_ms), first)
        self._begin = self._controller
        self._offset, self._changes, self._earlier = 0, list[Change](), tuple[Decision, ...]()
        self._started: Scene = scene
        self._made()
        self._first_inner = self._inner
        self.reset()

    def _made(self) -> None:
        """Make the solver of the present level, of the scene as it is."""
        with warnings.catch_warnings():
            if self._changes:
                warnings.simplefilter("ignore")  # they have been told
            self._inner = self._levels[self._controller.index].make(self._started, self._threads)

    @property
    def plan(self) -> Plan:
        """The plan that it began with."""
        return self._plan

    @property
    def level_name(self) -> str:
        """Name of the coarse level that simulates the next frame."""
        return self._levels[self._controller.index].name

    @property
    def level_names(self) -> tuple[str, ...]:
        """Names of the coarse levels among which it changes, the cheapest first."""
        return tuple(one.name for one in self._levels)

    @property
    def changes(self) -> tuple[Change, ...]:
        """All changes of coarse level so far."""
        return tuple(self._changes)

    def _advance_frame(self, force: _Floats | None) -> None:
        began = self._clock()
        self._inner.advance(1, force)
        _ = self._inner.positions
        took = 1e3 * (self._clock() - began)
        before, level = self._controller.index, self._controller.time
        if self._controller.enter(took) != before:
            self._change(before, took if level is None else level)

    def _change(self, before: int, ms: float) -> None:
        names = [self._levels[level].name for level in (before, self._controller.index)]
        self._changes.append(Change(frame=self.frame, before=names[0], after=names[1], ms_per_frame=ms))
        self._started = Ongoing.of(self._scene, self._inner.positions, self._inner.velocities)
        self._earlier, self._offset = self.log, self.frame
        self._made()

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
        """Frames that the present coarse level computes at once: 1 of MPM."""
        return self._inner.r_t

    @property
    def mode(self) -> Mode:
        """Who simulates the next frame."""
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
    def particle_spacing(self) -> float:
        """Distance of the particles of `positions` at rest [m]."""
        return self._scene.spacing

    @property
    def particle_count(self) -> int:
        """Number N of particles."""
        return self._inner.particle_count

    @property
    def ids(self) -> npt.NDArray[np.uint64]:
        """Numbers (N,) that the particles keep for good, ascending; read-only."""
        return self._inner.ids

    @property
    def positions(self) -> _Floats:
        """Positions (N, D) [m]; a snapshot, read-only."""
        return self._inner.positions

    @property
    def velocities(self) -> _Floats:
        """Velocities (N, D) [m/s]; a snapshot, read-only."""
        return self._inner.velocities

    @property
    def materials(self) -> npt.NDArray[np.uint8]:
        """DeepMind's particle types (N,); a snapshot, read-only."""
        return self._inner.materials

    @property
    def mass(self) -> _Floats:
        """Masses (N,) [kg]; a snapshot, read-only."""
        return self._inner.mass

    @property
    def last_frame(self) -> _core.FrameReport | None:
        """How the latest frame was cut into substeps; None before the first of a level."""
        return self._inner.last_frame

    def diagnostics(self) -> _core.Diagnostics:
        """Mass, momentum, energies and extremes over the particles simulated, at this instant."""
        return self._inner.diagnostics()

    def cancel_by(self, flag: _core.CancelFlag) -> None:
        """Let another thread end the frame that is being computed; see `Simulator.cancel_by`."""
        super().cancel_by(flag)
        self._inner.cancel_by(flag)

    def reset(self) -> None:
        """Go back to frame 0, at the coarse level of the plan."""
        self._controller = deepcopy(self._begin)
        self._offset, self._changes, self._earlier, self._started = 0, [], (), self._scene
        self._inner = self._first_inner.copy()

    def copy(self) -> Self:
        """Return an independent simulator in the same state."""
        twin = object.__new__(type(self))
        twin.__dict__.update(self.__dict__)
        twin._controller = deepcopy(self._controller)
        twin._changes, twin._inner = list(self._changes), self._inner.copy()
        return twin

    def snapshot(self) -> bytes:
        """Return state and level, versioned and checksummed; the times of the latest frames are not kept."""
        start = self._started.sample()
        return pack(
            _MAGIC,
            _VERSION,
            {
                "coarse": self._controller.index,
                "offset": self._offset,
                "x": start.x,
                "v": start.v,
                "inner": self._inner.snapshot(),
                "changes": [asdict(change) for change in self._changes],
                "earlier": [asdict(decision) for decision in self._earlier],
            },
        )

    def restore(self, data: bytes) -> None:
        """Take the state of a snapshot of the same scene and budget.

        Raises
        ------
        SnapshotError
            The bytes are damaged or of another scene; the present state is then untouched.
        """
        twin = self.copy()
        with unfitting("snapshot"):
            state = unpack(_MAGIC, _VERSION, data)
            twin._controller = deepcopy(self._begin)  # noqa: SLF001 - of this very class
            twin._controller.index = int(state["coarse"])  # noqa: SLF001
            twin._changes = [Change(**change) for change in state["changes"]]  # noqa: SLF001
            twin._earlier = tuple(Decision(**one) for one in state["earlier"])  # noqa: SLF001
            twin._offset = int(state["offset"])  # noqa: SLF001
            is_first = not twin._changes  # noqa: SLF001
            twin._started = self._scene if is_first else Ongoing.of(self._scene, state["x"], state["v"])  # noqa: SLF001
            twin._made()  # noqa: SLF001
            twin._inner.restore(state["inner"])  # noqa: SLF001
        self.__dict__.update(twin.__dict__)

    def _settings_to_save(self) -> dict[str, Any]:
        raise ConfigError(
            "a solver that changes coarse level is not written to files: its coarse level depends on a clock; record its "
            "states, or choose one coarse level by plan(scene, budget_ms=...) and save the solver that it makes"
        )


def _front(found: list[tuple[Prospect, Candidate]], *, learned: bool) -> tuple[list[Candidate], list[float]]:
    """Return the coarse levels that show all particles and that no other beats, with their times [ms], ascending."""
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
