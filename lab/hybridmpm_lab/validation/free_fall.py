"""Balls of all materials are thrown sideways and fall.

With n equal substeps dt, each particle has to follow x = x_0 + v_0 t + g (t² + t dt) / 2 up to rounding.
"""

import numpy as np

from hybridmpm.mpm import MpmSolver
from hybridmpm.scene import Ball, Elastic, Material, Sand, Scene, Walls, Water
from hybridmpm_lab.validation.case import Check, Curve, Panel, Result, times

_G = 9.81
_SPEED = 0.5
_ULP = 2.0**-24
"""Largest rounding error of a number in [0.5, 1]. A substep adds two, of the position and of the velocity."""


def run(frames: int = 100) -> Result:
    """Let balls of all materials fall for `frames` frames."""
    checks: list[Check] = []
    curves: list[Curve] = []
    bound = 0.0
    for dim in (2, 3):
        for material in (Water(), Sand(), Elastic()):
            scene = _scene(dim, material)
            solver = MpmSolver(scene, substeps="reference")
            x = solver.rollout(frames).astype(np.float64)
            substeps = solver.last_frame.substeps if solver.last_frame else 0
            t = times(scene, frames + 1)
            moved = np.zeros((frames + 1, 1, dim))
            moved[:, 0, 0] = _SPEED * t
            moved[:, 0, 1] = -_G * (t**2 + t * scene.frame_dt / substeps) / 2
            error = np.abs(x - x[0] - moved).max(axis=(1, 2))
            bound = 2 * frames * substeps * _ULP
            name = f"{material.kind}, {dim}D"
            checks.append(Check.at_most(f"{name} [m]", float(error.max()), bound))
            dots = {"linestyle": "-", "markevery": 12, "markersize": 4}
            curves.append(Curve(t, error * 1e6, name, len(curves), "o", dots))
    curves.append(Curve(t[[0, -1]], [bound * 1e6] * 2, "bound", style="--"))
    panel = Panel("Distance from the closed form", "time [s]", "[µm]", curves, {"yscale": "log"})
    return Result(checks, (panel,))


def _scene(dim: int, material: Material) -> Scene:
    center, velocity = (0.4, 0.75, 0.4)[:dim], (_SPEED, 0.0, 0.0)[:dim]
    ball = Ball(material=material, center=center, radius=0.05, velocity=velocity)
    walls = Walls(lower=(0.1,) * dim, upper=(0.9,) * dim)
    return Scene(dim=dim, resolution=32, bodies=(ball,), walls=walls)
