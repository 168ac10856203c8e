"""Cost of obstacles and of bodies that touch: scenes with them, beside the same without."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

from hybridmpm import MpmSolver
from hybridmpm.scene import (
    Ball,
    BallObstacle,
    Box,
    BoxObstacle,
    Elastic,
    Motion,
    Scene,
    SegmentObstacle,
)
from hybridmpm_lab.harness.command import Measurement, measured, setting
from hybridmpm_lab.harness.rows import Progress, Row
from hybridmpm_lab.harness.timing import TimedCall, seconds_by_turns

_RUN_UP = 60  # frames before the measurement: water has hit the floor by then, and bodies lie
_FRAMES = 24  # timed one by one, then the solver goes back
_CORK = Elastic(density=500.0)


def _tank(obstacles: Sequence[BallObstacle | BoxObstacle | SegmentObstacle] = (), *, dim: int = 2) -> Scene:
    upper = (0.9, 0.5) if dim == 2 else (0.9, 0.35, 0.5)
    water = Box(material="water", lower=(0.1,) * dim, upper=upper)
    return Scene(dim=dim, resolution=128 if dim == 2 else 64, bodies=(water,), obstacles=tuple(obstacles))


def _paddle(dim: int) -> BoxObstacle:
    lower, upper, center = (0.48, 0.15, 0.2)[:dim], (0.52, 0.6, 0.4)[:dim], (0.5, 0.6, 0.3)[:dim]
    spin = 3.0 if dim == 2 else (0.0, 0.0, 3.0)
    return BoxObstacle(
        lower=lower, upper=upper, motion=Motion(angular_velocity=spin, center=center, period=1.0)
    )


def _balls(gap: float, *, dim: int = 2) -> Scene:
    radius = 0.12
    places = ((0.5 + side * (radius + gap / 2), 0.1 + radius, 0.5)[:dim] for side in (-1, 1))
    bodies = tuple(Ball(material=Elastic(), center=place, radius=radius) for place in places)
    return Scene(dim=dim, resolution=128 if dim == 2 else 64, bodies=bodies)


def _pool(*bodies: Ball, water: bool = True) -> Scene:
    pool = (Box(material="water", lower=(0.1, 0.1), upper=(0.9, 0.45)),) if water else ()
    return Scene(dim=2, resolution=128, bodies=(*bodies, *pool))


SCENES: dict[str, tuple[Scene, tuple[Scene, ...], int]] = {
    "ball in a tank": (_tank((BallObstacle(center=(0.5, 0.25), radius=0.06),)), (_tank(),), 24),
    "ramp in a tank": (
        _tank((SegmentObstacle(start=(0.3, 0.15), end=(0.7, 0.35), thickness=0.03),)),
        (_tank(),),
        24,
    ),
    "paddle in a tank": (_tank((_paddle(2),)), (_tank(),), 24),
    "ball in a tank, 3D": (
        _tank((BallObstacle(center=(0.5, 0.2, 0.3), radius=0.06),), dim=3),
        (_tank(dim=3),),
        16,
    ),
    "paddle in a tank, 3D": (_tank((_paddle(3),), dim=3), (_tank(dim=3),), 16),
    "two discs that touch": (_balls(0.0), (_balls(0.1),), 40),
    "two balls that touch": (_balls(0.0, dim=3), (_balls(0.15, dim=3),), 24),
    "ball that floats": (
        _pool(Ball(material=_CORK, center=(0.5, 0.5), radius=0.08)),
        (_pool(), _pool(Ball(material=_CORK, center=(0.5, 0.18), radius=0.08), water=False)),
        40,
    ),
}
"""By its name each scene, those without contact that cost as much together, and the substeps of a frame."""


@dataclass(frozen=True, kw_only=True)
class ContactSettings:
    """Scenes with obstacles and with bodies that touch, and the settings of the measurement."""

    scene: tuple[str, ...] = setting(tuple(SCENES), "Name of a scene.", tuple(SCENES))
    repeats: int = setting(100, "Number of timed frames of each.", low=1, high=100_000)

    @property
    def steps(self) -> int:
        """Number of rows."""
        return len(self.scene)


class _Frames:
    """Frames of one scene on one thread, again and again from the same state."""

    def __init__(self, scene: Scene, substeps: int) -> None:
        self._solver = MpmSolver(scene, substeps=substeps, threads=1)
        self._solver.advance(_RUN_UP)
        self._start = self._solver.snapshot()
        self._count = 0
        self.particles: int = self._solver.particle_count

    def prepare(self) -> None:
        """Go back at times; one frame is not timed then."""
        if self._count % _FRAMES == 0:
            self._solver.restore(self._start)
            self._solver.advance(1)
        self._count += 1

    def advance(self) -> None:
        """Advance by a frame."""
        self._solver.advance(1)


def measure(settings: ContactSettings, on_progress: Progress) -> Iterator[Row]:
    """Time frames with and without contact by turns, on one thread; yield a row for each scene."""
    for name in settings.scene:
        scene, without, substeps = SCENES[name]
        frames = [_Frames(one, substeps) for one in (scene, *without)]
        calls = [TimedCall(prepare=one.prepare, call=partial(one.advance)) for one in frames]
        times = seconds_by_turns(calls, settings.repeats)
        mine, *others = (1e3 * float(np.percentile(each, 25)) for each in times)
        yield {
            "scene": name,
            "particles": frames[0].particles,
            "substeps": substeps,
            "ms_per_frame": round(mine, 3),
            "without": round(sum(others), 3),
            "ratio": round(mine / sum(others), 3),
        }
        on_progress(1)


contact = Measurement(
    name="contact",
    settings=ContactSettings,
    measure=measured(measure),
    columns=("scene", "particles", "substeps", "ms_per_frame", "without", "ratio"),
    summary="Time frames with obstacles and bodies that touch, beside those without, by turns.",
).command()
