"""Stresses of motion: fast impacts, gravity, streams that meet, everything into a corner."""

from hybridmpm.scene import Box
from hybridmpm_lab.stability.stresses.trial import (
    CEILING,
    EVERYWHERE,
    FLOOR,
    FRAMES,
    GRAVITY,
    Stress,
    Trial,
    block,
    scene,
    vector,
)


def _impacts(of: str, dim: int) -> tuple[Trial, ...]:
    return tuple(
        Trial(
            level=f"{speed} m/s",
            scene=scene(dim, block(of, dim, velocity=vector(dim, 0.0, -speed))),
            frames=FRAMES,
        )
        for speed in (2, 5, 12)
    )


def _gravities(of: str, dim: int) -> tuple[Trial, ...]:
    return tuple(
        Trial(
            level=f"{times:g} g",
            scene=scene(dim, block(of, dim), gravity=vector(dim, 0.0, -times * GRAVITY)),
            frames=FRAMES,
        )
        for times in (0.5, 3, 10)
    )


def _jets(of: str, dim: int) -> tuple[Trial, ...]:
    low, high = FLOOR + 0.25, FLOOR + 0.31

    def stream(x: float, speed: float) -> Box:
        lower, upper = (x, low, 0.47)[:dim], (x + 0.3, high, 0.53)[:dim]
        return Box(lower=lower, upper=upper, material=of, velocity=vector(dim, speed))

    return tuple(
        Trial(
            level=f"{speed} m/s each",
            scene=scene(dim, stream(0.18, speed), stream(0.52, -speed)),
            frames=FRAMES,
        )
        for speed in (1, 3, 8)
    )


def _corners(of: str, dim: int) -> tuple[Trial, ...]:
    return tuple(
        Trial(
            level=f"{speed} m/s",
            scene=scene(dim, block(of, dim, velocity=(-speed, -speed, -speed)[:dim])),
            frames=FRAMES,
        )
        for speed in (2, 5, 10)
    )


def _one_particle(of: str, dim: int) -> tuple[Trial, ...]:
    spacing = scene(dim, block(of, dim)).spacing
    lower = (0.5, FLOOR, 0.5)[:dim]
    places = {"on the floor": (0.0, 0.0), "falls by 0.5 m": (0.5, 0.0), "thrown at 5 m/s": (0.3, 5.0)}
    trials = []
    for level, (height, speed) in places.items():
        start = tuple(c + height * (axis == 1) for axis, c in enumerate(lower))
        end = tuple(c + spacing for c in start)
        one = Box(lower=start, upper=end, material=of, velocity=vector(dim, speed))
        trials.append(Trial(level=level, scene=scene(dim, one), frames=FRAMES // 2))
    return tuple(trials)


def _long(of: str, dim: int) -> tuple[Trial, ...]:
    return tuple(
        Trial(level=f"{count} frames", scene=scene(dim, block(of, dim)), frames=count)
        for count in (400, 1200, 4000)
    )


def _pools(of: str, dim: int) -> tuple[Trial, ...]:
    def pool(depth: float) -> Box:
        return Box(
            lower=(FLOOR, FLOOR, FLOOR)[:dim], upper=(CEILING, FLOOR + depth, CEILING)[:dim], material=of
        )

    return tuple(
        Trial(level=f"{depth} m deep", scene=scene(dim, pool(depth)), frames=4000)
        for depth in (0.05, 0.1, 0.2)
    )


MOTION = (
    Stress(name="impact", text="a block is thrown at the floor", trials=_impacts, settings=EVERYWHERE),
    Stress(name="gravity", text="a block falls by 0.1 m", trials=_gravities, settings=EVERYWHERE),
    Stress(name="jets", text="two streams meet head on", trials=_jets),
    Stress(name="corner", text="everything is thrown into a corner", trials=_corners, settings=EVERYWHERE),
    Stress(name="one particle", text="a scene of a single particle", trials=_one_particle),
    Stress(
        name="long run",
        text="a block falls, up to ten times the length of a training trajectory",
        trials=_long,
        settings=EVERYWHERE,
    ),
    Stress(name="pool", text="a pool is left alone for 10 s", trials=_pools),
)
"""Stresses by the motion of bodies."""
