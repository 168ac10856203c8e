"""`GuardValues`: the values of all guards along a motion, of a network or of MPM, without consequences."""

import functools
from collections import deque
from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from hybridmpm import _native
from hybridmpm.bench.report.timing import Clock
from hybridmpm.errors import SimulationError
from hybridmpm.hybrid.audits import Audit, Drift
from hybridmpm.hybrid.guard import Guard, Stage, View
from hybridmpm.hybrid.guards import (
    Cosine,
    Density,
    Divergence,
    Energy,
    Impact,
    NonFinite,
    Outside,
)
from hybridmpm.hybrid.handoff import STEPS, velocity, warm
from hybridmpm.hybrid.switch import MIN_ACTIVE_SHARE, NOISE_FLOOR
from hybridmpm.mpm import MpmSolver
from hybridmpm.scene import Scene

PLAIN = "cosine (paper)"
"""Label of the paper's reading of the cosine."""
AUDIT_PERIOD = 5
"""Steps from one audit to the next: fewer than in a simulator, so that there are more points."""

_Floats = npt.NDArray[np.float32]


def all_guards() -> dict[str, Guard]:
    """Return every guard by its label, the cosine in both readings."""
    guards: tuple[Guard, ...] = (
        Cosine(),
        Impact(),
        NonFinite(),
        Outside(),
        Density(),
        Energy(),
        Divergence(),
        Audit(period=AUDIT_PERIOD),
        Drift(period=AUDIT_PERIOD),
    )
    return {guard.name: guard for guard in guards} | {PLAIN: Cosine(safeguard="paper")}


class GuardValues:
    """The values of all guards at each step of a motion, and the time that each guard takes.

    Parameters
    ----------
    scene : Scene
    r_p : float
        Share of the particles that move.
    r_t : int
        Frames of a step.
    window : int
        Steps in each window of the cosine.
    """

    def __init__(self, scene: Scene, r_p: float, r_t: int, *, window: int = 10) -> None:
        self.guards = all_guards()
        """Guards by label."""
        self.seconds: dict[str, list[float]] = {name: [] for name in (*self.guards, "history", "state")}
        """Times of each guard's values by its label, and of what guards share [s].

        They share the history of accelerations ("history") and the state that the step leads to ("state").
        """
        self._mpm = MpmSolver(scene, r_p=r_p)
        self._r_t, self._dt = r_t, r_t * scene.frame_dt
        self._path: deque[_Floats] = deque([self._mpm.positions], maxlen=STEPS + 3)
        self._steps = 0
        self._history = _native.AccelerationHistory(
            self._mpm.particle_count,
            scene.dim,
            window=window,
            dt=self._dt,
            calm_acceleration=NOISE_FLOOR,
            min_active_share=MIN_ACTIVE_SHARE,
        )
        self._history.push(self._path[0])
        start = self._mpm.copy().prescribe(self._path[0], self._mpm.velocities, 0)
        for guard in self.guards.values():
            guard.begin(start)

    def after_step(self, x: _Floats) -> dict[str, float | None]:
        """Return the value of each guard at the end of the next step, None where a guard has none.

        Parameters
        ----------
        x : float32 (N, D)
            Positions at the end of the step [m].
        """
        self._steps += 1
        with Clock(self.seconds["history"]):
            signal = self._history.push(x)
        own = functools.cache(self._own_step)
        view = View(x=x, mpm=self._mpm, r_t=self._r_t, steps=self._steps, signal=signal, own=own)
        values = self._values(view, (Stage.RAW, Stage.MOTION))
        self._path.append(x)
        known = len(self._path) >= 3
        v = velocity(tuple(self._path), -1, self._dt) if known else self._mpm.velocities
        with Clock(self.seconds["state"]):
            report = self._mpm.prescribe(x, v, self._steps * self._r_t)
        view = View(x=x, mpm=self._mpm, r_t=self._r_t, steps=self._steps, report=report)
        return values | self._values(view, (Stage.STATE,))

    def _own_step(self) -> _Floats | None:
        """Return where MPM would lead in a step from the present state (N, D) [m]; None where it fails."""
        twin = self._mpm.copy()
        try:
            if len(self._path) == STEPS + 3:
                warm(twin, tuple(self._path), r_t=self._r_t, start=None, steps=STEPS)
            twin.advance(self._r_t)
        except SimulationError:
            return None
        return twin.positions

    def _values(self, view: View, stages: Sequence[Stage]) -> dict[str, float | None]:
        values: dict[str, float | None] = {}
        for name, guard in self.guards.items():
            if guard.stage in stages:
                with Clock(self.seconds[name]):
                    values[name] = guard.value(view)
        return values
