"""Guards that hold a step of the network against the same step by MPM."""

from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from hybridmpm import _core
from hybridmpm._support.arguments import real, whole
from hybridmpm.hybrid.guard import Guard, Stage, View
from hybridmpm.mpm import MpmSolver

_Doubles = npt.NDArray[np.float64]


@dataclass(eq=False)
class Audit(Guard):
    """Error of the accelerations of coarse cells against MPM's own step, over that of free fall.

    Accelerations are averaged over the particles of a cell: errors of single particles, which MPM too makes
    where particles lie otherwise, cancel, and a common error counts. The value is sqrt(E / (S + floor^2)).
    E is the mean square of the cells' errors, weighted by mass, and S that of free fall, both smoothed over
    the audits since the network took over. So it is nearly 1 for a network that predicts free fall, and 0
    for one that predicts what MPM would do.

    Parameters
    ----------
    threshold : float > 0
    period : int >= 1
        Steps from one audit to the next; the first step after the network took over is always audited.
    floor : float > 0
        Acceleration [m/s^2] by which cells may err where MPM too finds free fall: that by which MPM itself
        differs where particles lie otherwise.
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

    def value(self, view: View) -> float | None:
        if view.steps == 0 or (view.steps - 1) % self.period:
            return None
        if view.steps == 1:
            self._error = self._scale = 0.0
        own = view.own()
        if own is None:
            return float("inf")
        error, scale = (_mean_square(view.mpm, one, self.width) for one in _departures(view, own))
        memory = self.memory if view.steps > 1 else 0.0
        self._error = memory * self._error + (1 - memory) * error
        self._scale = memory * self._scale + (1 - memory) * scale
        return float(np.sqrt(self._error / (self._scale + self.floor**2)))

    def alarms(self, value: float) -> bool:
        return not value < self.threshold


@dataclass(eq=False)
class Drift(Guard):
    """Lasting error of the mean acceleration of all particles against MPM's own step [m/s^2].

    A network may err by little in every step, and always in the same direction: it brakes what flows, holds
    what slides, or forgets gravity. So the error of the mean, which is a vector, is averaged over the steps
    since the network took over: what changes its direction cancels, and what lasts stays.

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

    def begin(self, start: _core.MotionReport) -> None:  # noqa: ARG002 - of the protocol
        self._errors = ()

    def value(self, view: View) -> float | None:
        if view.steps == 0 or (view.steps - 1) % self.period:
            return None
        own = view.own()
        if own is None:
            return float("inf")
        error, _ = _departures(view, own)
        mean = np.average(error, axis=0, weights=view.mpm.mass)
        before = np.array(self._errors) if self._errors else mean
        lasting = self.memory * before + (1 - self.memory) * mean
        self._errors = tuple(float(part) for part in lasting)
        return float(np.linalg.norm(lasting))

    def alarms(self, value: float) -> bool:
        return not value < self.threshold


def _departures(view: View, own: npt.NDArray[np.float32]) -> tuple[_Doubles, _Doubles]:
    """Return by how much the accelerations of the network and of free fall differ from MPM's.

    Displacements of one step differ by dt^2 / 2 times the mean difference of the accelerations over it.
    """
    mpm = view.mpm
    dt = view.r_t * mpm.scene.frame_dt
    start, velocity = mpm.positions.astype(np.float64), mpm.velocities.astype(np.float64)
    fall = start + dt * velocity + 0.5 * dt**2 * np.array(mpm.scene.gravity)
    end = own.astype(np.float64)
    return 2 / dt**2 * (view.x.astype(np.float64) - end), 2 / dt**2 * (fall - end)


def _mean_square(mpm: MpmSolver, rows: _Doubles, width: float) -> float:
    """Return the mean square, weighted by mass, of the means of vectors (N, D) over the cells of a grid.

    The grid fills the world box; `width` is that of its cells, in those of MPM's grid.
    """
    across = max(round(mpm.resolution / width), 1)
    places = np.clip((mpm.positions * np.float32(across)).astype(np.int64), 0, across - 1)
    _, cell = np.unique(places @ across ** np.arange(mpm.dim), return_inverse=True)
    mass = mpm.mass.astype(np.float64)
    masses = np.bincount(cell, weights=mass)
    sums = np.stack([np.bincount(cell, weights=mass * column) for column in rows.T], axis=1)
    return float(((sums**2).sum(axis=1) / masses).sum() / mass.sum())
