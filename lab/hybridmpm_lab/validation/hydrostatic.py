"""A column of water 0.4 m deep falls into its own compression and comes to rest.

At depth s below the surface the closed form is J(s) = sqrt(1 - 2 rho_0 g s / lambda).
"""

import numpy as np

from hybridmpm.mpm import MpmSolver
from hybridmpm.scene import Box, Scene, Walls, Water
from hybridmpm.scene.materials import REFERENCE_BULK_MODULUS
from hybridmpm_lab.validation.case import Check, Curve, Floats, Panel, Result

_MAX_ERROR = 0.1  # largest error of J, over the compression 1 - J on the floor [-]
_DEPTH = 0.4  # rest depth h of the column [m]
_LOW, _SIDE = 0.125, 0.25  # position of the lower walls, and width of the column [m]
_LAYERS = 8
_SETTLING, _AVERAGED = 1200, 400
"""Frames before the average, in which the column oscillates, and in the average."""
_LOAD = Water().density * 9.81 / REFERENCE_BULK_MODULUS  # rho_0 g / lambda [1/m]
_ON_FLOOR = _LOAD * _DEPTH  # compression 1 - J on the floor in the closed form [-]
_MEAN = _ON_FLOOR / 2
"""Mean compression 1 - J of the particles in the closed form [-]; J is linear in the mass above."""
_SURFACE = _DEPTH * (1 - _MEAN)  # height of the settled surface above the floor in the closed form [m]


def run(resolution: int = 128) -> Result:
    """Let a column of water settle on a grid of `resolution` cells per metre."""
    column = Box(material=Water(), lower=(_LOW, _LOW), upper=(_LOW + _SIDE, _LOW + _DEPTH))
    walls = Walls(lower=(_LOW, _LOW), upper=(_LOW + _SIDE, 1 - _LOW))
    solver = MpmSolver(Scene(dim=2, resolution=resolution, walls=walls, bodies=(column,)))
    solver.advance(_SETTLING)
    height, J = np.zeros((2, solver.particle_count))
    for _ in range(_AVERAGED):
        solver.advance()
        height += solver.positions[:, 1] / _AVERAGED
        J += solver.volume_ratio / _AVERAGED
    depth = _LOW + _SURFACE - height
    layer = np.clip(depth / _SURFACE * _LAYERS, 0, _LAYERS - 1).astype(int)
    layers = [
        np.bincount(layer, values, minlength=_LAYERS) / np.bincount(layer, minlength=_LAYERS)
        for values in (J, depth, _closed_form(depth))
    ]
    worst = float(np.abs(layers[0] - layers[2]).max() / _ON_FLOOR)
    mean = float(1 - J.mean())
    checks = (
        Check.at_most("J, worst of 8 layers / compression on the floor", worst, _MAX_ERROR),
        Check.at_most("mean compression, relative error", mean / _MEAN - 1, _MAX_ERROR),
        Check.reported("mean compression", mean, f"{_MEAN:.5f}"),
    )
    line = np.linspace(0, _SURFACE, 50)
    curves = (
        Curve(J[::8], depth[::8], "every 8th particle", 5, "o", {"marker": ".", "markersize": 3}),
        Curve(_closed_form(line), line, "closed form"),
        Curve(layers[0], layers[1], "layers", 1, "o"),
    )
    limits = {"xlim": (0.975, 1.01), "ylim": (_SURFACE, 0)}
    return Result(checks, (Panel("Water at rest", "J", "depth [m]", curves, limits),))


def _closed_form(depth: Floats) -> Floats:
    return np.sqrt(1 - 2 * _LOAD * np.clip(depth, 0, None))
