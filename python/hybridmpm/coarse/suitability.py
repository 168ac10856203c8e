"""Warnings of properties of a scene that a coarse level does not suit."""

import math
from collections.abc import Iterator

import numpy as np

from hybridmpm.coarse.level import CoarseLevel, coarse_level, fastest_impact, settled_potential
from hybridmpm.coarse.table import CoarseTable, coarse_table
from hybridmpm.scene import Scene

SHALLOW = {2: 1.0, 3: 2.0}
"""Depth [cells of the level], by dimension, below which matter at rest loses volume."""
UNEQUAL = 10.0
"""Warn when densities differ by more than this factor."""


def coarse_warnings(scene: Scene, level: CoarseLevel, table: CoarseTable | None = None) -> list[str]:
    """Return a sentence for each property of a scene that is outside the bounds of a fitted level.

    Checked are the speed of impacts, obstacles thinner than a cell of the level's grid, the depth of matter
    at rest in cells, and ratios of densities above 10. `MpmSolver` warns of each with a `CoarseWarning`.

    Parameters
    ----------
    scene : Scene
    level : CoarseLevel
        Level of this scene, as from `coarse_level`.
    table : CoarseTable, optional
        Fitted levels that advice may name; those of the library if absent.
    """
    known = coarse_table() if table is None else table
    return [
        *_speed_warnings(scene, level),
        *_obstacle_warnings(scene, level, known),
        *_depth_warnings(scene, level),
        *_density_warnings(scene, level),
    ]


def _speed_warnings(scene: Scene, level: CoarseLevel) -> Iterator[str]:
    speed = fastest_impact(scene)
    if level.fastest is not None and speed > level.fastest:
        yield (
            f"this scene may reach {speed:.2g} m/s, but coarse level {level.name!r} was fitted up to "
            f"{level.fastest:.2g} m/s: its error may be larger than the table says; compare it with a coarse "
            "level of more particles, or with MpmSolver(scene, r_p=..., show_all=True), whose constants are "
            "not fitted"
        )


def _depth_warnings(scene: Scene, level: CoarseLevel) -> Iterator[str]:
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


def _obstacle_warnings(scene: Scene, level: CoarseLevel, table: CoarseTable) -> Iterator[str]:
    """Warn of obstacles thinner than a cell of the level, which particles may pass."""
    if level.resolution >= scene.resolution:
        return  # The solver warns of obstacles that are thin on the scene's own grid.
    cell = _cell(level)
    for i, obstacle in enumerate(scene.obstacles):
        thickness = obstacle.smallest_extent
        if thickness >= cell:
            continue
        finer = (name for name, r_p in table.ratios.items() if r_p > level.r_p)
        fits = next((one for one in finer if _cell(coarse_level(scene, one, table)) <= thickness), None)
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
