"""Scenes with a post, a ball, a plate or a hanging wall between a body and the tip of an arrow."""

import numpy as np

from hybridmpm import BallObstacle, Box, BoxObstacle, MpmSolver, Scene
from hybridmpm.control import Arrow

KINDS = ("post", "ball", "plate", "hanging wall")


def obstructed(seed: int, kind: str, dim: int) -> tuple[MpmSolver, Arrow]:
    """Return a settled body and an arrow from its centre to a tip behind an obstacle with a way round."""
    uniform = np.random.default_rng(seed).uniform
    size, left, floor = uniform(0.12, 0.22 if dim == 2 else 0.18, 2), uniform(0.12, 0.2), 0.1
    material = ("water", "sand", "elastic", "water")[seed % 4 if dim == 3 else seed // 4 % 4]
    edge = left + size[0] + uniform(0.06, 0.16)
    thick, tip = uniform(0.033 if dim == 2 else 0.064, 0.1), uniform([edge + 0.22, 0.25], [0.8, 0.7])
    middle = [left + size[0] / 2, floor + size[1] / 2]

    def block(lower: tuple[float, float], upper: tuple[float, float]) -> BoxObstacle:
        return BoxObstacle(lower=(*lower, 0.1)[:dim], upper=(*upper, 0.9)[:dim])

    solid: BoxObstacle | BallObstacle
    if kind == "post":
        solid = block((edge, 0.1), (edge + thick, uniform(0.35, 0.65)))
    elif kind == "ball":
        radius = uniform(0.05, 0.12)
        solid = BallObstacle(center=(edge + radius, middle[1], 0.5)[:dim], radius=radius)
    elif kind == "plate":
        height = floor + size[1] + uniform(0.05, 0.12)
        solid = block((0.1, height), (uniform(0.5, 0.65), height + thick))
        tip = uniform([0.25, height + 0.22], [0.5, 0.8])
    else:
        floor = uniform(0.35, 0.55)
        solid = block((edge, floor - 0.02), (edge + thick, 0.9))
        tip[1], middle[1] = uniform(0.5, 0.75), floor + size[1] / 2
    body = Box(
        material=material, lower=(left, floor, 0.4)[:dim], upper=(left + size[0], floor + size[1], 0.56)[:dim]
    )
    solver = MpmSolver(Scene(dim=dim, resolution=64 if dim == 2 else 32, bodies=[body], obstacles=[solid]))
    solver.advance(0 if kind == "hanging wall" else 60)
    centre = np.average(solver.positions, axis=0, weights=solver.mass)[:2]
    return solver, Arrow(np.stack([centre, tip]))
