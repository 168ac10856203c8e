"""Guards: measures of a network's motion that tell when MPM has to take over.

All share one small interface, `Guard`. Each is asked once a step of the network, at its stage: first for what
the network answered as it is (`RAW`), then for the motion that this would make (`MOTION`), then for the
state that it has made (`STATE`). An alarm refuses the step; where a guard may notice late, some steps before
it are undone as well (`Guard.undo`).
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from hybridmpm import _core
from hybridmpm._support.arguments import real, whole
from hybridmpm._support.suggestions import did_you_mean
from hybridmpm.errors import ConfigError
from hybridmpm.hybrid.audits import Audit, Drift
from hybridmpm.hybrid.guard import Guard, Stage, View
from hybridmpm.mpm import MpmSolver

Safeguard = Literal["ours", "paper"]


@dataclass(eq=False)
class Cosine(Guard):
    """Mean cosine between the accelerations of the last two windows of time; alarming below `r_c`.

    "ours" leaves out the particles that are calm in both windows, and calls a scene with too few others calm
    (1); "paper" is the plain mean.
    """

    name = "cosine"
    stage = Stage.MOTION
    is_fault = False

    r_c: float = 0.8
    hysteresis: float = 0.25
    safeguard: Safeguard = "ours"

    def __post_init__(self) -> None:
        self.r_c = real("r_c", self.r_c, -1, 1)
        self.hysteresis = real("hysteresis", self.hysteresis, 0, 1)
        if self.safeguard not in ("ours", "paper"):
            raise ConfigError(f"safeguard must be 'ours' or 'paper', got {self.safeguard!r}")

    def value(self, view: View) -> float | None:
        if view.signal is None:
            return None
        return view.signal.cosine if self.safeguard == "ours" else view.signal.plain

    def alarms(self, value: float) -> bool:
        return value < self.r_c

    def is_quiet(self, value: float) -> bool:
        return value >= self.r_c + self.hysteresis * (1 - self.r_c)


@dataclass(eq=False)
class Impact(Guard):
    """Jump of the largest accelerations: their power mean over that of the steps before.

    Late, because MPM feels a wall from more than a cell away: an impact has begun before a network shows it.

    Parameters
    ----------
    threshold : float > 1
        Alarming ratio.
    memory : int
        Steps that the present one is compared with.
    floor : float > 0
        Accelerations below this [m/s^2] count as this.
    """

    name = "impact"
    stage = Stage.MOTION
    is_fault = False
    undo = 2

    threshold: float = 3.0
    memory: int = field(default=10, kw_only=True)
    floor: float = field(default=3.0, kw_only=True)
    _before: tuple[float, ...] = field(default=(), init=False)

    def __post_init__(self) -> None:
        self.threshold = real("threshold", self.threshold, 1, 1e6)
        self.memory = whole("memory", self.memory, 1, 10_000)
        self.floor = real("floor", self.floor, 1e-6, 1e6)

    def value(self, view: View) -> float | None:
        if view.signal is None or view.signal.largest == 0:
            return None
        largest, before = view.signal.largest, self._before
        ratio = largest / max(sum(before) / len(before), self.floor) if before else None
        # A step that will be refused did not happen; MPM's own will be remembered in its place.
        if view.steps == 0 or ratio is None or not self.alarms(ratio):
            self._before = (*before, largest)[-self.memory :]
        return ratio

    def alarms(self, value: float) -> bool:
        return value > self.threshold


@dataclass(eq=False)
class NonFinite(Guard):
    """Number of particles whose position is NaN or infinite."""

    name = "non-finite"
    stage = Stage.RAW
    undo = 1

    def value(self, view: View) -> float:
        finite = np.isfinite(view.x)
        # Along the particles it takes ten times as long.
        return 0.0 if finite.all() else float(np.count_nonzero(~finite.all(axis=1)))

    def alarms(self, value: float) -> bool:
        return value > 0


@dataclass(eq=False)
class Outside(Guard):
    """Number of particles outside of [0, 1]^D, or past a wall by more than one grid cell."""

    name = "outside"
    stage = Stage.RAW
    undo = 1

    def value(self, view: View) -> float:
        margin = 1 / view.mpm.resolution
        walls = view.mpm.scene.walls
        lower = np.maximum(np.array(walls.lower) - margin, 0).astype(np.float32)
        upper = np.minimum(np.array(walls.upper) + margin, 1).astype(np.float32)
        # False for NaN, which another guard tells.
        past = (view.x < lower) | (view.x > upper)
        return float(np.count_nonzero(past.any(axis=1))) if past.any() else 0.0

    def alarms(self, value: float) -> bool:
        return value > 0


@dataclass(eq=False)
class Density(Guard):
    """Density over rest density that one particle in a hundred exceeds, over that when the network took over.

    Parameters
    ----------
    threshold : float > 1
        Alarming growth. What MPM itself does in the seven scenarios grows by up to 1.46, where sand falls on
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

    def value(self, view: View) -> float | None:
        return None if view.report is None else view.report.density / self._start

    def alarms(self, value: float) -> bool:
        return value > self.threshold


@dataclass(eq=False)
class Energy(Guard):
    """Growth of kinetic and potential energy above their least value since the network took over.

    In units of the kinetic and potential energy with which it took over, from the lowest corner of the walls.

    Parameters
    ----------
    threshold : float > 0
        Alarming growth. Elastic energy, which may turn into kinetic energy, is not counted: what MPM itself
        does in the seven scenarios grows by up to 0.09.
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

    def value(self, view: View) -> float | None:
        if view.report is None:
            return None
        energy = view.report.kinetic_energy + view.report.potential_energy
        if np.isinf(self._scale):
            self._scale = max(self._least - _lowest_energy(view.mpm), 1e-12)
        self._least = min(self._least, energy)
        return float((energy - self._least) / self._scale)

    def alarms(self, value: float) -> bool:
        return value > self.threshold


@dataclass(eq=False)
class Divergence(Guard):
    """Root mean square of the divergence of velocity [1/s]: an alternative to the cosine, and dearer.

    Parameters
    ----------
    threshold : float > 0
        Alarming value [1/s].
    """

    name = "divergence"
    stage = Stage.STATE
    is_fault = False

    threshold: float = 15.0

    def __post_init__(self) -> None:
        self.threshold = real("threshold", self.threshold, 0, 1e9)

    def value(self, view: View) -> float | None:
        return None if view.report is None else view.report.divergence

    def alarms(self, value: float) -> bool:
        return value > self.threshold


GUARDS: dict[str, type[Guard]] = {
    guard.name: guard
    for guard in (Cosine, Impact, NonFinite, Outside, Density, Energy, Divergence, Audit, Drift)
}
"""Classes of the guards by name."""

DEFAULT: tuple[str, ...] = ("non-finite", "outside", "density", "energy", "audit", "drift")


def build(guards: Iterable[str | Guard], cosine: Cosine, *, is_asked_for: bool) -> tuple[Guard, ...]:
    """Make guards of names, in the order of their stages; "cosine" stands for the one given.

    Where the cosine is asked for by itself, it is added if none is there.

    Raises
    ------
    ConfigError
        A name is unknown or given twice; the message lists those there are.
    """
    if isinstance(guards, str):
        raise ConfigError(f"guards must be a list of names or guards, got the text {guards!r}")
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
    if is_asked_for and not any(isinstance(guard, Cosine) for guard in made):
        made.append(cosine)
    return tuple(sorted(made, key=lambda guard: guard.stage.value))


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
