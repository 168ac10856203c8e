"""An elastic beam, clamped at one end by a sticky wall or obstacle, bends under its weight."""

import numpy as np

from hybridmpm.mpm import MpmSolver
from hybridmpm.scene import Box, BoxObstacle, Elastic, Scene, Wall, WallFaces, Walls
from hybridmpm_lab.validation.case import Check, Curve, Floats, Panel, Result, recorded

PLACES = (0.0, 0.3, 0.6)
"""Places of the clamp beyond 0.1 m [cells]."""
_TOLERANCE = 0.05  # accepted relative error of the mean deflection at the end [-]
_LENGTH, _HEIGHT, _CLAMP = 0.6, 0.1, 0.1  # of the beam, and place of the clamp [m]
_MODULUS, _POISSON, _DENSITY, _G = 1e7, 0.3, 1000.0, 9.81
_PERIODS = 3
_FRAME = 0.004  # duration of a frame, of which a period has about fifty [s]


def deflection(x: Floats) -> Floats:
    """Return how far Timoshenko's beam at rest hangs down at distances from the clamp [m]."""
    plane, shear = _MODULUS / (1 - _POISSON**2), _MODULUS / (2 * (1 + _POISSON))
    load, inertia = _DENSITY * _G * _HEIGHT, _HEIGHT**3 / 12
    bending = load / (24 * plane * inertia) * x**2 * (x**2 - 4 * _LENGTH * x + 6 * _LENGTH**2)
    sheared: Floats = bending + load / (5 / 6 * shear * _HEIGHT) * (_LENGTH * x - x**2 / 2)
    return sheared


def run(resolutions: tuple[int, ...] = (64, 128, 256)) -> Result:
    """Clamp the beam at several places of walls and obstacles at each resolution [cells/m]."""
    stuff = Elastic(youngs_modulus=_MODULUS, poisson_ratio=_POISSON, density=_DENSITY)
    stiffness = _MODULUS / (1 - _POISSON**2) * _HEIGHT**2 / (12 * _DENSITY)
    period = 2 * np.pi * _LENGTH**2 / (1.8751**2 * np.sqrt(stiffness))
    checks, curves = [], []
    for k, resolution in enumerate(resolutions):
        for surface in ("wall", "obstacle"):
            for place in PLACES:
                time, share = _bent(stuff, surface, resolution, place, _PERIODS * period)
                beyond = f"{(_CLAMP * resolution + place) % 1:.1f} cells beyond a node, {resolution}^2"
                # A plain mean would depend on where in a swing it ends.
                error = float(np.average(share, weights=np.hanning(len(share))) - 1)
                name = f"{surface}, {beyond}: mean deflection, relative error"
                checks.append(Check.at_most(name, error, _TOLERANCE))
        curves.append(Curve(time, share, beyond, k))
    curves.append(Curve((0, _PERIODS * period), (1, 1), "Timoshenko", style="--"))
    label = "deflection of the end over that at rest"
    return Result(checks, [Panel("Cantilever", "time [s]", label, curves, legend_columns=2)])


def _bent(
    stuff: Elastic, surface: str, resolution: int, place: float, seconds: float
) -> tuple[Floats, Floats]:
    """Return times [s] and the deflection of the end over that at rest [-], both (M,)."""
    clamp = _CLAMP + place / resolution
    low = 0.5 - _HEIGHT / 2
    beam = Box(material=stuff, lower=(clamp, low), upper=(clamp + _LENGTH, low + _HEIGHT))
    walls = Walls(lower=(0.02, 0.1), upper=(0.9, 0.9))
    obstacles: tuple[BoxObstacle, ...] = ()
    if surface == "wall":
        faces = WallFaces(x_lower=Wall(contact="sticky"))
        walls = Walls(lower=(clamp, 0.1), upper=(0.9, 0.9), faces=faces)
    else:
        obstacles = (BoxObstacle(lower=(0.02, 0.3), upper=(clamp, 0.7), contact="sticky"),)
    solver = MpmSolver(
        Scene(dim=2, resolution=resolution, walls=walls, bodies=(beam,), obstacles=obstacles, frame_dt=_FRAME)
    )
    start = solver.positions.astype(np.float64)
    end = start[:, 0] > clamp + _LENGTH - _HEIGHT / 4
    rest = deflection(start[end, 0] - clamp).mean()
    frames = round(seconds / _FRAME)
    time, (y,) = recorded(solver, frames, lambda s: (float(s.positions[end, 1].mean(dtype=np.float64)),))
    return time, (y[0] - y) / rest
