"""Findings about places: thin solids and bodies, and bodies in each other or in solids."""

from collections.abc import Iterator

import numpy as np
import numpy.typing as npt

from hybridmpm.checking.report import Finding
from hybridmpm.scene import Body, Obstacle, Scene
from hybridmpm.scene.gaps import lost_cells, narrow_gaps, wide_enough
from hybridmpm.scene.scene import ADVISED_LOSS, MIN_CELLS_THICK
from hybridmpm.scene.world import rounded_up

CHOKED = 0.7
"""Share of a flow below which a gap is a finding [-]."""
RIGID_CELLS = 4.0
"""Smallest extent of a rigid body that is no finding [cells]."""
LIGHTEST_CELLS = 0.5
"""Smallest mass of a rigid body that is no finding, in grid cells of the heaviest material."""
_SMALL = 0.01
"""Largest overlap of a body that is no finding, as a share of its volume."""
_SAMPLES = 20_000
"""Largest number of sampled points in a body."""
_ALL_SAMPLES, _FEWEST_SAMPLES = 400_000, 200
"""Sampled points in all bodies, and least number in each of many: they bound the time of a check."""
_FEWEST_ROWS = 4
"""Points along each axis of a body at least: a thin one may lie with its half in another."""

_Points = npt.NDArray[np.float64]


def of_geometry(scene: Scene) -> Iterator[Finding]:
    """Yield the findings about places and shapes of a scene's parts."""
    yield from _rounded_world(scene)
    yield from _thin_obstacles(scene)
    yield from _thin_bodies(scene)
    yield from _crossing_meshes(scene)
    yield from _thin_rigid_bodies(scene)
    yield from _light_rigid_bodies(scene)
    yield from _narrow_gaps(scene)
    yield from _taken(scene)


def _rounded_world(scene: Scene) -> Iterator[Finding]:
    if (text := rounded_up(scene.size, scene.resolution)) is not None:
        advice = "choose a resolution at which the world has whole cells, or leave it so"
        yield Finding(severity="note", field="world.size", problem=text, advice=advice)


def _thin_obstacles(scene: Scene) -> Iterator[Finding]:
    needed = MIN_CELLS_THICK * scene.dx
    for index, obstacle in enumerate(scene.obstacles):
        if obstacle.smallest_extent < needed * (1 - 1e-9):
            yield Finding(
                severity="warning",
                field=f"obstacles[{index}]",
                problem=f"is {obstacle.smallest_extent:.3g} m thick, less than {MIN_CELLS_THICK} cells of "
                f"{scene.dx:.3g} m, so fast material may pass through it",
                advice=f"make it at least {needed:.3g} m thick, or raise the resolution",
            )


def _thin_bodies(scene: Scene) -> Iterator[Finding]:
    for index, body in enumerate(scene.bodies):
        thickness = body.smallest_extent
        if thickness < scene.dx * (1 - 1e-9):
            yield Finding(
                severity="warning",
                field=f"bodies[{index}]",
                problem=f"is {thickness:.3g} m thin, less than one cell of {scene.dx:.3g} m, so its "
                "particles hardly interact",
                advice=f"make it at least {scene.dx:.3g} m thick, or raise the resolution",
            )


def _crossing_meshes(scene: Scene) -> Iterator[Finding]:
    parts: list[tuple[str, Body | Obstacle]]
    parts = [(f"bodies[{index}]", body) for index, body in enumerate(scene.bodies)]
    parts += [(f"obstacles[{index}]", obstacle) for index, obstacle in enumerate(scene.obstacles)]
    for field, part in parts:
        place = part.crossing if part.shape == "mesh" else None
        if place is not None:
            yield Finding(
                severity="warning",
                field=field,
                problem=f"has triangles that cross near ({', '.join(f'{x:.3g}' for x in place)}) m, so that "
                "inside and outside may be wrong there",
                advice="unite its parts to one closed surface in a modelling program",
            )


def _thin_rigid_bodies(scene: Scene) -> Iterator[Finding]:
    for index, body in enumerate(scene.rigid):
        thickness = body.smallest_extent
        if thickness < RIGID_CELLS * scene.dx * (1 - 1e-9):
            yield Finding(
                severity="warning",
                field=f"rigid[{index}]",
                problem=f"is {thickness:.3g} m thin, less than {RIGID_CELLS:g} cells of {scene.dx:.3g} m, so "
                "it floats by some percent too high or too deep",
                advice=f"make it at least {RIGID_CELLS * scene.dx:.3g} m thick, or raise the resolution",
            )


