"""Findings about materials: soft under their weight, costly, or far lighter than others."""

import math
from collections.abc import Iterator

import numpy as np

from hybridmpm._core import MAX_SUBSTEPS
from hybridmpm.checking.report import Finding
from hybridmpm.coarse import FULL, filled_share
from hybridmpm.mpm.cost import cfl_substeps
from hybridmpm.mpm.scene_warnings import SOFT, settled_compression
from hybridmpm.scene import Fluid, Sand, Scene

COSTLY = 3.0
"""Note materials that need this many times the substeps of the others."""
MANY_SUBSTEPS = 50
"""Note the only material of a scene from this many substeps a frame on."""
_KEEPING = {2: 1.2, 3: 1.9}
"""Time of a frame with `transfer_loss` over that without [-], by dimension."""
NARROW_FULL, NARROW = 32, {2: 7, 3: 12}
"""Cells between walls below which sand gains 5 % of its energy in 3 s: in a full box, and by dimension."""
UNEQUAL = 100.0
"""Warn when densities differ by more than this factor."""


def of_matter(scene: Scene, resolution: int) -> Iterator[Finding]:
    """Yield the findings about the materials of a scene; `resolution` is that of the simulator's grid."""
    yield from _soft(scene)
    yield from _narrow(scene, resolution)
    yield from _unequal(scene)
    yield from _costly(scene, resolution)
    yield from _kept(scene)


def _kept(scene: Scene) -> Iterator[Finding]:
    if scene.transfer_loss is not None:
        yield Finding(
            severity="note",
            field="transfer_loss",
            problem=f"makes a frame take about {_KEEPING[scene.dim]:g} times as long",
            advice="leave it out where no opening is narrow and no bounce matters",
        )


def _soft(scene: Scene) -> Iterator[Finding]:
    for material in scene.materials:
        compression = settled_compression(scene, material)
        asked_for = isinstance(material, Fluid) and material.max_compression is not None
        if compression > SOFT and not asked_for:
            or_so = ", or give max_compression" if isinstance(material, Fluid) else ""
            yield Finding(
                severity="warning",
                field=scene.made_of(material),
                problem=f"{material.kind} is so soft that its own weight compresses it by "
                f"{min(compression, 1.0):.0%}, so it loses its volume",
                advice=f"make it {compression / SOFT:.2g} times as stiff{or_so}",
            )


def _narrow(scene: Scene, resolution: int) -> Iterator[Finding]:
    """Yield the finding about sand whose noise walls rectify.

    Places of particles within their cells make a noise of their pressure. Sand bears no tension, so that the
    noise is a pressure in the mean, which the walls of a narrow or full box do not let expand. Without
    gravity nothing presses at first, and nothing grows.
    """
    if not any(scene.gravity):
        return
    sides = np.subtract(scene.walls.upper, scene.walls.lower)
    full = filled_share(scene) >= FULL
    # The way along gravity is free where matter has a surface.
    across = sides if full else sides[np.abs(scene.gravity) <= 0.5 * np.linalg.norm(scene.gravity)]
    cells = float(across.min(initial=math.inf)) * resolution
    needed = NARROW_FULL if full else NARROW[scene.dim]
    for material in scene.materials:
        if isinstance(material, Sand) and cells < needed:
            filled = "fills its box, " if full else ""
            free = ", or leave a twentieth of the box free" if full else ""
            yield Finding(
                severity="warning",
                field=scene.made_of(material),
                problem=f"sand {filled}between walls {cells:.2g} cells apart: its pressure grows, and its "
                "energy by more than 5 % in 3 s",
                advice=f"take at least {needed} cells between the walls{free}",
            )


def _unequal(scene: Scene) -> Iterator[Finding]:
    lightest = min(scene.materials, key=lambda material: material.density)
    heaviest = max(scene.materials, key=lambda material: material.density)
    if heaviest.density > UNEQUAL * lightest.density:
        yield Finding(
            severity="warning",
            field=scene.made_of(lightest),
            problem=f"{lightest.density:g} kg/m^3 beside {heaviest.density:g} kg/m^3: where both share a "
            "grid node, the lighter one moves as the denser one does",
            advice=f"keep densities within a factor of {UNEQUAL:g}",
        )


def _costly(scene: Scene, resolution: int) -> Iterator[Finding]:
    counts = [cfl_substeps(scene, [material], resolution) for material in scene.materials]
    for index, (material, count) in enumerate(zip(scene.materials, counts, strict=True)):
        others = max((other for place, other in enumerate(counts) if place != index), default=0)
        if count > MAX_SUBSTEPS and resolution == scene.resolution:
            # On coarser grids moduli may be lowered, too; there the first frame raises the error.
            yield Finding(
                severity="error",
                field=scene.made_of(material),
                problem=f"{material.kind} of {material.density:g} kg/m^3 needs {count} substeps a frame, "
                f"and at most {MAX_SUBSTEPS} are taken",
                advice=f"make it {(count / MAX_SUBSTEPS) ** 2:.2g} times softer or denser, or frames "
                f"{count / MAX_SUBSTEPS:.2g} times shorter",
            )
        elif count > (COSTLY * others if others else MANY_SUBSTEPS - 1):
            compared = f"; all others need {others}" if others else ""
            yield Finding(
                severity="note",
                field=scene.made_of(material),
                problem=f"{material.kind} of {material.density:g} kg/m^3 needs {count} substeps a "
                f"frame{compared}",
                advice="make it softer or denser, or take a coarser grid",
            )
