"""Collapse of a planar column of sand, compared with the run-out and height that experiments found.

A column of half-width L0 and height H0 = a L0 is released on a rough plane and leaves a pile of half-width L
and height H. In experiments the run-out (L - L0) / L0 grows linearly with small a and as a^(2/3) with large
a; the prefactors differ between laboratories and grains:

    Lube et al. (2005), sand, rice, sugar:      1.2 a,  1.9 a^(2/3) above a = 1.8 to 2.8
    Lajeunesse et al. (2005), glass beads:      1.8 a,  2.3 a^(2/3) above a = 3

G. Lube, H. E. Huppert, R. S. J. Sparks, A. Freundt, Phys. Rev. E 72 (2005) 041301; E. Lajeunesse, J. B.
Monnier, G. M. Homsy, Phys. Fluids 17 (2005) 103302; both as given by P.-Y. Lagree, L. Staron, S. Popinet,
J. Fluid Mech. 686 (2011) 378, equations 3.1 and 3.2.

Experiments tell of grains the angle of repose, at which a layer of them comes to rest on a slope. In a layer
that shears without changing its volume, as this solver's sand does, the directions of stress and of rate of
strain agree, and what resists on planes along the layer is tan(repose) = sin(phi), phi the friction angle
in plane strain (E. H. Davis, in Soil Mechanics: Selected Topics, 1968). So 30 degrees of repose are 35.3 in
plane strain.

From its own friction angle the solver makes the cone ||dev tau|| = alpha d p by the formula of 3D. In 2D the
plane-strain friction angle of this cone is asin(sqrt(2) alpha), again another angle. `angle_for_sand` gives
the angle whose cone has the wanted plane-strain angle.
"""

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from hybridmpm._support.charts import COLOURS, MARKERS, panels
from hybridmpm.mpm import MpmSolver
from hybridmpm.scene import Box, HalfSpaceObstacle, Sand, Scene, Walls
from hybridmpm_lab.validation import cells
from hybridmpm_lab.validation.case import Case, Check, Floats

if TYPE_CHECKING:
    from matplotlib.figure import Figure

HALF_WIDTHS = {0.5: 0.375, 1.0: 0.3125, 2.0: 0.1875, 4.0: 0.125}
"""L0 of sand [m] by aspect ratio: the largest on grid lines with which piles stay off the far wall."""
REPOSE_ANGLE = 30.0
"""Angle of repose of dry sand [degrees]."""
BEADS_HALF_WIDTHS = {0.5: 0.375, 1.0: 0.25, 2.0: 0.15625, 4.0: 0.09375}
"""L0 of glass beads [m] by aspect ratio; their piles are longer."""
BEADS_REPOSE_ANGLE = 22.0
"""Angle of repose of glass beads [degrees]."""
TOLERANCE = 0.2
"""Accepted relative error of the run-out of sand [-]: what experiments scatter by."""

_LOW = 0.03125
"""Position of the lower walls [m]."""
_MIDDLE = 0.0625
"""Position x of the plane of symmetry [m]; only the right half is simulated."""
_G = 9.81
_STRAIN = 1e-3
"""rho g H0 / E [-], the same for all columns. Softer sand bounces and spreads farther."""


def sand_runout(aspect: npt.ArrayLike) -> Floats:
    """Return (L - L0) / L0 of sand, by the fit to the experiments of Lube et al."""
    a = np.asarray(aspect, dtype=np.float64)
    return np.where(a < 2.3, 1.2 * a, 1.9 * a ** (2 / 3))


def beads_runout(aspect: npt.ArrayLike) -> Floats:
    """Return (L - L0) / L0 of glass beads, by the fit to the experiments of Lajeunesse et al."""
    a = np.asarray(aspect, dtype=np.float64)
    return np.where(a < 3.0, 1.8 * a, 2.3 * a ** (2 / 3))


def height_band(aspect: float) -> tuple[float, float]:
    """Return the accepted H / L0: 0.75 a to 1.25 a for low columns, 0.65 a^0.35 to 1.3 a^0.4 for high ones.

    These are the bounds of the public suite dev_soil_sph (github.com/SueHeir/dev_soil_sph). The lower bound
    for high columns is the continuum's branch of Lagree et al., the upper one is 30 % above Lube's a^0.4.
    """
    if aspect < 2:
        return 0.75 * aspect, 1.25 * aspect
    return 0.65 * aspect**0.35, 1.3 * aspect**0.4


