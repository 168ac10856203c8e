"""A block of sand falls on a floor and lies: dry sand does not bounce."""

import numpy as np

from hybridmpm.mpm import MpmSolver
from hybridmpm.scene import Box, Sand, Scene
from hybridmpm_lab.validation.case import Check, Curve, Floats, Panel, Result, recorded

ANGLES = (30.0, 35.0, 40.0, 45.0)
"""Friction angles [degrees]."""
DROPS = (0.1, 0.3, 0.5)
"""Heights of fall [m]."""
_MOST = 0.03  # accepted rise of the centre over its fall [-]
_FLOOR, _MIDDLE, _WIDTH, _HEIGHT = 0.1, 0.5, 0.2, 0.15  # of the scene and the block [m]
_AFTER = 0.3  # time after the blow [s]
_G = 9.81


def run(resolutions: tuple[int, ...] = (64, 128, 256), angles: tuple[float, ...] = ANGLES) -> Result:
    """Drop blocks of each angle and from each height at each resolution [cells/m]."""
    checks, curves = [], []
    for k, resolution in enumerate(resolutions):
        for angle in angles:
            paths = [_path(angle, drop, resolution) for drop in DROPS]
            name = f"{angle:g} degrees, {resolution}^2: rise over fall, worst of {len(DROPS)} heights"
            checks.append(Check.at_most(name, max(_rise(y) for _, y in paths), _MOST))
        time, y = paths[-2]
        curves.append(Curve(time, y - _FLOOR, f"{angles[-1]:g} degrees, {resolution}^2", k))
    fall = time[time < np.sqrt(2 * DROPS[-2] / _G)]
    exact = DROPS[-2] + _HEIGHT / 2 - _G / 2 * fall**2
    curves.append(Curve(fall, exact, "free fall", style="--"))
    return Result(checks, [Panel("Dropped sand", "time [s]", "height of the centre [m]", curves)])


def _path(angle: float, drop: float, resolution: int) -> tuple[Floats, Floats]:
    """Return times and heights of the centre (M,), from the start until some time after the blow."""
    corner = _MIDDLE - _WIDTH / 2, _FLOOR + drop
    block = Box(
        material=Sand(friction_angle=angle),
        lower=corner,
        upper=(corner[0] + _WIDTH, corner[1] + _HEIGHT),
    )
    solver = MpmSolver(Scene(dim=2, resolution=resolution, bodies=(block,)))
    frames = int((np.sqrt(2 * drop / _G) + _AFTER) / solver.scene.frame_dt)
    time, (y,) = recorded(solver, frames, lambda s: (float(s.positions[:, 1].mean(dtype=np.float64)),))
    return time, y


def _rise(y: Floats) -> float:
    """Return the largest rise after a low point over the way from the start to the lowest."""
    return float((y - np.minimum.accumulate(y)).max() / (y[0] - y.min()))
