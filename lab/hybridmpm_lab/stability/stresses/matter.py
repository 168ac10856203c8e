"""Stresses of matter: how much, how dense, how stiff, and how it lies at the start."""

import math

from hybridmpm.scene import Box, Scene, Walls
from hybridmpm_lab.stability.stresses.trial import (
    FLOOR,
    FRAMES,
    Stress,
    Trial,
    block,
    material,
    scene,
)

_MODULUS = {"water": "bulk_modulus", "sand": "youngs_modulus"}


def _counts(of: str, dim: int) -> tuple[Trial, ...]:
    return tuple(
        Trial(
            level=f"{times} x 4000 particles",
            scene=scene(dim, block(of, dim, side=0.247 * times ** (1 / dim))),
            frames=FRAMES,
        )
        for times in (1, 2, 4)
    )


def _overlaps(of: str, dim: int) -> tuple[Trial, ...]:
    side = 0.15

    def pair(share: float) -> Scene:
        lower = (0.35, FLOOR, 0.425)[:dim]
        moved = (lower[0] + (1 - share) * side, *lower[1:])
        boxes = [
            Box(lower=start, upper=tuple(c + side for c in start), material=of) for start in (lower, moved)
        ]
        return scene(dim, *boxes)

    return tuple(
        Trial(level=f"{share:.0%} of a body", scene=pair(share), frames=FRAMES) for share in (0.1, 0.5, 1.0)
    )


def _coincident(of: str, dim: int) -> tuple[Trial, ...]:
    return tuple(
        Trial(
            level=f"{count} particles in each place",
            scene=scene(dim, *[block(of, dim, side=0.06)] * count),
            frames=FRAMES,
        )
        for count in (2, 4, 16)
    )


def _densities(of: str, dim: int) -> tuple[Trial, ...]:
    def stacked(ratio: float) -> Scene:
        light = Box(
            lower=(0.4, FLOOR, 0.4)[:dim],
            upper=(0.6, FLOOR + 0.1, 0.6)[:dim],
            material=material(of, density=1000.0 / ratio),
        )
        heavy = Box(lower=(0.4, FLOOR + 0.1, 0.4)[:dim], upper=(0.6, FLOOR + 0.2, 0.6)[:dim], material=of)
        return scene(dim, light, heavy)

    return tuple(
        Trial(level=f"{ratio} : 1", scene=stacked(ratio), frames=FRAMES // 2) for ratio in (3, 30, 1000)
    )


def _stiffnesses(of: str, dim: int) -> tuple[Trial, ...]:
    safe = scene(dim, block(of, dim))

    def made(modulus: float) -> Scene:
        return scene(dim, block(of, dim, material=material(of, **{_MODULUS[of]: modulus})))

    return tuple(
        Trial(level=f"{modulus:.0e} Pa", scene=made(modulus), frames=FRAMES, safe=safe)
        for modulus in (1e2, 1e5, 1e8)
    )


def _steps(of: str, dim: int) -> tuple[Trial, ...]:
    falling, native = scene(dim, block(of, dim)), material(of).to_native(1.0)
    whole = falling.frame_dt * native.signal_speed(dim) / falling.dx
    levels = {
        "the default": math.ceil(whole / native.default_cfl),
        "the limit": math.ceil(whole / native.cfl_limit),
        "above the limit": math.ceil(whole / native.cfl_limit) - 1,
    }
    return tuple(
        Trial(level=level, scene=falling, frames=FRAMES, mpm={"substeps": substeps})
        for level, substeps in levels.items()
    )


def _full_boxes(of: str, dim: int) -> tuple[Trial, ...]:
    # Walls on grid nodes, or the lattice of the particles would put a layer more or less between them.
    lower, upper = (0.3984375,) * dim, (0.6015625, 0.6015625, 0.5)[:dim]
    full = Scene(
        dim=dim,
        walls=Walls(lower=lower, upper=upper),
        bodies=(Box(lower=lower, upper=upper, material=of),),
    )

    def shaken(size: float) -> Trial:
        def force(simulator: object) -> list[float] | None:
            period, now = 80, simulator.frame  # type: ignore[attr-defined]
            return [size if now % period < period // 2 else -size, *[0.0] * (dim - 1)]

        return Trial(level=f"shaken at {size:g} m/s^2", scene=full, frames=FRAMES, force=force)

    return (Trial(level="at rest", scene=full, frames=FRAMES), shaken(10.0), shaken(100.0))


MATTER = (
    Stress(
        name="substep",
        text="a block falls at fixed substeps",
        trials=_steps,
        methods=("mpm",),
    ),
    Stress(name="particles", text="a larger block falls", trials=_counts),
    Stress(name="overlap", text="two bodies overlap at the start", trials=_overlaps),
    Stress(name="coincident", text="bodies lie in the same place", trials=_coincident),
    Stress(name="density ratio", text="a block lies on a lighter one", trials=_densities),
    Stress(name="stiffness", text="a block of another modulus falls", trials=_stiffnesses),
    Stress(name="full box", text="matter fills a closed box", trials=_full_boxes),
)
"""Stresses by what the matter is."""
