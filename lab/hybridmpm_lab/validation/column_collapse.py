"""Planar columns of sand, of half-width L0 and height H0 = a L0, collapse on a rough plane.

The run-out (L - L0) / L0 is compared with fits to experiments, with sand and with glass beads.
"""

from typing import NamedTuple

import numpy as np

from hybridmpm.mpm import MpmSolver
from hybridmpm.scene import Box, HalfSpaceObstacle, Sand, Scene, Walls
from hybridmpm_lab.validation.case import Check, Curve, Floats, Panel, Result, cell_counts, extent

ASPECTS = (0.5, 1.0, 2.0, 4.0)
"""Aspect ratios a of columns."""


class _Grains(NamedTuple):
    half_widths: tuple[float, ...]
    """L0 [m] by aspect ratio: the largest on grid lines with which piles stay off the far wall."""
    repose: float
    """Angle of repose [degrees]."""
    fit: tuple[float, float, float]
    """Run-out over a, and over a^(2/3) from the third number on."""


_GRAINS = {
    "sand": _Grains((0.375, 0.3125, 0.1875, 0.125), 30.0, (1.2, 1.9, 2.3)),
    "beads": _Grains((0.375, 0.25, 0.15625, 0.09375), 22.0, (1.8, 2.3, 3.0)),
}
_TOLERANCE = 0.2  # accepted relative error of the run-out of sand [-]: the scatter of experiments
_LOW = 0.03125  # position of the lower walls [m]
_MIDDLE = 0.0625  # position x of the plane of symmetry [m]; only the right half is simulated
_G = 9.81
_STRAIN = 1e-3  # rho g H0 / E [-], the same for all columns. Softer sand bounces and spreads farther


def runout(grains: str, aspect: float) -> float:
    """Return (L - L0) / L0 by the fit to experiments with these grains, a key of `_GRAINS`."""
    slope, factor, high = _GRAINS[grains].fit
    return slope * aspect if aspect < high else factor * float(aspect ** (2 / 3))


def height_band(aspect: float) -> tuple[float, float]:
    """Return the accepted H / L0: 0.75 a to 1.25 a for low columns, 0.65 a^0.35 to 1.3 a^0.4 for high ones.

    The bounds are those of dev_soil_sph (github.com/SueHeir/dev_soil_sph). The lower one for high columns is
    the continuum's branch of Lagrée et al., the upper one is 30 % above Lube's a^0.4.
    """
    if aspect < 2:
        return 0.75 * aspect, 1.25 * aspect
    return 0.65 * aspect**0.35, 1.3 * aspect**0.4


def plane_strain_angle(repose: float) -> float:
    """Return the plane-strain friction angle [degrees] of sand that rests at the angle `repose` [degrees]."""
    return float(np.degrees(np.arcsin(np.tan(np.radians(repose)))))


def angle_for_sand(angle: float) -> float:
    """Return the `friction_angle` of `Sand` [degrees] that gives a plane-strain angle in 2D [degrees].

    `Sand` makes the cone ||dev tau|| = alpha d p from its angle by the formula of 3D. In 2D the plane-strain
    friction angle of this cone is asin(sqrt(2) alpha).
    """
    alpha = np.sin(np.radians(angle)) / np.sqrt(2)
    scale = 2 * np.sqrt(2 / 3)
    return float(np.degrees(np.arcsin(3 * alpha / (scale + alpha))))


class _Pile(NamedTuple):
    """Pile at its end; lengths over L0."""

    aspect: float
    distance: Floats
    """Distance from the plane of symmetry to the middle of each column of cells."""
    depth: Floats
    """Height of the top of the highest cell at least half full in each column of cells."""
    runout: float

    @property
    def height(self) -> float:
        return float(self.depth[:2].mean())


