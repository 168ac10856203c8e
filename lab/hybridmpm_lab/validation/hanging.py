"""A soft elastic bar hangs from a sticky surface and stretches under its weight."""

import numpy as np

from hybridmpm.mpm import MpmSolver
from hybridmpm.scene import Box, BoxObstacle, Elastic, Scene, Wall, WallFaces, Walls
from hybridmpm_lab.validation.case import Check, Curve, Floats, Panel, Result, recorded

PLACES = (0.0, 0.3, 0.6)
"""Places of the surface beyond 0.9 m [cells]."""
_TOLERANCE = 0.1  # accepted relative error of the mean sag [-]
_HELD = 0.04  # accepted largest sag over the length, twice that of the bar itself [-]
_LENGTH, _WIDTH, _TOP = 0.3, 0.1, 0.9  # of the bar, and height of the surface [m]
_MODULUS, _POISSON, _G = 1e5, 0.3, 9.81
_PERIODS = 6


def run(resolutions: tuple[int, ...] = (64, 96, 128, 160, 256)) -> Result:
    """Hang the bar at several places of walls and obstacles at each resolution [cells/m]."""
    stuff = Elastic(youngs_modulus=_MODULUS, poisson_ratio=_POISSON)
    plane = _MODULUS / (1 - _POISSON**2)
    exact = stuff.density * _G * _LENGTH**2 / (3 * plane)
    period = 4 * _LENGTH / np.sqrt(plane / stuff.density)
    checks, curves = [], []
    for k, resolution in enumerate(resolutions):
        for surface in ("wall", "obstacle"):
            for place in PLACES:
                time, sag = _sag(stuff, surface, resolution, place, _PERIODS * period)
                beyond = f"{(_TOP * resolution + place) % 1:.1f} cells beyond a node, {resolution}^2"
                name = f"{surface}, {beyond}"
                error = float(sag.mean() / exact - 1)
                checks.append(Check.at_most(f"{name}: mean sag, relative error", error, _TOLERANCE))
                name = f"{name}: largest sag over the bar's length"
                checks.append(Check.at_most(name, float(sag.max() / _LENGTH), _HELD))
        curves.append(Curve(time, sag / exact, beyond, k))
    curves.append(Curve((0, _PERIODS * period), (1, 1), "rho g L² / 3 E'", style="--"))
    label = "mean sag over that at rest"
    return Result(checks, [Panel("Hanging bar", "time [s]", label, curves, legend_columns=2)])


def _sag(
    stuff: Elastic, surface: str, resolution: int, place: float, seconds: float
) -> tuple[Floats, Floats]:
    """Return times [s] and the way of the centre from the start [m], both (M,)."""
    top = _TOP + place / resolution
    low, high = 0.5 - _WIDTH / 2, 0.5 + _WIDTH / 2
    bar = Box(material=stuff, lower=(low, top - _LENGTH), upper=(high, top))
    walls = Walls(lower=(0.1, 0.1), upper=(0.9, 0.98))
    obstacles: tuple[BoxObstacle, ...] = ()
    if surface == "wall":
        faces = WallFaces(y_upper=Wall(contact="sticky"))
        walls = Walls(lower=(0.1, 0.1), upper=(0.9, top), faces=faces)
    else:
        obstacles = (BoxObstacle(lower=(0.3, top), upper=(0.7, top + 0.05), contact="sticky"),)
    solver = MpmSolver(Scene(dim=2, resolution=resolution, walls=walls, bodies=(bar,), obstacles=obstacles))
    frames = round(seconds / solver.scene.frame_dt)
    time, (y,) = recorded(solver, frames, lambda s: (float(s.positions[:, 1].mean(dtype=np.float64)),))
    return time, y[0] - y
