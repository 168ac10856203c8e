"""Columns of sand in 3D, of radius r_0 and height a r_0, are let go on a sticky and on a sliding floor."""

from typing import NamedTuple

import numpy as np

from hybridmpm.mpm import MpmSolver
from hybridmpm.scene import Cylinder, Sand, Scene, Walls
from hybridmpm_lab.validation.case import Check, Curve, Floats, Panel, Result

_RADIUS, _TALL_RADIUS = 0.12, 0.08
"""Radius r_0 of columns [m], and of those higher than it, whose heaps would else reach the walls."""
_FLOORS = {
    "sticky": (30.0, {"contact": "sticky"}),
    "sliding": (20.0, {"contact": "separating", "friction": 0.3}),
}
"""Friction angle of the sand [degrees] and contact of the floor, by name."""
_TOLERANCE = 0.2  # part of the fitted run-out by which that on the sliding floor may differ
_LOW, _MIDDLE = 0.1, 0.5
_G = 9.81


class _Heap(NamedTuple):
    """Heap at its end; lengths over r_0."""

    radii: Floats
    """Outer radii of rings one cell wide."""
    depth: Floats
    """Mean depths of the rings."""
    cell: float

    @property
    def run_out(self) -> float:
        return float(self.radii[np.flatnonzero(self.depth >= 0.5 * self.cell)[-1]] - 1.0)


def fit(aspect: float) -> tuple[float, float]:
    """Return the run-out and the height that the experiments fit, both over r_0."""
    run_out = 1.24 * aspect if aspect < 1.7 else 1.6 * np.sqrt(aspect)
    return float(run_out), float(min(aspect, 0.88 * aspect ** (1 / 6)))


def run(aspects: tuple[float, ...] = (0.55, 1.0, 2.0), *, resolution: int = 96) -> Result:
    """Let columns of these aspects go on both floors, at a resolution [cells/m]."""
    checks: list[Check] = []
    curves: dict[float, list[Curve]] = {aspect: [] for aspect in aspects}
    for k, (floor, (angle, _)) in enumerate(_FLOORS.items()):
        for aspect in aspects:
            heap, (run_out, height) = _collapse(floor, aspect, resolution), fit(aspect)
            where = f"{floor} floor, a = {aspect:g}"
            if floor == "sliding":
                band = (1 - _TOLERANCE) * run_out, (1 + _TOLERANCE) * run_out
                checks.append(Check.between(f"run-out, {where}", heap.run_out, band))
            else:
                checks.append(Check.reported(f"run-out, {where}", heap.run_out, f"{run_out:.2f}"))
            checks.append(Check.reported(f"height, {where}", float(heap.depth[:2].mean()), f"{height:.2f}"))
            label = f"{floor} floor, {angle:g}°"
            curves[aspect].append(Curve(heap.radii - 0.5 * heap.cell, heap.depth, label, k))
    panels = []
    for aspect, drawn in curves.items():
        run_out, height = fit(aspect)
        points = Curve([0, 1 + run_out], [height, 0], "Lube et al. 2004", style="o")
        limits = {"xlim": (0, 4.6), "ylim": (0, 1.05)}
        panels.append(Panel(f"a = {aspect:g}", "r / r₀", "depth / r₀", (*drawn, points), limits))
    return Result(checks, panels)


def _collapse(floor: str, aspect: float, resolution: int) -> _Heap:
    angle, contact = _FLOORS[floor]
    radius = _RADIUS if aspect <= 1 else _TALL_RADIUS
    column = Cylinder(
        material=Sand(friction_angle=angle),
        start=(_MIDDLE, _LOW, _MIDDLE),
        end=(_MIDDLE, _LOW + aspect * radius, _MIDDLE),
        radius=radius,
    )
    walls = Walls(lower=(_LOW,) * 3, upper=(1 - _LOW,) * 3, faces={"y_lower": contact})
    scene = Scene(dim=3, resolution=resolution, walls=walls, bodies=(column,))
    solver = MpmSolver(scene)
    # Experiments come to rest after three times the time of a fall from the top.
    solver.advance(int((6 * np.sqrt(aspect * radius / _G) + 0.25) / scene.frame_dt))
    x = solver.positions.astype(np.float64)
    edges = np.arange(0.0, 0.4, scene.dx)
    counts = np.histogram(np.hypot(x[:, 0] - _MIDDLE, x[:, 2] - _MIDDLE), edges)[0]
    depth = counts * scene.spacing**3 / (np.pi * np.diff(edges**2))
    return _Heap(radii=edges[1:] / radius, depth=depth / radius, cell=scene.dx / radius)