def _light_rigid_bodies(scene: Scene) -> Iterator[Finding]:
    heaviest = max((material.density for material in scene.materials), default=0.0)
    needed = LIGHTEST_CELLS * heaviest * scene.dx**scene.dim
    for index, body in enumerate(scene.rigid):
        if body.mass < needed * (1 - 1e-9):
            yield Finding(
                severity="warning",
                field=f"rigid[{index}]",
                problem=f"weighs {body.mass:.3g} kg, less than {LIGHTEST_CELLS:g} grid cells of the material "
                f"around it, {needed:.3g} kg, so single particles may throw it about",
                advice=f"raise its density to {body.density * needed / body.mass:.3g} kg/m^3, make it "
                "larger, or raise the resolution",
            )


def _narrow_gaps(scene: Scene) -> Iterator[Finding]:
    """Yield a finding about gaps that the scene's grid chokes, with the narrowest of them."""
    is_sand = all(material.kind == "sand" for material in scene.materials)
    found = [gap for gap in narrow_gaps(scene) if gap.flow(scene.resolution, is_sand=is_sand) < CHOKED]
    if found:
        gap, others = found[0], f"; {len(found) - 1} more are narrow" if len(found) > 1 else ""
        lost = lost_cells(scene.transfer_loss, scene.resolution, is_sand=is_sand)
        keep = (
            ""
            if scene.transfer_loss is not None
            else f", or set transfer_loss to {ADVISED_LOSS * scene.resolution / 128:.3g}"
        )
        yield Finding(
            severity="warning",
            field=", ".join(name for name in gap.between if name.startswith("obstacles")),
            problem=f"the gap of {gap.width:.3g} m between {' and '.join(gap.between)} is "
            f"{gap.width * scene.resolution:.2g} cells wide and lets about "
            f"{gap.flow(scene.resolution, is_sand=is_sand):.0%} of a flow through{others}",
            advice=f"make it {wide_enough(CHOKED, scene.resolution, lost=lost):.2g} m wide, raise the "
            f"resolution{keep}",
        )


def _taken(scene: Scene) -> Iterator[Finding]:
    """Yield the findings about bodies that overlap earlier bodies or obstacles."""
    solids = [obstacle.to_native() for obstacle in scene.obstacles]
    bounds = [body.bounds for body in scene.bodies]
    lowers = np.array([lower for lower, _ in bounds]).reshape(-1, scene.dim)
    uppers = np.array([upper for _, upper in bounds]).reshape(-1, scene.dim)
    most = min(_SAMPLES, max(_FEWEST_SAMPLES, _ALL_SAMPLES // max(1, len(bounds))))
    for index, body in enumerate(scene.bodies):
        lower, upper = bounds[index]
        x = _lattice(lower, upper, scene.spacing, most)
        x = x[body.contains(x)]
        if len(x) == 0:
            continue
        meet = (lowers[:index] < upper) & (uppers[:index] > lower)
        for before in np.flatnonzero(meet.all(axis=1)):
            share = float(scene.bodies[before].contains(x).mean())
            if share > _SMALL:
                yield Finding(
                    severity="warning",
                    field=f"bodies[{index}]",
                    problem=f"lies with {share:.0%} of its volume in bodies[{before}], which keeps that part",
                    advice="move one of them, or leave out the part that both have",
                )
        for number, solid in enumerate(solids):
            share = float((solid.signed_distance(x.astype(np.float32)) <= 0).mean())
            if share > _SMALL:
                yield Finding(
                    severity="warning",
                    field=f"bodies[{index}]",
                    problem=f"lies with {share:.0%} of its volume in obstacles[{number}], where no "
                    "particle is put",
                    advice="move one of them, or leave out the part inside",
                )


def _lattice(lower: _Points, upper: _Points, spacing: float, most: int) -> _Points:
    """Return about `most` points (n, D) [m] spread evenly over a box, or fewer: no denser than needed."""
    sides = upper - lower
    apart = max(spacing, float(np.prod(sides) / most) ** (1 / len(sides)))
    counts = np.maximum(_FEWEST_ROWS, np.round(sides / apart).astype(int))
    axes = [a + (np.arange(n) + 0.5) * (b - a) / n for a, b, n in zip(lower, upper, counts, strict=True)]
    return np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, len(sides))
