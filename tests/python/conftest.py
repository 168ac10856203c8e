"""Small scenes that many tests share."""

import pytest

from hybridmpm import Ball, Box, MpmSolver, Scene


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
