"""Small scenes that many tests share, and solvers of states that no scene describes."""

from typing import Any

import numpy as np
import pytest

from hybridmpm import Ball, Box, MpmSolver, Scene, _native


def native_solver(
    x: Any, v: Any, material: _native.Material, *, resolution: int, **settings: Any
) -> _native.Solver:
    """Return a solver from positions (N, D), velocities and one material.

    Two particles per cell and axis at its density; walls at 0.1 and 0.9, no gravity, frames of 2.5 ms unless
    said otherwise. Further keywords go to `_native.Solver`.
    """
    x = np.ascontiguousarray(x, dtype=np.float32)
    count, dim = x.shape
    volume = np.full(count, (0.5 / resolution) ** dim, np.float32)
    defaults: dict[str, Any] = {
        "frame_dt": 0.0025,
        "gravity": [0.0] * dim,
        "wall_lower": [0.1] * dim,
        "wall_upper": [0.9] * dim,
    }
    return _native.Solver(
        resolution=resolution,
        materials=[material],
        x=x,
        v=np.ascontiguousarray(np.broadcast_to(v, x.shape), dtype=np.float32),
        material=np.zeros(count, np.uint8),
        mass=volume * np.float32(material.density),
        volume=volume,
        **(defaults | settings),
    )


@pytest.fixture
def drop() -> Scene:
    """Return a ball of water in free fall, far from all walls: about 200 particles."""
    ball = Ball(material="water", center=(0.5, 0.6), radius=0.06, velocity=(0.5, 0.0), seed=3)
    return Scene(name="drop", dim=2, resolution=64, bodies=(ball,))


@pytest.fixture
def splash() -> Scene:
    """Return water and sand that hit the floor at once: about 400 particles."""
    water = Box(material="water", lower=(0.15, 0.1), upper=(0.35, 0.2), velocity=(2.0, -1.0))
    sand = Box(material="sand", lower=(0.5, 0.1), upper=(0.65, 0.25), velocity=(-1.0, -1.0), seed=1)
    return Scene(name="splash", dim=2, resolution=64, bodies=(water, sand))


@pytest.fixture
def cube() -> Scene:
    """Return a small cube of water in 3D: 512 particles."""
    box = Box(material="water", lower=(0.4, 0.2, 0.4), upper=(0.525, 0.325, 0.525), velocity=(0.0, -1.0, 0.5))
    return Scene(name="cube", dim=3, resolution=32, bodies=(box,))


@pytest.fixture
def solver(splash: Scene) -> MpmSolver:
    """Return a solver of `splash` at frame 0."""
    return MpmSolver(splash)
