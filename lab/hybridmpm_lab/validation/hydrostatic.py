"""Water at rest under its own weight, compared with the closed form of its equation of state.

The Kirchhoff stress tau = lambda J (J - 1) is a Cauchy stress sigma = tau / J = lambda (J - 1), so the
pressure is p = lambda (1 - J). The density is rho = rho_0 / J. At depth s below the surface dp/ds = rho g
gives -lambda J dJ/ds = rho_0 g, hence

    J(s) = sqrt(1 - 2 rho_0 g s / lambda).

A column of rest depth h has the pressure rho_0 g h on its floor, where J = 1 - rho_0 g h / lambda. J is
linear in the mass above, so its mean over the particles is 1 - rho_0 g h / (2 lambda), and the surface
settles at the height h (1 - rho_0 g h / (2 lambda)).
"""

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from hybridmpm._support.charts import COLOURS, MARKERS, panels
from hybridmpm.mpm import MpmSolver
from hybridmpm.scene import Box, Scene, Walls, Water
from hybridmpm.scene.materials import REFERENCE_BULK_MODULUS
from hybridmpm_lab.validation.case import Case, Check, Floats

if TYPE_CHECKING:
    from matplotlib.figure import Figure

MAX_ERROR = 0.1
"""Largest error of J, over the compression 1 - J on the floor [-]."""

_DEPTH = 0.4
"""Rest depth h of the column [m]."""
_LOW = 0.125
"""Position of the lower walls [m]."""
_SIDE = 0.25
"""Width of the column [m]."""
_LAYERS = 8
"""Number of layers over which J is averaged."""
_SETTLING = 1200
"""Number of frames before the average, in which the column compresses and oscillates."""
_AVERAGED = 400
"""Number of frames in the average."""
_G = 9.81
_LOAD = Water().density * _G / REFERENCE_BULK_MODULUS
"""rho_0 g / lambda [1/m]."""
FLOOR_COMPRESSION = _LOAD * _DEPTH
"""Compression 1 - J on the floor in the closed form [-]."""
MEAN_COMPRESSION = FLOOR_COMPRESSION / 2
"""Mean compression 1 - J of the particles in the closed form [-]."""
_SURFACE = _DEPTH * (1 - MEAN_COMPRESSION)
"""Height of the settled surface above the floor in the closed form [m]."""


@dataclass(frozen=True, kw_only=True)
class HydrostaticResult:
    """Means of each of N particles over a second of the settled column."""

    resolution: int
    depth: Floats
    """Depth (N,) below the settled surface [m]."""
    volume_ratio: Floats
    """J (N,) [-]."""

    @property
    def layers(self) -> tuple[Floats, Floats, Floats]:
        """Mean depth [m], mean J and mean closed-form J of the particles in each layer of equal height."""
        layer = np.clip(self.depth / _SURFACE * _LAYERS, 0, _LAYERS - 1).astype(int)
        counts = np.bincount(layer, minlength=_LAYERS)
        depth, J, exact = (
            np.bincount(layer, values, minlength=_LAYERS) / counts
            for values in (self.depth, self.volume_ratio, closed_form(self.depth))
        )
        return depth, J, exact

    @property
    def checks(self) -> tuple[Check, ...]:
        """Error of J relative to the compression on the floor, and error of the mean compression."""
        _, J, exact = self.layers
        error = np.abs(J - exact) / FLOOR_COMPRESSION
        mean = float(1 - self.volume_ratio.mean())
        return (
            Check.at_most("J, worst of 8 layers / compression on the floor", float(error.max()), MAX_ERROR),
            Check.at_most("mean compression, relative error", mean / MEAN_COMPRESSION - 1, MAX_ERROR),
            Check.reported("mean compression", mean, f"{MEAN_COMPRESSION:.5f}"),
        )


def closed_form(depth: Floats) -> Floats:
    """Return J at depths [m] below the surface."""
    return np.sqrt(1 - 2 * _LOAD * np.clip(depth, 0, None))


def run(resolution: int = 128) -> HydrostaticResult:
    """Let a column of water settle on a grid of `resolution` cells per metre."""
    column = Box(material=Water(), lower=(_LOW, _LOW), upper=(_LOW + _SIDE, _LOW + _DEPTH))
    walls = Walls(lower=(_LOW, _LOW), upper=(_LOW + _SIDE, 1 - _LOW))
    solver = MpmSolver(Scene(dim=2, resolution=resolution, walls=walls, bodies=(column,)))
    solver.advance(_SETTLING)
    height = np.zeros(solver.particle_count)
    J = np.zeros(solver.particle_count)
    for _ in range(_AVERAGED):
        solver.advance()
        height += solver.positions[:, 1]
        J += solver.volume_ratio
    return HydrostaticResult(
        resolution=resolution,
        depth=_LOW + _SURFACE - height / _AVERAGED,
        volume_ratio=J / _AVERAGED,
    )


def draw(result: HydrostaticResult) -> "Figure":
    """Draw J over depth: particles, layers and the closed form."""
    figure, ((axes,),) = panels(1, width=5.5)
    depth, J, _ = result.layers
    some = slice(None, None, 8)
    axes.plot(
        result.volume_ratio[some],
        result.depth[some],
        ".",
        color=COLOURS[5],
        markersize=3,
        label="every 8th particle",
    )
    line = np.linspace(0, _SURFACE, 50)
    axes.plot(closed_form(line), line, color="black", label="closed form")
    axes.plot(J, depth, color=COLOURS[1], marker=MARKERS[0], linestyle="none", label="layers")
    axes.set(title="Water at rest", xlabel="J", ylabel="depth [m]", xlim=(0.975, 1.01), ylim=(_SURFACE, 0))
    axes.legend(loc="upper left")
    return figure


CASE = Case(
    name="hydrostatic",
    title="Hydrostatic pressure and compression",
    text=(
        "A column of water 0.4 m deep falls into its own compression and comes to rest; positions and J "
        "are averaged over one second after three. With tau = lambda J (J - 1) the pressure is lambda (1 "
        "- J), and the balance of forces gives J(s) = sqrt(1 - 2 rho g s / lambda) at depth s, 1.4 % of "
        "compression on the floor. Judged are the means of eight layers of equal height, relative to the "
        "compression on the floor, and the mean over all particles. Single particles scatter, above all "
        "in the cell next to the floor: the jitter they start with is never forgotten."
    ),
    run=run,
    draw=draw,
)
