"""Stresses of solids: obstacles of unseen shapes, thin ones, and moving ones."""

from functools import partial

import numpy as np
import numpy.typing as npt

from hybridmpm.scene import BallObstacle, BoxObstacle, HalfSpaceObstacle, Motion
from hybridmpm_lab.stability.stresses.trial import (
    CEILING,
    EVERYWHERE,
    FLOOR,
    FRAMES,
    Stress,
    Trial,
    block,
    scene,
    vector,
)


def _unseen(of: str, dim: int) -> tuple[Trial, ...]:
    obstacles = {
        "a ball": BallObstacle(center=(0.5, FLOOR + 0.08, 0.5)[:dim], radius=0.08),
        "a slope": HalfSpaceObstacle(point=(0.5, FLOOR + 0.02, 0.5)[:dim], normal=vector(dim, -0.5, 1.0)),
        "two posts": None,
    }
    posts = tuple(
        BoxObstacle(lower=(x, FLOOR, FLOOR)[:dim], upper=(x + 0.03, FLOOR + 0.2, CEILING)[:dim])
        for x in (0.42, 0.55)
    )
    return tuple(
        Trial(
            level=level,
            scene=scene(dim, block(of, dim, height=0.3), obstacles=(one,) if one else posts),
            frames=FRAMES,
        )
        for level, one in obstacles.items()
    )


def _thin(of: str, dim: int) -> tuple[Trial, ...]:
    trials = []
    for cells in (4, 2, 1):
        falling = block(of, dim, height=0.35, velocity=vector(dim, 0.0, -3.0))
        dx, top = scene(dim, falling).dx, FLOOR + 0.3
        bottom = top - cells * dx
        shelf = BoxObstacle(lower=(FLOOR, bottom, FLOOR)[:dim], upper=(CEILING, top, CEILING)[:dim])
        trials.append(
            Trial(
                level=f"{cells} cell{'s' * (cells > 1)}",
                scene=scene(dim, falling, obstacles=(shelf,)),
                frames=FRAMES // 2,
                passed=partial(_below, bottom),
            )
        )
    return tuple(trials)


def _below(height: float, x: npt.NDArray[np.float32]) -> npt.NDArray[np.bool_]:
    return np.asarray(x[:, 1] < height)


def _moving(of: str, dim: int) -> tuple[Trial, ...]:
    center = (0.5, FLOOR + 0.1, 0.5)[:dim]

    def turn(rate: float) -> float | tuple[float, float, float]:
        return rate if dim == 2 else (0.0, 0.0, rate)

    return tuple(
        Trial(
            level=f"{rate:g} rad/s",
            scene=scene(
                dim,
                block(of, dim, height=0.15),
                obstacles=(
                    BoxObstacle(
                        lower=(0.41, center[1] - 0.015, FLOOR)[:dim],
                        upper=(0.59, center[1] + 0.015, CEILING)[:dim],
                        motion=Motion(angular_velocity=turn(rate), center=center),
                    ),
                ),
            ),
            frames=FRAMES,
        )
        for rate in (2.0, 10.0, 40.0)
    )


SOLIDS = (
    Stress(name="unseen obstacle", text="a block falls on shapes that no network saw", trials=_unseen),
    Stress(name="thin obstacle", text="a block is thrown at a shelf", trials=_thin),
    Stress(name="moving obstacle", text="a paddle turns in the matter", trials=_moving, settings=EVERYWHERE),
)
"""Stresses by obstacles."""