def run(
    aspects: tuple[float, ...] = ASPECTS, *, beads: tuple[float, ...] = ASPECTS, resolution: int = 128
) -> Result:
    """Let columns of sand (`aspects`, of `ASPECTS`) and of glass beads (`beads`) collapse."""
    sand = [_collapse("sand", a, resolution) for a in aspects]
    glass = [_collapse("beads", a, resolution) for a in beads]
    checks = []
    for pile in sand:
        a = pile.aspect
        checks += [
            Check.between(f"sand: run-out, a = {a:g}", pile.runout, _runout_band(a)),
            Check.between(f"sand: height, a = {a:g}", pile.height, height_band(a)),
        ]
    name = f"beads judged as sand: run-out, a = {glass[-1].aspect:g} (control)"
    checks.append(Check.between(name, glass[-1].runout, _runout_band(glass[-1].aspect), control=True))
    for pile in glass:
        fit = f"{runout('beads', pile.aspect):.3g}"
        checks.append(Check.reported(f"beads: run-out, a = {pile.aspect:g}", pile.runout, fit))
    return Result(checks, _panels(sand, glass))


def _runout_band(aspect: float) -> tuple[float, float]:
    fit = runout("sand", aspect)
    return (1 - _TOLERANCE) * fit, (1 + _TOLERANCE) * fit


def _collapse(grains: str, aspect: float, resolution: int) -> _Pile:
    half_width, repose = _GRAINS[grains].half_widths[ASPECTS.index(aspect)], _GRAINS[grains].repose
    height = aspect * half_width
    stiffness = Sand().density * _G * height / _STRAIN
    sand = Sand(youngs_modulus=stiffness, friction_angle=angle_for_sand(plane_strain_angle(repose)))
    column = Box(material=sand, lower=(_MIDDLE, _LOW), upper=(_MIDDLE + half_width, _LOW + height))
    scene = Scene(
        dim=2,
        resolution=resolution,
        # A rough plane, like one of glued grains.
        walls=Walls(lower=(_LOW, _LOW), upper=(1 - _LOW, 1 - _LOW), contact="sticky"),
        bodies=(column,),
        obstacles=(HalfSpaceObstacle(point=(_MIDDLE, 0.5), normal=(1.0, 0.0), contact="slip"),),
    )
    solver = MpmSolver(scene)
    # Twice the time 3.3 sqrt(H0 / g) after which Lube et al. saw no more motion.
    solver.advance(int(2 * 3.3 * np.sqrt(height / _G) / scene.frame_dt))
    counts = cell_counts(solver.positions, (_MIDDLE, _LOW), scene)
    half_cell = scene.particles_per_cell / 2
    depth = np.array([extent(cells >= half_cell) for cells in counts])
    return _Pile(
        aspect=aspect,
        distance=(np.arange(resolution, dtype=np.float64) + 0.5) * scene.dx / half_width,
        depth=depth * scene.dx / half_width,
        runout=extent(counts.sum(axis=1) >= half_cell) * scene.dx / half_width - 1,
    )


def _panels(sand: list[_Pile], beads: list[_Pile]) -> tuple[Panel, ...]:
    a = np.geomspace(0.4, 5, 80)
    runouts = [Curve(a, [runout("beads", one) for one in a], "beads, Lajeunesse's fit", 1, "--")]
    heights = [Curve(a, np.where(a < 1.15, a, a**0.4), "sand, Lube's fit", style="--")]
    for curves, band in ((runouts, _runout_band), (heights, height_band)):
        low, high = np.array([band(one) for one in a]).T
        curves += [Curve(a, low, "sand, accepted", 2), Curve(a, high, colour=2)]
    for k, (name, piles) in enumerate({"sand": sand, "beads": beads}.items()):
        aspects, label = [pile.aspect for pile in piles], f"{name}, at rest at {_GRAINS[name].repose:g}°"
        runouts.append(Curve(aspects, [pile.runout for pile in piles], label, k, "o"))
        heights.append(Curve(aspects, [pile.height for pile in piles], label, k, "o"))
    shapes = [
        Curve(pile.distance[pile.depth > 0], pile.depth[pile.depth > 0], f"a = {pile.aspect:g}", k)
        for k, pile in enumerate(sand)
    ]
    ticks = {"xticks": [0.5, 1, 2, 4], "xticklabels": ["0.5", "1", "2", "4"]}
    ticks |= {"yticks": [0.5, 1, 2, 5], "yticklabels": ["0.5", "1", "2", "5"]}
    logarithmic = {"xscale": "log", "yscale": "log"} | ticks
    return (
        Panel("Run-out", "a = H0 / L0", "(L - L0) / L0", runouts, logarithmic),
        Panel("Height", "a = H0 / L0", "H / L0", heights, logarithmic),
        Panel("Piles of sand", "x / L0", "depth / L0", shapes),
    )
