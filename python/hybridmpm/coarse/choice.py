"""From the name of a coarse level to its settings in a scene."""

import math
import warnings
from collections.abc import Iterator

import numpy as np

from hybridmpm._support.suggestions import nearest
from hybridmpm.coarse.bounds import fastest_impact, settled_potential
from hybridmpm.coarse.level import CoarseLevel
from hybridmpm.coarse.merging import FEWEST_PER_CELL, coarse_resolution
from hybridmpm.coarse.table import CoarseTable, FittedLevel, coarse_table
from hybridmpm.errors import CoarseWarning, ConfigError
from hybridmpm.scene import Scene

SHALLOW = {2: 1.0, 3: 2.0}
"""Depth [cells of the level], by dimension, below which matter at rest loses volume."""
UNEQUAL = 10.0
"""Warn when densities differ by more than this factor."""


def coarse_level(scene: Scene, name: str, table: CoarseTable | None = None) -> CoarseLevel:
    """Return the settings of a fitted level in a scene.

    Where several materials meet, the grid has as many particles per cell as the one that needs most, the
    step and the affine share are the smallest and the relaxation is the largest of all; each material keeps
    its own modulus. A material that nobody fitted in this dimension, such as an elastic solid, enters with
    the constants of `MpmSolver(r_p=..., show_all=True)`.

    Moduli are lowered only as far as matter that has settled between the walls is compressed by
    `CoarseTable.largest_compression`, or by as much as the scene's own moduli let it: deep scenes so get a
    stiffer level, which takes more substeps.

    Parameters
    ----------
    scene : Scene
    name : str
        Name of a level, such as "1/16".
    table : CoarseTable, optional
        The table that comes with the library if absent.

    Raises
    ------
    ConfigError
        There is no such level, or its grid would be too coarse for the scene.

    Warns
    -----
    CoarseWarning
        Matter may land faster than in any scene of the scenarios that the level was fitted to, an obstacle is
        thinner than a cell of its grid, matter settles into a layer of less than one or two of its cells, or
        densities differ by a factor above 10.
    """
    level = level_settings(scene, name, table)
    for text in level_warnings(scene, level, table):
        warnings.warn(text, CoarseWarning, stacklevel=3)
    return level


def level_warnings(scene: Scene, level: CoarseLevel, table: CoarseTable | None = None) -> list[str]:
    """Return the texts of the warnings that `coarse_level` raises of a level in a scene."""
    known = coarse_table() if table is None else table
    return [
        *_speed_warnings(scene, level),
        *_thin_warnings(scene, level, known),
        *_shallow_warnings(scene, level),
        *_density_warnings(scene, level),
    ]


def _fitted(scene: Scene, name: str, table: CoarseTable) -> list[FittedLevel]:
    """Return the entries of those of the scene's materials that were fitted."""
    entries = [table.find(material.kind, scene.dim, name) for material in scene.materials]
    return [entry for entry in entries if entry is not None]


def level_settings(scene: Scene, name: str, table: CoarseTable | None = None) -> CoarseLevel:
    """Return the settings of a fitted level in a scene, without warnings; see `coarse_level`."""
    known = coarse_table() if table is None else table
    r_p = _checked_ratio(name, known)
    entries = [known.find(material.kind, scene.dim, name) for material in scene.materials]
    fitted = _fitted(scene, name, known)
    if not fitted:
        return CoarseLevel.unfitted(scene, r_p).named(name)
    natives = [material.to_native(scene.potential_drop) for material in scene.materials]
    strange = [native for native, entry in zip(natives, entries, strict=True) if entry is None]
    plain = CoarseLevel.unfitted(scene, r_p)
    per_cell = max([entry.particles_per_cell for entry in fitted] + [FEWEST_PER_CELL] * bool(strange))
    settled = settled_potential(scene) / known.largest_compression
    return CoarseLevel(
        name=name,
        r_p=r_p,
        resolution=coarse_resolution(scene, r_p, per_cell),
        moduli=tuple(
            1.0 if entry is None else _modulus(entry, settled / native.sound_speed**2)
            for native, entry in zip(natives, entries, strict=True)
        ),
        cfl=min([entry.cfl for entry in fitted] + [native.default_cfl for native in strange]),
        affine_share=min([entry.affine_share for entry in fitted] + [plain.affine_share] * bool(strange)),
        relaxation=max([entry.relaxation for entry in fitted] + [plain.relaxation] * bool(strange)),
        fastest=min(entry.fastest for entry in fitted),
    )


