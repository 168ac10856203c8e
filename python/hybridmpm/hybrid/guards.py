"""Guards of the library, by name and from saved settings.

Each guard is evaluated once a step of the network, at its stage: on the network's output (`RAW`), on the
motion that this would make (`MOTION`), or on the state at the end (`STATE`). An alarm refuses the step, and
undoes `Guard.undo` steps before it.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import numpy.typing as npt

from hybridmpm import _core
from hybridmpm._support.arguments import real, whole
from hybridmpm._support.suggestions import did_you_mean
from hybridmpm.errors import ConfigError, SnapshotError
from hybridmpm.hybrid.guard import Guard, GuardInput, Stage
from hybridmpm.mpm import MpmSolver
from hybridmpm.scene.world import cells_of

_HYSTERESIS = 0.25
"""Share of the way from r_c to 1 above which a cosine is quiet."""

_Doubles = npt.NDArray[np.float64]


@dataclass(eq=False)
class Cosine(Guard):
    """Mean cosine between the accelerations of the last two windows of time; alarming below `r_c`.

    Particles that are calm in both windows do not count. A scene with too few others is calm (1).

    Parameters
    ----------
    r_c : float in [-1, 1]
        Alarming value. The network takes over again above r_c + (1 - r_c) / 4.
    """

    name = "cosine"
    stage = Stage.MOTION
    is_fault = False

    r_c: float = 0.8

    def __post_init__(self) -> None:
        self.r_c = real("r_c", self.r_c, -1, 1)

    def value(self, given: GuardInput) -> float | None:
        return None if given.signal is None else given.signal.cosine

    def alarms(self, value: float) -> bool:
        return value < self.r_c

    def is_quiet(self, value: float) -> bool:
        return value >= self.r_c + _HYSTERESIS * (1 - self.r_c)


@dataclass(eq=False)
class NonFinite(Guard):
    """Number of particles whose position is NaN or infinite."""

    name = "non-finite"
    stage = Stage.RAW
    undo = 1

    def value(self, given: GuardInput) -> float:
        finite = np.isfinite(given.x)
        # Along the particles it takes ten times as long.
        return 0.0 if finite.all() else float(np.count_nonzero(~finite.all(axis=1)))

    def alarms(self, value: float) -> bool:
        return value > 0


@dataclass(eq=False)
class Outside(Guard):
    """Number of particles outside of the world, or past a wall by more than one grid cell."""

    name = "outside"
    stage = Stage.RAW
    undo = 1

    def value(self, given: GuardInput) -> float:
        margin = 1 / given.mpm.resolution
        walls = given.mpm.scene.walls
        lower = np.maximum(np.array(walls.lower) - margin, 0).astype(np.float32)
        upper = np.minimum(np.array(walls.upper) + margin, given.mpm.scene.size).astype(np.float32)
        # False for NaN, which the guard `NonFinite` counts.
        past = (given.x < lower) | (given.x > upper)
        return float(np.count_nonzero(past.any(axis=1))) if past.any() else 0.0

    def alarms(self, value: float) -> bool:
        return value > 0


@dataclass(eq=False)
class Density(Guard):
    """Density over rest density that one particle in a hundred exceeds, over that when the network took over.

    Parameters
    ----------
    threshold : float > 1
        Alarming growth. MPM's own density in the seven scenarios grows by up to 1.46, where sand falls on
        ramps.
    """

    name = "density"
    stage = Stage.STATE
    undo = 4

    threshold: float = 1.7
    _start: float = field(default=1.0, init=False)

    def __post_init__(self) -> None:
        self.threshold = real("threshold", self.threshold, 1, 1e6)

    def begin(self, start: _core.MotionReport) -> None:
        self._start = max(start.density, 1.0)

    def value(self, given: GuardInput) -> float | None:
        return None if given.report is None else given.report.density / self._start

    def alarms(self, value: float) -> bool:
        return value > self.threshold


@dataclass(eq=False)
class Energy(Guard):
    """Growth of kinetic and potential energy above their least value since the network took over.

    In units of the kinetic and potential energy with which it took over, from the lowest corner of the walls.

    Parameters
    ----------
    threshold : float > 0
        Alarming growth. Elastic energy, which may turn into kinetic energy, is not counted: MPM's own value
        in the seven scenarios grows by up to 0.09.
    """

    name = "energy"
    stage = Stage.STATE
    undo = 4

    threshold: float = 0.15
    _least: float = field(default=np.inf, init=False)
    _scale: float = field(default=np.inf, init=False)

    def __post_init__(self) -> None:
        self.threshold = real("threshold", self.threshold, 0, 1e6)

    def begin(self, start: _core.MotionReport) -> None:
        self._least = start.kinetic_energy + start.potential_energy
        self._scale = np.inf

    def value(self, given: GuardInput) -> float | None:
        if given.report is None:
            return None
        energy = given.report.kinetic_energy + given.report.potential_energy
        if np.isinf(self._scale):
            self._scale = max(self._least - _lowest_energy(given.mpm), 1e-12)
        self._least = min(self._least, energy)
        return float((energy - self._least) / self._scale)

    def alarms(self, value: float) -> bool:
        return value > self.threshold


@dataclass(eq=False)
class Audit(Guard):
    """Error of the accelerations of coarse cells against MPM's own step, over that of free fall.

    Accelerations are averaged over the particles of a cell. So errors of single particles cancel, and common
    errors count. The value is sqrt(E / (S + floor^2)). E is the mean square of the cells' errors, weighted by
    mass, and S that of free fall, both smoothed over the audits since the network took over. The value is
    nearly 1 for a network that predicts free fall, and 0 for one that predicts MPM's own step.

    Parameters
    ----------
    threshold : float > 0
    period : int >= 1
        Steps from one audit to the next; the first step after the network took over is always audited.
    floor : float > 0
        Error of cells [m/s^2] that is allowed where MPM finds free fall, too. Two MPM runs with other jitter
        differ by this much.
    width : float >= 1
        Width of a cell, in cells of MPM's grid.
    memory : float in [0, 1)
        Weight of the earlier audits against the present one.
    """

    name = "audit"
    stage = Stage.MOTION
    undo = 1

    threshold: float = 0.9
    period: int = field(default=1, kw_only=True)
    floor: float = field(default=2.5, kw_only=True)
    width: float = field(default=4.0, kw_only=True)
    memory: float = field(default=0.5, kw_only=True)
    _error: float = field(default=0.0, init=False)
    _scale: float = field(default=0.0, init=False)

    def __post_init__(self) -> None:
        self.threshold = real("threshold", self.threshold, 0, 1e6)
        self.period = whole("period", self.period, 1, 1_000_000)
        self.floor = real("floor", self.floor, 1e-6, 1e6)
        self.width = real("width", self.width, 1, 1000)
        self.memory = real("memory", self.memory, 0, 0.999)

    def value(self, given: GuardInput) -> float | None:
        if given.steps == 0 or (given.steps - 1) % self.period:
            return None
        if given.steps == 1:
            self._error = self._scale = 0.0
        own = given.mpm_step()
        if own is None:
            return float("inf")
        error, scale = (_mean_square(given.mpm, one, self.width) for one in _departures(given, own))
        memory = self.memory if given.steps > 1 else 0.0
        self._error = memory * self._error + (1 - memory) * error
        self._scale = memory * self._scale + (1 - memory) * scale
        return float(np.sqrt(self._error / (self._scale + self.floor**2)))

    def alarms(self, value: float) -> bool:
        return not value < self.threshold


@dataclass(eq=False)
class Drift(Guard):
    """Lasting error of the mean acceleration of all particles against MPM's own step [m/s^2].

    A network may make a small error of the same direction in every step: it slows a flow, stops a slide, or
    ignores gravity. So the error of the mean, a vector, is averaged over the steps since the network took
    over. Errors of changing direction cancel, and lasting ones remain.

    Parameters
    ----------
    threshold : float > 0
        Alarming length of the average [m/s^2].
    period : int >= 1
        Steps from one audit to the next; the first step after the network took over is always audited.
    memory : float in [0, 1)
        Weight of the earlier audits against the present one. The first counts in full.
    """

    name = "drift"
    stage = Stage.MOTION
    undo = 1

    threshold: float = 1.75
    period: int = field(default=1, kw_only=True)
    memory: float = field(default=0.9, kw_only=True)
    _errors: tuple[float, ...] = field(default=(), init=False)

    def __post_init__(self) -> None:
        self.threshold = real("threshold", self.threshold, 0, 1e6)
        self.period = whole("period", self.period, 1, 1_000_000)
        self.memory = real("memory", self.memory, 0, 0.999)

    def begin(self, start: _core.MotionReport) -> None:  # noqa: ARG002 - of the interface
        self._errors = ()

    def value(self, given: GuardInput) -> float | None:
        if given.steps == 0 or (given.steps - 1) % self.period:
            return None
        own = given.mpm_step()
        if own is None:
            return float("inf")
        error, _ = _departures(given, own)
        mean = np.average(error, axis=0, weights=given.mpm.mass)
        before = np.array(self._errors) if self._errors else mean
        lasting = self.memory * before + (1 - self.memory) * mean
        self._errors = tuple(float(part) for part in lasting)
        return float(np.linalg.norm(lasting))

    def alarms(self, value: float) -> bool:
        return not value < self.threshold


GUARDS: dict[str, type[Guard]] = {
    guard.name: guard for guard in (Cosine, NonFinite, Outside, Density, Energy, Audit, Drift)
}
"""Classes of the guards by name."""

DEFAULT: tuple[str, ...] = ("non-finite", "outside", "density", "energy", "audit", "drift")


def build(guards: Iterable[str | Guard], r_c: float | None) -> tuple[Guard, ...]:
    """Return guards from names, in the order of their stages.

    Where `r_c` is given, the cosine guard has this threshold, and is added if it is not among them.

    Raises
    ------
    ConfigError
        A name is unknown or given twice; the message lists those there are.
    """
    if isinstance(guards, str):
        raise ConfigError(f"guards must be a list of names or guards, got the string {guards!r}")
    cosine = Cosine() if r_c is None else Cosine(r_c)
    made: list[Guard] = []
    for guard in guards:
        if isinstance(guard, Guard):
            made.append(guard.copy())
        elif guard == Cosine.name:
            made.append(cosine)
        elif guard in GUARDS:
            made.append(GUARDS[guard]())
        else:
            listed = ", ".join(GUARDS)
            raise ConfigError(f"guards must be among {listed}; got {guard!r}{did_you_mean(guard, GUARDS)}")
    _refuse_twins(made)
    if r_c is not None and not any(isinstance(guard, Cosine) for guard in made):
        made.append(cosine)
    return tuple(sorted(made, key=lambda guard: guard.stage.value))


def saved_settings(guards: Iterable[Guard]) -> list[dict[str, Any] | None]:
    """Return name and settings of each guard, for a file; None for a guard of the caller's own."""
    return [
        {"name": guard.name, "settings": guard.settings()} if type(guard) is GUARDS.get(guard.name) else None
        for guard in guards
    ]