def plane_strain_angle(repose: float) -> float:
    """Return the plane-strain friction angle [degrees] of sand that rests at the angle `repose` [degrees]."""
    return float(np.degrees(np.arcsin(np.tan(np.radians(repose)))))


def angle_for_sand(angle: float) -> float:
    """Return the `friction_angle` of `Sand` [degrees] that gives a plane-strain angle in 2D [degrees]."""
    alpha = np.sin(np.radians(angle)) / np.sqrt(2)
    scale = 2 * np.sqrt(2 / 3)
    return float(np.degrees(np.arcsin(3 * alpha / (scale + alpha))))


@dataclass(frozen=True, kw_only=True)
class Pile:
    """The pile that a column left."""

    aspect: float
    repose: float
    """Angle of repose [degrees]."""
    resolution: int
    distance: Floats
    """Distance from the plane of symmetry to the middle of each column of cells, over L0 [-]."""
    depth: Floats
    """Height of the top of the highest cell at least half full in each column of cells, over L0 [-]."""
    runout: float
    """Run-out (L - L0) / L0 [-]; L is the end of the last slab one cell wide at least half a cell deep."""

    @property
    def height(self) -> float:
        """Height H / L0 [-], the mean depth of the first two columns of cells."""
        return float(self.depth[:2].mean())


@dataclass(frozen=True, kw_only=True)
class ColumnCollapseResult:
    """Piles of sand, and piles of glass beads."""

    sand: tuple[Pile, ...]
    beads: tuple[Pile, ...]

    @property
    def checks(self) -> tuple[Check, ...]:
        """Run-out and height of sand, judged; the run-out of beads, reported; and a negative control."""
        sand = [
            check
            for pile in self.sand
            for check in (
                _runout_check(f"sand: run-out, a = {pile.aspect:g}", pile),
                Check.between(f"sand: height, a = {pile.aspect:g}", pile.height, *height_band(pile.aspect)),
            )
        ]
        beads = [
            Check.reported(
                f"beads: run-out, a = {pile.aspect:g}", pile.runout, f"{beads_runout(pile.aspect):.3g}"
            )
            for pile in self.beads
        ]
        last = self.beads[-1]
        control = f"beads judged as sand: run-out, a = {last.aspect:g} (control)"
        return (*sand, _runout_check(control, last, outside=True), *beads)


def _runout_check(quantity: str, pile: Pile, *, outside: bool = False) -> Check:
    fit = float(sand_runout(pile.aspect))
    return Check.between(quantity, pile.runout, (1 - TOLERANCE) * fit, (1 + TOLERANCE) * fit, outside=outside)


def run(
    aspects: tuple[float, ...] = tuple(HALF_WIDTHS),
    *,
    beads: tuple[float, ...] = tuple(BEADS_HALF_WIDTHS),
    resolution: int = 128,
) -> ColumnCollapseResult:
    """Let columns of sand (`aspects`, keys of `HALF_WIDTHS`) and of glass beads (`beads`) collapse."""
    return ColumnCollapseResult(
        sand=tuple(_collapse(a, HALF_WIDTHS[a], REPOSE_ANGLE, resolution) for a in aspects),
        beads=tuple(_collapse(a, BEADS_HALF_WIDTHS[a], BEADS_REPOSE_ANGLE, resolution) for a in beads),
    )


def _collapse(aspect: float, half_width: float, repose: float, resolution: int) -> Pile:
    scene = _scene(aspect, half_width, repose, resolution)
    solver = MpmSolver(scene)
    # Twice the time 3.3 sqrt(H0 / g) after which Lube et al. saw no more motion.
    solver.advance(int(2 * 3.3 * np.sqrt(aspect * half_width / _G) / scene.frame_dt))
    counts = cells.counts(solver.positions, (_MIDDLE, _LOW), scene)
    half_cell = scene.particles_per_cell / 2
    depth = np.array([cells.extent(column >= half_cell) for column in counts])
    end = cells.extent(counts.sum(axis=1) >= half_cell)
    return Pile(
        aspect=aspect,
        repose=repose,
        resolution=resolution,
        distance=(np.arange(resolution, dtype=np.float64) + 0.5) * scene.dx / half_width,
        depth=depth * scene.dx / half_width,
        runout=end * scene.dx / half_width - 1,
    )


