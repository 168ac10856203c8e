"""All guards at once on a motion, whoever makes it, without doing anything about it."""

import time
from collections import deque
from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from hybridmpm import _native
from hybridmpm.hybrid.engine import MIN_ACTIVE_SHARE, NOISE_FLOOR
from hybridmpm.hybrid.guard import Guard, Stage, View
from hybridmpm.hybrid.guards import Audit, Cosine, Density, Divergence, Energy, Impact, NonFinite, Outside
from hybridmpm.hybrid.handoff import velocity
from hybridmpm.mpm import MpmSolver
from hybridmpm.scene import Scene

PLAIN = "cosine (paper)"
AUDIT_PERIOD = 5
"""Steps between two audits: more of them than a simulator makes, to have more points."""

_Floats = npt.NDArray[np.float32]


def all_guards() -> dict[str, Guard]:
    """Every guard by its label, the cosine in both readings."""
    guards: tuple[Guard, ...] = (
        Cosine(),
        Impact(),
        NonFinite(),
        Outside(),
        Density(),
        Energy(),
        Divergence(),
        Audit(period=AUDIT_PERIOD),
    )
    return {guard.name: guard for guard in guards} | {PLAIN: Cosine(safeguard="paper")}


class Watch:
    """Guards that see each step of a motion.

    Parameters
    ----------
    scene : Scene
    r_p : float
    r_t : int
        Frames of a step.
    window : int
        Of the cosine.
    """

    def __init__(self, scene: Scene, r_p: float, r_t: int, *, window: int = 10) -> None:
        self.guards = all_guards()
        self.seconds: dict[str, list[float]] = {name: [] for name in (*self.guards, "history", "state")}
        """Of each value, of the history of accelerations and of the state that guards look at."""
        self._mpm = MpmSolver(scene, r_p=r_p)
        self._r_t, self._dt = r_t, r_t * scene.frame_dt
        self._path: deque[_Floats] = deque([self._mpm.positions], maxlen=3)
        self._steps = 0
        self._history = _native.AccelerationHistory(
            self._mpm.particle_count,
            scene.dim,
            window=window,
            dt=self._dt,
            floor=NOISE_FLOOR,
            quorum=MIN_ACTIVE_SHARE,
        )
        self._history.push(self._path[0])
        start = self._mpm.copy().prescribe(self._path[0], self._mpm.velocities, 0)
        for guard in self.guards.values():
            guard.begin(start)

    def see(self, x: _Floats) -> dict[str, float | None]:
        """Take the positions (N, D) [m] at the end of the next step, and return the value of each guard."""
        self._steps += 1
        with Clock(self.seconds["history"]):
            signal = self._history.push(x)
        views = View(x=x, mpm=self._mpm, r_t=self._r_t, steps=self._steps, signal=signal)
        values = self._asked(views, (Stage.RAW, Stage.MOTION))
        self._path.append(x)
        known = len(self._path) == 3
        v = velocity(tuple(self._path), -1, self._dt) if known else self._mpm.velocities
        with Clock(self.seconds["state"]):
            report = self._mpm.prescribe(x, v, self._steps * self._r_t)
        view = View(x=x, mpm=self._mpm, r_t=self._r_t, steps=self._steps, report=report)
        return values | self._asked(view, (Stage.STATE,))

    def _asked(self, view: View, stages: Sequence[Stage]) -> dict[str, float | None]:
        values: dict[str, float | None] = {}
        for name, guard in self.guards.items():
            if guard.stage in stages:
                with Clock(self.seconds[name]):
                    values[name] = guard.value(view)
        return values


class Clock:
    """Adds the time that a block takes to a list [s]."""

    def __init__(self, times: list[float]) -> None:
        self._times = times

    def __enter__(self) -> None:
        self._began = time.perf_counter()

    def __exit__(self, *_: object) -> None:
        self._times.append(time.perf_counter() - self._began)
