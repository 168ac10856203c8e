"""Free fall: every particle follows the closed form up to the rounding of float32.

With equal substeps dt, in each of which gravity acts before particles move (symplectic Euler), the position
after n substeps is exactly

    x_n = x_0 + v_0 t + g (t^2 + t dt) / 2,   t = n dt.
"""

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from hybridmpm._support.charts import COLOURS, MARKERS, panels
from hybridmpm.mpm import MpmSolver
from hybridmpm.scene import Ball, Elastic, Material, Sand, Scene, Walls, Water
from hybridmpm_lab.validation.case import Case, Check, Floats

if TYPE_CHECKING:
    from matplotlib.figure import Figure

MATERIALS: tuple[Material, ...] = (Water(), Sand(), Elastic())
_FRAMES = 100
_G = 9.81
_SPEED = 0.5
_ULP = 2.0**-24
"""Largest rounding error of a number in [0.5, 1]. A substep adds two, of the position and of the velocity."""


@dataclass(frozen=True, kw_only=True)
class Fall:
    """One falling ball; arrays (F,) have an entry for each frame."""

    dim: int
    material: str
    time: Floats
    """Time [s]."""
    error: Floats
    """Largest distance of a particle from the closed form along an axis [m]."""
    bound: float
    """Largest distance that can come from rounding alone [m]."""


@dataclass(frozen=True, kw_only=True)
class FreeFallResult:
    """Falls of all materials in 2D and 3D."""

    falls: tuple[Fall, ...]

    @property
    def checks(self) -> tuple[Check, ...]:
        """Largest distance from the closed form in each fall [m]."""
        return tuple(
            Check.at_most(f"{fall.material}, {fall.dim}D [m]", float(fall.error.max()), fall.bound)
            for fall in self.falls
        )


def run(frames: int = _FRAMES) -> FreeFallResult:
    """Let balls of all materials fall for `frames` frames."""
    return FreeFallResult(
        falls=tuple(_fall(dim, material, frames) for dim in (2, 3) for material in MATERIALS)
    )


def _fall(dim: int, material: Material, frames: int) -> Fall:
    up = np.eye(dim)[1]
    velocity = _SPEED * np.eye(dim)[0]
    ball = Ball(material=material, center=tuple(0.4 + 0.35 * up), radius=0.05, velocity=tuple(velocity))
    box = Walls(lower=(0.1,) * dim, upper=(0.9,) * dim)
    scene = Scene(dim=dim, resolution=32, bodies=(ball,), walls=box)
    solver = MpmSolver(scene, substeps="reference")
    x = solver.rollout(frames).astype(np.float64)
    report = solver.last_frame
    substeps = report.substeps if report else 0
    time = np.arange(frames + 1, dtype=np.float64) * scene.frame_dt
    fallen = _G * (time**2 + time * scene.frame_dt / substeps) / 2
    exact = x[0] + time[:, None, None] * velocity - fallen[:, None, None] * up
    return Fall(
        dim=dim,
        material=material.kind,
        time=time,
        error=np.abs(x - exact).max(axis=(1, 2)),
        bound=2 * frames * substeps * _ULP,
    )


def draw(result: FreeFallResult) -> "Figure":
    """Draw the distance from the closed form over time, with the bound of rounding."""
    figure, ((axes,),) = panels(1, width=5.5)
    for k, fall in enumerate(result.falls):
        label = f"{fall.material}, {fall.dim}D"
        style = {"color": COLOURS[k], "marker": MARKERS[k], "markevery": 12, "markersize": 4}
        axes.plot(fall.time, fall.error * 1e6, label=label, **style)
    first = result.falls[0]
    axes.axhline(first.bound * 1e6, color="black", linestyle="--", label="bound")
    axes.set(title="Distance from the closed form", xlabel="time [s]", ylabel="[µm]", yscale="log")
    axes.legend(ncols=2)
    return figure


CASE = Case(
    name="free_fall",
    title="Free fall",
    text=(
        "Balls of all materials are thrown sideways and fall. The solver is symplectic Euler in time, so "
        "each particle has to follow x0 + v0 t + g (t² + t dt) / 2 up to rounding. Accepted is one unit "
        "of rounding a substep in the position and one in the velocity's part of it (2^-24 each, for "
        "positions below 1 m)."
    ),
    run=run,
    draw=draw,
)
