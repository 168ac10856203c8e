"""An elastic disc rolls down a plane, and on a level floor.

A rigid disc that does not slip moves by x = g sin(theta) t² / 3. One that is thrown along a floor slips
until it has two thirds of its speed, which it then keeps.
"""

import numpy as np

from hybridmpm.mpm import MpmSolver
from hybridmpm.scene import Ball, Elastic, HalfSpaceObstacle, Scene, Walls
from hybridmpm_lab.validation.case import Check, Curve, Floats, Panel, Result

ANGLES = (10.0, 20.0, 30.0)
"""Angles of the plane [degrees]."""
_LEAST, _LEAST_KEPT = 0.9, 0.95  # accepted path over that of a rigid disc, and speed kept on the level [-]
_RADIUS, _FRICTION, _G = 0.06, 1.0, 9.81
_PATH = 0.5  # of a rigid disc down the plane [m]
_SPEED, _FLOOR = 1.2, 0.0625  # of the throw [m/s], height of the floor [m]
_STUFF = Elastic(youngs_modulus=2e6, poisson_ratio=0.3)


def run(resolutions: tuple[int, ...] = (128,), *, seeds: int = 4) -> Result:
    """Let discs roll at each resolution [cells/m], as many as `seeds`."""
    checks, curves = [], [Curve(ANGLES, [1.0] * len(ANGLES), "rigid disc", style="--")]
    for k, resolution in enumerate(resolutions):
        means = []
        for angle in ANGLES:
            means.append(float(np.mean([_path(angle, resolution, seed) for seed in range(seeds)])))
            name = f"{angle:g} degrees, {resolution}^2: path over that of a rigid disc"
            checks.append(Check.between(name, means[-1], (_LEAST, 1.02)))
        curves.append(Curve(ANGLES, means, f"{resolution}^2", k, "o"))
        kept = np.mean([_kept(resolution, seed) for seed in range(seeds)], axis=0)
        name = f"level, {resolution}^2: speed"
        checks += [
            Check.reported(f"{name} after slipping over that of the throw", float(kept[0]), "0.667"),
            Check.between(f"{name} kept over half a metre", float(kept[1]), (_LEAST_KEPT, 1.02)),
        ]
    label = "path over that of a rigid disc"
    return Result(checks, [Panel("Rolling disc", "angle [degrees]", label, curves, {"ylim": (0, 1.05)})])


def _path(angle: float, resolution: int, seed: int) -> float:
    theta = np.radians(angle)
    normal, down = np.array([np.sin(theta), np.cos(theta)]), np.array([np.cos(theta), -np.sin(theta)])
    start = np.array([0.2, 0.75])
    disc = Ball(material=_STUFF, center=tuple(start.tolist()), radius=_RADIUS, seed=seed)
    plane = HalfSpaceObstacle(
        point=tuple((start - _RADIUS * normal).tolist()), normal=tuple(normal.tolist()), friction=_FRICTION
    )
    walls = Walls(lower=(0.0, 0.0), upper=(1.0, 1.0))
    solver = MpmSolver(Scene(dim=2, resolution=resolution, walls=walls, bodies=(disc,), obstacles=(plane,)))
    acceleration = 2 / 3 * _G * np.sin(theta)
    solver.advance(int(np.sqrt(2 * _PATH / acceleration) / solver.scene.frame_dt))
    path = (solver.positions.mean(axis=0, dtype=np.float64) - start) @ down
    return float(path / (0.5 * acceleration * solver.time**2))


def _kept(resolution: int, seed: int) -> Floats:
    """Return the speed after slipping over that of the throw, and that half a metre later over it.

    The floor lies a tenth of a cell higher for each seed.
    """
    floor = _FLOOR + 0.1 * seed / resolution
    disc = Ball(
        material=_STUFF, center=(0.12, floor + _RADIUS), radius=_RADIUS, velocity=(_SPEED, 0.0), seed=seed
    )
    walls = Walls(lower=(0.0, floor), upper=(1.0, 1.0), friction=_FRICTION)
    solver = MpmSolver(Scene(dim=2, resolution=resolution, walls=walls, bodies=(disc,)))
    speeds = []

    def roll(to: float) -> float:
        while solver.positions[:, 0].mean() < to:
            solver.advance(1)
            speeds.append(float(solver.velocities[:, 0].mean()))
            if speeds[-1] <= 0.1 * _SPEED:
                break
        return speeds[-1]

    first = roll(0.22)
    return np.array([first / _SPEED, roll(0.72) / first])
