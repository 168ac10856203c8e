"""Walls act alike wherever they lie between the nodes of the grid."""

import numpy as np
import pytest

from hybridmpm import Box, MpmSolver, Scene
from hybridmpm.scene import Walls

DX = 1 / 64


def distance_at_contact(material: str, phase: float, *, upper: bool) -> float:
    """Return how far from a wall [cells] the nearest particle is when a body first feels it.

    The wall lies `phase` cells above a node.
    """
    wall = ((57 if upper else 7) + phase) * DX
    away = -1 if upper else 1
    faces = sorted((wall + away * 3 * DX, wall + away * 13 * DX))
    body = Box(
        material=material,
        lower=(0.4, faces[0]),
        upper=(0.6, faces[1]),
        velocity=(0.0, -0.8 * away),
    )
    walls = Walls(lower=(0.1, 0.1 if upper else wall), upper=(0.9, wall if upper else 0.9))
    scene = Scene(dim=2, resolution=64, bodies=(body,), walls=walls, gravity=(0.0, 0.0))
    solver = MpmSolver(scene)
    while True:
        x = solver.positions[:, 1]
        solver.advance(1)
        if (np.abs(solver.velocities[:, 1]) < 0.78).any():
            return float(np.abs(x - wall).min() / DX)


@pytest.mark.parametrize("material", ["water", "sand"])
@pytest.mark.parametrize("side", ["lower", "upper"])
def test_material_touches_a_wall_at_one_distance(material: str, side: str) -> None:
    distances = [
        distance_at_contact(material, phase, upper=side == "upper") for phase in np.arange(0, 1, 0.1)
    ]
    # A frame moves the body by an eighth of a cell; the jitter and the lattice do the rest.
    assert max(distances) - min(distances) < 0.3, distances
    assert 0.2 < np.mean(distances) < 0.9