def _scene(aspect: float, half_width: float, repose: float, resolution: int) -> Scene:
    height = aspect * half_width
    stiffness = Sand().density * _G * height / _STRAIN
    sand = Sand(youngs_modulus=stiffness, friction_angle=angle_for_sand(plane_strain_angle(repose)))
    upper = (_MIDDLE + half_width, _LOW + height)
    return Scene(
        dim=2,
        resolution=resolution,
        # A rough plane, like one of glued grains.
        walls=Walls(lower=(_LOW, _LOW), upper=(1 - _LOW, 1 - _LOW), contact="sticky"),
        bodies=(Box(material=sand, lower=(_MIDDLE, _LOW), upper=upper),),
        obstacles=(HalfSpaceObstacle(point=(_MIDDLE, 0.5), normal=(1.0, 0.0), contact="slip"),),
    )


def draw(result: ColumnCollapseResult) -> "Figure":
    """Draw run-out and height over the aspect ratio with the fits to experiments, and shapes of piles."""
    figure, ((runout, height, shape),) = panels(3, width=3.9)
    a = np.geomspace(0.4, 5, 80)
    _draw_band(runout, a, (1 - TOLERANCE) * sand_runout(a), (1 + TOLERANCE) * sand_runout(a))
    runout.plot(a, beads_runout(a), "--", color=COLOURS[1], linewidth=1, label="beads, Lajeunesse's fit")
    _draw_band(height, a, *np.array([height_band(float(aspect)) for aspect in a]).T)
    height.plot(a, np.where(a < 1.15, a, a**0.4), "--", color="black", linewidth=1, label="sand, Lube's fit")
    for piles, name, k in ((result.sand, "sand", 0), (result.beads, "beads", 1)):
        label = f"{name}, at rest at {piles[0].repose:g}°"
        aspects = [pile.aspect for pile in piles]
        style = {"linestyle": "", "marker": MARKERS[k], "color": COLOURS[k], "label": label}
        runout.plot(aspects, [pile.runout for pile in piles], **style)
        height.plot(aspects, [pile.height for pile in piles], **style)
    runout.set(title="run-out (L - L0) / L0", yticks=[0.5, 1, 2, 5], yticklabels=["0.5", "1", "2", "5"])
    height.set(title="height H / L0", yticks=[0.5, 1, 2], yticklabels=["0.5", "1", "2"])
    for k, pile in enumerate(result.sand):
        deep = pile.depth > 0
        shape.plot(pile.distance[deep], pile.depth[deep], color=COLOURS[k], label=f"a = {pile.aspect:g}")
    shape.set(title="piles of sand", xlabel="x / L0", ylabel="depth / L0")
    for axes in (runout, height, shape):
        axes.legend()
    return figure


def _draw_band(axes: Any, a: Floats, low: Floats, high: Floats) -> None:
    axes.fill_between(a, low, high, color=COLOURS[2], alpha=0.2, linewidth=0, label="sand, accepted")
    ticks = [0.5, 1, 2, 4]
    axes.set(xscale="log", yscale="log", xlabel="a = H0 / L0", xticks=ticks, xticklabels=map(str, ticks))
    axes.minorticks_off()


CASE = Case(
    name="column_collapse",
    title="Granular column collapse",
    text=(
        "Planar columns of sand that rests at 30 degrees collapse on a rough plane (sticky walls); one half "
        "is simulated, the plane of symmetry is a frictionless half-space. The run-out has to agree within "
        "20 % with the fit of Lube et al. (2005; sand, rice, sugar), as given by Lagrée, Staron and Popinet "
        "(2011), the height has to lie in the band of the public suite dev_soil_sph around Lube's fit. The "
        "pile ends where the last one-cell slab does that is half a cell deep, after twice the time in "
        "which experiments come to rest; its height is the top of the highest cell in the middle that is at "
        "least half full. A layer that shears without changing its volume resists with the sine of its "
        "friction angle in plane strain, so 30 degrees of repose are 35.3 degrees there: layers of 8 and 16 "
        "cells that slide at 1 m/s are braked by 0.54 to 0.55 g, the sine is 0.58. The edge of the pile "
        "depends on the grid, which resolves an ever thinner toe; what is deeper does not. For a = 2 the "
        "run-out is 2.00 at 64², 2.67 at 128² and 3.50 at 256², while the place where the pile is 0.12 L0 "
        "deep moves from 2.46 at 128² to 2.35 at 256². So the figures hold for 128 cells per metre, 12 to "
        "48 cells per L0, and sand that its own weight strains by 0.1 %. Glass beads, which rest at 22 "
        "degrees, run farther than in the experiments of Lajeunesse et al. (2005), the higher their column "
        "the more: here they resist alike at any speed, while real ones resist more where they shear fast. "
        "Judged by the fit for sand, their highest column has to fail."
    ),
    run=run,
    draw=draw,
)
