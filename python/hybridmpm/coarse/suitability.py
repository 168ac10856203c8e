"""Warnings of properties of a scene that a coarse level does not suit."""

import math
from collections.abc import Iterator

import numpy as np

from hybridmpm.coarse.level import (
    FULL,
    CoarseLevel,
    coarse_level,
    fastest_impact,
    filled_share,
    settled_potential,
)
from hybridmpm.coarse.table import CoarseTable, coarse_table
from hybridmpm.scene import Scene
from hybridmpm.scene.gaps import lost_cells, narrow_gaps, wide_enough

SHALLOW = {2: 1.0, 3: 2.0}
"""Depth [cells of the level], by dimension, below which matter at rest loses volume."""
UNEQUAL = 10.0
"""Warn when densities differ by more than this factor."""
SLENDER = 2.0
"""Thickness of an elastic body [cells of the level] below which it folds; other bodies take one cell."""
SMALL_SINK = {2: 5.0, 3: 11.0}
"""Measure of a sink [cells of the level], by dimension, below which it drains less than it should."""
RIGID_CELLS = 4.0
"""Thickness of a rigid body [cells of the level] below which it floats too high or too low."""
CHOKED, CHOKED_SAND = 0.5, 0.75
"""Share of the scene's own flow through a gap below which a level may choke it [-]; sand chokes sooner."""


def coarse_warnings(scene: Scene, level: CoarseLevel, table: CoarseTable | None = None) -> list[str]:
    """Return a sentence for each property of a scene that is outside the bounds of a fitted level.

    Checked are the speed of impacts, obstacles and bodies thinner than a cell of the level's grid or elastic
    bodies thinner than two, rigid bodies thinner than four, gaps between solids, sinks of some cells, the
    depth of matter at rest in cells, boxes that matter fills, ratios of densities above 10, and
    `transfer_loss`. `MpmSolver` warns of each with a `CoarseWarning`.

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
        *_body_warnings(scene, level),
        *_gap_warnings(scene, level),
        *_sink_warnings(scene, level),
        *_depth_warnings(scene, level),
        *_full_warnings(scene, level),
        *_density_warnings(scene, level),
        *_loss_warnings(scene, level),
        *_rigid_warnings(scene, level),
    ]


def _speed_warnings(scene: Scene, level: CoarseLevel) -> Iterator[str]:
    room = scene.walls.lower, scene.walls.upper
    # What falls onto an obstacle that moves is hit by what comes to meet it.
    meetings = (
        fastest_impact(scene, min(one.corners(room), key=lambda place: np.dot(scene.gravity, place)))
        + one.largest_speed(room)
        for one in scene.obstacles
        if one.motion is not None
    )
    speed = max([fastest_impact(scene), *meetings])
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
    if scene.dx <= depth < SHALLOW[scene.dim] / level.resolution:
        yield (
            f"matter settles {depth:.2g} m deep in this scene, where a cell of coarse level {level.name!r} "
            f"is {_cell(level):g} m wide, so at rest its volume may be off by a tenth or more: take a coarse "
            "level of more particles"
        )


def _full_warnings(scene: Scene, level: CoarseLevel) -> Iterator[str]:
    """Warn where matter has no free surface to which it could give way."""
    share = filled_share(scene)
    if share >= FULL and level.resolution < scene.resolution:
        yield (
            f"matter fills {share:.0%} of the box between the walls: coarse level {level.name!r} may let it "
            "be pressed together, and its energy may double, where forces push it as hard as 10 g; "
            "leave a twentieth of the box free, or take MpmSolver(scene), which simulates all particles"
        )


def _body_warnings(scene: Scene, level: CoarseLevel) -> Iterator[str]:
    """Warn of bodies too thin for the level, but not for the scene's own grid."""
    for i, body in enumerate(scene.bodies):
        is_elastic = body.material.kind == "elastic"
        cells = SLENDER if is_elastic else 1.0
        if scene.dx <= body.smallest_extent < cells / level.resolution:
            so = "it folds and moves otherwise" if is_elastic else "it gathers in lumps"
            yield (
                f"bodies[{i}] ({body.material.kind}) is {body.smallest_extent:.3g} m thin, less than "
                f"{cells:g} cell{'s' * is_elastic} of {_cell(level):g} m of coarse level {level.name!r}, so "
                f"{so}: take a coarse level of more particles, or MpmSolver(scene), which simulates all"
            )


def _gap_warnings(scene: Scene, level: CoarseLevel) -> Iterator[str]:
    """Warn of gaps that let through much less on the level's grid than on the scene's own."""
    found = [(gap.flow(level.resolution), gap.flow(scene.resolution), gap) for gap in narrow_gaps(scene)]
    share = CHOKED_SAND if any(one.kind == "sand" for one in scene.materials) else CHOKED
    choked = [one for one in found if one[0] < share * one[1]]
    if choked:
        flow, own, gap = min(choked, key=lambda one: one[0] / one[1])
        others = f", and {len(choked) - 1} more are narrow" if len(choked) > 1 else ""
        lost = lost_cells(scene.transfer_loss, level.resolution)
        wider = wide_enough(share, level.resolution, scene.resolution, lost=lost)
        yield (
            f"the gap of {gap.width:.3g} m between {' and '.join(gap.between)} is "
            f"{gap.width * level.resolution:.2g} cells of coarse level {level.name!r} wide and may let as "
            f"little as {flow / own:.0%} of the scene's flow through{others}: widen it to {wider:.2g} m, or "
            "take a coarse level of more particles"
        )


def _sink_warnings(scene: Scene, level: CoarseLevel) -> Iterator[str]:
    """Warn of sinks of less than some cells of the level, which miss what flows past them."""
    for i, sink in enumerate(scene.sinks):
        cells = sink.measure * level.resolution**scene.dim
        is_flat = sink.smallest_extent < 0.5 / level.resolution
        if level.resolution < scene.resolution and (cells < SMALL_SINK[scene.dim] or is_flat):
            yield (
                f"sinks[{i}] has {cells:.2g} cells of coarse level {level.name!r} and is "
                f"{sink.smallest_extent * level.resolution:.2g} of them thick, so it drains less than it "
                f"should: make it at least {0.5 * _cell(level):g} m thick and "
                f"{SMALL_SINK[scene.dim]:g} cells large, or take a coarse level of more particles"
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


def _loss_warnings(scene: Scene, level: CoarseLevel) -> Iterator[str]:
    if scene.transfer_loss is not None and level.r_p < 1:
        yield (
            f"transfer_loss is given in this scene, but coarse level {level.name!r} was fitted to scenes "
            "without: its error may be larger than the table says; leave it out, or take MpmSolver(scene)"
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


def _rigid_warnings(scene: Scene, level: CoarseLevel) -> Iterator[str]:
    """Warn of rigid bodies of a few cells of the level, which float too high."""
    if level.resolution >= scene.resolution:
        return  # `check` finds those that are thin on the scene's own grid.
    for i, body in enumerate(scene.rigid):
        cells = body.smallest_extent * level.resolution
        if cells < RIGID_CELLS:
            yield (
                f"rigid[{i}] ({body.shape}) is {cells:.2g} cells of coarse level {level.name!r} thick, and "
                f"below {RIGID_CELLS:g} it floats more than 5 % too high or too low: make it at least "
                f"{RIGID_CELLS / level.resolution:.2g} m thick, or take a coarse level of more particles"
            )


def _cell(level: CoarseLevel) -> float:
    """Return the width of a cell [m], rounded up: an obstacle of this thickness raises no warning."""
    return math.ceil(1e4 / level.resolution) / 1e4
