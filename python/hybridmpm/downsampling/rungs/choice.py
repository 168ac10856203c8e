"""From the name of a rung to its settings in a scene."""

import math
import warnings

import numpy as np

from hybridmpm._support.suggestions import nearest
from hybridmpm.downsampling.merging import FEWEST_PER_CELL, coarse_resolution
from hybridmpm.downsampling.rungs.bounds import fastest_impact, settled_potential
from hybridmpm.downsampling.rungs.rung import Rung
from hybridmpm.downsampling.rungs.table import RungEntry, RungTable, rung_table
from hybridmpm.errors import ConfigError, RungWarning
from hybridmpm.scene import Scene

SHALLOW = {2: 1.0, 3: 2.0}
"""Depth [cells of the rung], by dimension, below which matter at rest was seen to lose volume."""
UNEQUAL = 10.0
"""Ratio of densities from which on something is said."""


def rung_for(scene: Scene, name: str, table: RungTable | None = None) -> Rung:
    """Return the settings of a fitted rung in a scene.

    Where several materials meet, the grid has as many particles per cell as the one that needs most, the
    step and the affine share are the smallest and the relaxation is the largest of all; each material keeps
    its own modulus. A material that nobody fitted in this dimension, such as an elastic solid, enters with
    the constants of `MpmSolver(r_p=..., carry=True)`.

    Moduli are lowered only as far as matter that has settled between the walls is compressed by
    `RungTable.largest_compression`, or by as much as the scene's own moduli let it: deep scenes so get a
    stiffer rung, which takes more substeps.

    Parameters
    ----------
    scene : Scene
    name : str
        Name of a rung, such as "1/16".
    table : RungTable, optional
        The table that comes with the library if absent.

    Raises
    ------
    ConfigError
        There is no such rung, or its grid would be too coarse for the scene.

    Warns
    -----
    RungWarning
        Matter can land faster than in any scene of the scenarios that the rung was fitted to, an obstacle is
        thinner than a cell of its grid, matter settles into a layer that only the scene's own grid tells, or
        is of densities that differ by a factor above 10.
    """
    known = rung_table() if table is None else table
    rung = _settings(scene, name, known)
    _tell_speed(scene, rung)
    _tell_thin(scene, rung, known)
    _tell_shallow(scene, rung)
    _tell_densities(scene, rung)
    return rung


def _fitted(scene: Scene, name: str, table: RungTable) -> list[RungEntry]:
    """Return the entries of those of the scene's materials that were fitted."""
    entries = [table.find(material.kind, scene.dim, name) for material in scene.materials]
    return [entry for entry in entries if entry is not None]


def _settings(scene: Scene, name: str, known: RungTable) -> Rung:
    """Return the settings of a rung in a scene, and warn of nothing."""
    r_p = _checked_ratio(name, known)
    entries = [known.find(material.kind, scene.dim, name) for material in scene.materials]
    fitted = _fitted(scene, name, known)
    if not fitted:
        return Rung.unfitted(scene, r_p).named(name)
    natives = [material.to_native(scene.potential_drop) for material in scene.materials]
    strange = [native for native, entry in zip(natives, entries, strict=True) if entry is None]
    plain = Rung.unfitted(scene, r_p)
    per_cell = max([entry.particles_per_cell for entry in fitted] + [FEWEST_PER_CELL] * bool(strange))
    settled = settled_potential(scene) / known.largest_compression
    return Rung(
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


def _modulus(entry: RungEntry, least: float) -> float:
    """Return the factor on a material's moduli, which depth asks to be at least `least`."""
    return min(1.0, max(entry.modulus, least))


def _checked_ratio(name: str, table: RungTable) -> float:
    ratios = table.ratios
    if isinstance(name, str) and name in ratios:
        return ratios[name]
    known = ", ".join(repr(one) for one in ratios)
    raise ConfigError(f"rung must be one of {known}, got {name!r}{_suggestion(name, ratios)}")


def _suggestion(name: object, ratios: dict[str, float]) -> str:
    """Return the question whether the nearest rung was meant, where there is one."""
    near: str | None = None
    if isinstance(name, int | float) and not isinstance(name, bool) and name > 0 and math.isfinite(name):
        near = min(ratios, key=lambda one: abs(math.log(ratios[one] / name)))
    else:
        near = nearest(name, ratios)
    return "" if near is None else f"; did you mean {near!r}?"


def _tell_speed(scene: Scene, rung: Rung) -> None:
    speed = fastest_impact(scene)
    if rung.fastest is not None and speed > rung.fastest:
        warnings.warn(
            f"matter may land at {speed:.2g} m/s in this scene, but rung {rung.name!r} was fitted up to "
            f"{rung.fastest:.2g} m/s: its error may be larger than the table says; compare it with a "
            "rung of more particles, or with MpmSolver(scene, r_p=..., carry=True), whose constants are not "
            "fitted",
            RungWarning,
            stacklevel=4,
        )


def _tell_shallow(scene: Scene, rung: Rung) -> None:
    """Warn where matter settles into about a cell of the rung, but into several of the scene."""
    gravity = float(np.linalg.norm(scene.gravity))
    depth = settled_potential(scene) / gravity if gravity else math.inf
    if 2 * scene.dx <= depth < SHALLOW[scene.dim] / rung.resolution:
        warnings.warn(
            f"matter settles {depth:.2g} m deep in this scene, where a cell of rung {rung.name!r} is "
            f"{_cell(rung):g} m wide, so at rest its volume may be off by a tenth or more: take a rung of "
            "more particles",
            RungWarning,
            stacklevel=4,
        )


def _tell_densities(scene: Scene, rung: Rung) -> None:
    """Warn where matter is far lighter than other matter: rungs were fitted to scenes of one density."""
    densities = [material.density for material in scene.materials]
    if max(densities) > UNEQUAL * min(densities):
        warnings.warn(
            f"densities from {min(densities):g} to {max(densities):g} kg/m^3 meet in this scene, but rung "
            f"{rung.name!r} was fitted to matter of one density: its error may be larger than the table "
            "says; take a rung of more particles",
            RungWarning,
            stacklevel=4,
        )


def _tell_thin(scene: Scene, rung: Rung, table: RungTable) -> None:
    """Warn of obstacles thinner than a cell of the rung, which the few may pass with what they carry."""
    if rung.resolution >= scene.resolution:
        return  # The solver tells of what is thin on the scene's own grid.
    cell = _cell(rung)
    for i, obstacle in enumerate(scene.obstacles):
        thickness = obstacle.smallest_extent
        if thickness >= cell:
            continue
        finer = (name for name, r_p in table.ratios.items() if r_p > rung.r_p)
        fits = next((one for one in finer if _cell(_settings(scene, one, table)) <= thickness), None)
        other = f"rung {fits!r}" if fits else "MpmSolver(scene), which simulates all particles"
        rest = f", or take {other}" if fits or thickness * scene.resolution >= 1 else ""
        warnings.warn(
            f"obstacles[{i}] ({obstacle.shape}) is {thickness:.3g} m thick, less than a cell of {cell:g} m "
            f"of rung {rung.name!r}, so material may pass through it: make it at least {cell:g} m thick"
            f"{rest}",
            RungWarning,
            stacklevel=4,
        )


def _cell(rung: Rung) -> float:
    """Return the width of a cell [m], rounded up: who makes an obstacle as thick is not told again."""
    return math.ceil(1e4 / rung.resolution) / 1e4