def from_saved_settings(saved: Iterable[dict[str, Any] | None]) -> list[Guard]:
    """Return the guards whose names and settings `saved_settings` returned.

    Raises
    ------
    SnapshotError
        A guard was the caller's own: the file does not contain its code.
    """
    guards: list[Guard] = []
    for one in saved:
        if one is None:
            raise SnapshotError(
                "the file was saved with guards of your own: give all guards as `guards` to "
                "HybridSimulator.load"
            )
        guards.append(GUARDS[one["name"]](**one["settings"]))
    return guards


def _refuse_twins(guards: Sequence[Guard]) -> None:
    names = [guard.name for guard in guards]
    twice = sorted({name for name in names if names.count(name) > 1})
    if twice:
        raise ConfigError(f"guards must differ, got {twice[0]!r} twice")


def _lowest_energy(mpm: MpmSolver) -> float:
    """Potential energy [J] of all mass in the lowest corner of the walls."""
    scene = mpm.scene
    gravity = np.array(scene.gravity)
    depth = np.maximum(gravity * scene.walls.lower, gravity * scene.walls.upper).sum()
    return float(-mpm.mass.sum(dtype=np.float64) * depth)


def _departures(given: GuardInput, own: npt.NDArray[np.float32]) -> tuple[_Doubles, _Doubles]:
    """Return the differences (N, D) [m/s^2] of the accelerations of network and free fall from MPM's.

    Displacements of one step differ by dt^2 / 2 times the mean difference of the accelerations over it.
    """
    mpm = given.mpm
    dt = given.r_t * mpm.scene.frame_dt
    start, velocity = mpm.positions.astype(np.float64), mpm.velocities.astype(np.float64)
    fall = start + dt * velocity + 0.5 * dt**2 * np.array(mpm.scene.gravity)
    end = own.astype(np.float64)
    return 2 / dt**2 * (given.x.astype(np.float64) - end), 2 / dt**2 * (fall - end)


def _mean_square(mpm: MpmSolver, rows: _Doubles, width: float) -> float:
    """Return the mean square, weighted by mass, of the means of vectors (N, D) over the cells of a grid.

    The grid fills the world; `width` is that of its cells, in those of MPM's grid.
    """
    across = max(round(mpm.resolution / width), 1)
    counts = np.array(cells_of(mpm.scene.size, across))
    places = np.clip((mpm.positions * np.float32(across)).astype(np.int64), 0, counts - 1)
    _, cell = np.unique(places @ np.cumprod([1, *counts[:-1]]), return_inverse=True)
    mass = mpm.mass.astype(np.float64)
    masses = np.bincount(cell, weights=mass)
    sums = np.stack([np.bincount(cell, weights=mass * column) for column in rows.T], axis=1)
    return float(((sums**2).sum(axis=1) / masses).sum() / mass.sum())