def _modulus(entry: FittedLevel, least: float) -> float:
    """Return the factor on a material's moduli; `least` is the smallest that the depth allows."""
    return min(1.0, max(entry.modulus, least))


def _checked_ratio(name: str, table: CoarseTable) -> float:
    ratios = table.ratios
    if isinstance(name, str) and name in ratios:
        return ratios[name]
    known = ", ".join(repr(one) for one in ratios)
    raise ConfigError(f"coarse level must be one of {known}, got {name!r}{_suggestion(name, ratios)}")


def _suggestion(name: object, ratios: dict[str, float]) -> str:
    """Return the question whether the nearest coarse level was meant, where there is one."""
    near: str | None = None
    if isinstance(name, int | float) and not isinstance(name, bool) and name > 0 and math.isfinite(name):
        near = min(ratios, key=lambda one: abs(math.log(ratios[one] / name)))
    else:
        near = nearest(name, ratios)
    return "" if near is None else f"; did you mean {near!r}?"


def _speed_warnings(scene: Scene, level: CoarseLevel) -> Iterator[str]:
    speed = fastest_impact(scene)
    if level.fastest is not None and speed > level.fastest:
        yield (
            f"this scene may reach {speed:.2g} m/s, but coarse level {level.name!r} was fitted up to "
            f"{level.fastest:.2g} m/s: its error may be larger than the table says; compare it with a coarse "
            "level of more particles, or with MpmSolver(scene, r_p=..., show_all=True), whose constants are "
            "not fitted"
        )


def _shallow_warnings(scene: Scene, level: CoarseLevel) -> Iterator[str]:
    """Warn where matter settles into about a cell of the level, but into several of the scene."""
    gravity = float(np.linalg.norm(scene.gravity))
    depth = settled_potential(scene) / gravity if gravity else math.inf
    if 2 * scene.dx <= depth < SHALLOW[scene.dim] / level.resolution:
        yield (
            f"matter settles {depth:.2g} m deep in this scene, where a cell of coarse level {level.name!r} "
            f"is {_cell(level):g} m wide, so at rest its volume may be off by a tenth or more: take a coarse "
            "level of more particles"
        )


def _density_warnings(scene: Scene, level: CoarseLevel) -> Iterator[str]:
    """Warn where densities differ much: coarse levels were fitted to scenes of one density."""
    densities = [material.density for material in scene.materials]
    if max(densities) > UNEQUAL * min(densities):
        yield (
            f"densities from {min(densities):g} to {max(densities):g} kg/m^3 meet in this scene, but coarse "
            f"level {level.name!r} was fitted to matter of one density: its error may be larger than the "
            "table says; take a coarse level of more particles"
        )


def _thin_warnings(scene: Scene, level: CoarseLevel, table: CoarseTable) -> Iterator[str]:
    """Warn of obstacles thinner than a cell of the level, which particles may pass."""
    if level.resolution >= scene.resolution:
        return  # The solver warns of obstacles that are thin on the scene's own grid.
    cell = _cell(level)
    for i, obstacle in enumerate(scene.obstacles):
        thickness = obstacle.smallest_extent
        if thickness >= cell:
            continue
        finer = (name for name, r_p in table.ratios.items() if r_p > level.r_p)
        fits = next((one for one in finer if _cell(level_settings(scene, one, table)) <= thickness), None)
        other = f"coarse level {fits!r}" if fits else "MpmSolver(scene), which simulates all particles"
        rest = f", or take {other}" if fits or thickness * scene.resolution >= 1 else ""
        yield (
            f"obstacles[{i}] ({obstacle.shape}) is {thickness:.3g} m thick, less than a cell of {cell:g} m "
            f"of coarse level {level.name!r}, so material may pass through it: make it at least {cell:g} m "
            f"thick{rest}"
        )


def _cell(level: CoarseLevel) -> float:
    """Return the width of a cell [m], rounded up: an obstacle of this thickness raises no warning."""
    return math.ceil(1e4 / level.resolution) / 1e4
