"""Elastic bodies float: the submerged share is the ratio of the densities (Archimedes)."""

import numpy as np

from hybridmpm.mpm import MpmSolver
from hybridmpm.scene import Ball, Box, Elastic, Scene, Walls, Water
from hybridmpm_lab.validation.case import Check, Curve, Floats, Panel, Result, recorded

DENSITIES = (300.0, 500.0, 800.0)
"""Densities of the bodies [kg/m^3]; water has 1000."""
_TOLERANCE = 0.05  # accepted relative error of the share [-]
_FLOOR, _SIDE, _DEPTH = 0.1, 0.9, 0.3  # lower and upper wall, depth of the water [m]
_WIDTH, _HEIGHT = 0.2, 0.1  # of the box [m]; the disc has the height of the box
_BESIDE = 0.06  # distance from the body at which the level is taken [m]
_SETTLE, _MEAN = 3.0, 2.0  # time until the waves are gone, and time of the mean [s]
_EVERY = 20  # frames from one measurement to the next


def run(resolutions: tuple[int, ...] = (64, 128), densities: tuple[float, ...] = DENSITIES) -> Result:
    """Let a box and a disc of each density float at each resolution [cells/m]."""
    checks, curves = [], [Curve((0, 1), (0, 1), "Archimedes", style="--")]
    for k, resolution in enumerate(resolutions):
        for shape in ("box", "disc"):
            shares = [float(_shares(shape, density, resolution).mean()) for density in densities]
            for density, share in zip(densities, shares, strict=True):
                name = f"{shape} of {density:g} kg/m^3, {resolution}^2: share over that of Archimedes - 1"
                checks.append(Check.at_most(name, share * 1000 / density - 1, _TOLERANCE))
            colour = 2 * k + (shape == "disc")
            curves.append(
                Curve([d / 1000 for d in densities], shares, f"{shape}, {resolution}^2", colour, "o")
            )
    return Result(checks, [Panel("Floating", "density over that of water", "submerged share", curves)])


def _shares(shape: str, density: float, resolution: int) -> Floats:
    """Return submerged shares (M,) of the area of a body, which starts where it should float."""
    surface, radius = _FLOOR + _DEPTH, _HEIGHT / 2
    low = surface - density / 1000 * _HEIGHT
    material = Elastic(density=density, youngs_modulus=1e5)
    body: Box | Ball = Ball(material=material, center=(0.5, low + radius), radius=radius)
    if shape == "box":
        body = Box(material=material, lower=(0.5 - _WIDTH / 2, low), upper=(0.5 + _WIDTH / 2, low + _HEIGHT))
    water = Box(material=Water(), lower=(_FLOOR, _FLOOR), upper=(_SIDE, surface))
    walls = Walls(lower=(_FLOOR, _FLOOR), upper=(_SIDE, _SIDE))
    solver = MpmSolver(Scene(dim=2, resolution=resolution, walls=walls, bodies=(body, water)))
    floats = solver.materials == body.material.type_id

    def depth(solver: MpmSolver) -> tuple[float]:
        x = solver.positions.astype(np.float64)
        beside = ~floats & (np.abs(x[:, 0] - 0.5) > _WIDTH / 2 + _BESIDE)
        level = _FLOOR + 2 * (x[beside, 1].mean() - _FLOOR)
        return (float(level - x[floats, 1].mean()) / radius,)

    solver.advance(int(_SETTLE / solver.scene.frame_dt))
    (depths,) = recorded(solver, int(_MEAN / solver.scene.frame_dt) // _EVERY, depth, every=_EVERY)[1]
    if shape == "box":
        return np.asarray((1 + depths) / 2)
    depths = np.clip(depths, -1, 1)
    return np.asarray(1 - (np.arccos(depths) - depths * np.sqrt(1 - depths**2)) / np.pi)
