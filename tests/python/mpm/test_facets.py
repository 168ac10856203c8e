"""Obstacles of polygons and meshes act as the boxes and balls that they equal."""

from typing import Any

import numpy as np
import pytest

from hybridmpm import MeshObstacle, MpmSolver, PolygonObstacle, Scene, SceneError, check
from hybridmpm.probes import Force, record

TURN_2D: dict[str, Any] = {"angular_velocity": 4.0, "center": [0.7, 0.4]}


def _box(lower: list[float], upper: list[float]) -> dict[str, Any]:
    (a, b), (c, d) = lower, upper
    return {"shape": "polygon", "vertices": [[a, b], [c, b], [c, d], [a, d]]}


def ball(center: list[float], radius: float, rings: int) -> dict[str, Any]:
    """Return a ball of triangles, twice as many around as there are rings."""
    polar, turns = np.linspace(0, np.pi, rings + 1)[1:-1], 2 * rings
    angle = 2 * np.pi * np.arange(turns) / turns
    flat = np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    sides = np.concatenate([np.insert(np.sin(p) * flat, 2, np.cos(p), axis=1) for p in polar])
    vertices = np.concatenate([[[0, 0, 1]], sides, [[0, 0, -1]]]) * radius + center

    def at(ring: int, step: int) -> int:
        return 0 if ring == 0 else min(1 + (ring - 1) * turns + step % turns, len(vertices) - 1)

    last = len(vertices) - 1
    triangles = [[0, at(1, k), at(1, k + 1)] for k in range(turns)]
    triangles += [[last, at(rings - 1, k + 1), at(rings - 1, k)] for k in range(turns)]
    for ring in range(1, rings - 1):
        for k in range(turns):
            a, b, c, d = at(ring, k), at(ring + 1, k), at(ring + 1, k + 1), at(ring, k + 1)
            triangles += [[a, b, c], [a, c, d]]
    return {"shape": "mesh", "vertices": vertices.tolist(), "triangles": triangles}


def _fall(obstacles: list[dict[str, Any]], dim: int, **fields: Any) -> tuple[np.ndarray, np.ndarray]:
    """Return centre of mass and forces on obstacles, in the mean, of water that falls on them."""
    rest = [0.3] * (dim - 2)
    body = {
        "shape": "box",
        "material": "water",
        "lower": [0.3, 0.45, *rest],
        "upper": [0.7, 0.7, *[0.7] * (dim - 2)],
    }
    scene = Scene.parse({"dim": dim, "bodies": [body], "obstacles": obstacles} | fields)
    solver = MpmSolver(scene)
    gauges = {str(k): Force(obstacle=k) for k in range(len(obstacles))}
    series = record(solver, 80, gauges, every=80)
    back = MpmSolver(Scene.from_json(scene.to_json()))
    back.restore(solver.snapshot())
    for one in (solver, back):
        one.advance(1)
    np.testing.assert_array_equal(solver.positions, back.positions)
    return solver.positions.mean(axis=0), np.array([series[name][1] for name in gauges])


@pytest.mark.parametrize("contact", ["separating", "slip", "sticky"])
def test_polygons_at_rest_and_turning_are_the_boxes_that_they_equal(contact: str) -> None:
    places = [([0.35, 0.1], [0.5, 0.3]), ([0.6, 0.37], [0.8, 0.43])]
    still, turning = {"contact": contact}, {"contact": contact, "motion": TURN_2D}
    boxes = [{"shape": "box", "lower": low, "upper": high} for low, high in places]
    polygons = [_box(low, high) for low, high in places]
    of_boxes = _fall([boxes[0] | still, boxes[1] | turning], 2, resolution=64)
    of_polygons = _fall([polygons[0] | still, polygons[1] | turning], 2, resolution=64)
    np.testing.assert_allclose(of_polygons[0], of_boxes[0], atol=0.01)
    largest = np.abs(of_boxes[1]).max()
    np.testing.assert_allclose(of_polygons[1], of_boxes[1], atol=0.05 * largest)


def test_a_mesh_of_a_ball_is_the_ball_at_rest_and_in_motion() -> None:
    center, swing = [0.5, 0.3, 0.5], {"motion": {"velocity": [0.0, 0.5, 0.0], "period": 0.4}}
    mesh = ball(center, 0.15, 16)
    for motion in ({}, swing):
        true = _fall([{"shape": "ball", "center": center, "radius": 0.15} | motion], 3, resolution=24)
        found = _fall([mesh | motion], 3, resolution=24)
        np.testing.assert_allclose(found[0], true[0], atol=0.01)
        np.testing.assert_allclose(found[1], true[1], atol=0.05 * np.abs(true[1]).max())


def test_what_encloses_nothing_or_is_of_another_dimension_is_refused() -> None:
    with pytest.raises(SceneError, match="enclose an area"):
        PolygonObstacle(vertices=[[0.1, 0.1], [0.5, 0.1], [0.3, 0.1]])
    mesh = MeshObstacle.model_validate(ball([0.5, 0.5, 0.5], 0.1, 4))
    with pytest.raises(SceneError, match="open edges"):
        MeshObstacle(vertices=mesh.vertices, triangles=mesh.triangles[1:])
    body = {"shape": "ball", "material": "water", "radius": 0.1}
    for dim, solid in ((2, ball([0.5, 0.5, 0.5], 0.1, 4)), (3, _box([0.2, 0.2], [0.4, 0.4]))):
        bodies = [body | {"center": [0.5] * dim}]
        with pytest.raises(SceneError, match=r"is for dim . only"):
            Scene.parse({"dim": dim, "bodies": bodies, "obstacles": [solid]})


def test_a_mesh_that_crosses_itself_is_a_finding() -> None:
    one, other = ball([0.4, 0.5, 0.5], 0.15, 8), ball([0.6, 0.5, 0.5], 0.15, 8)
    count = len(one["vertices"])
    both = {
        "shape": "mesh",
        "vertices": one["vertices"] + other["vertices"],
        "triangles": one["triangles"] + [[k + count for k in corners] for corners in other["triangles"]],
    }
    water = {"shape": "box", "material": "water", "lower": [0.2, 0.1, 0.2], "upper": [0.4, 0.2, 0.4]}
    scene = Scene.parse(
        {"dim": 3, "resolution": 12, "bodies": [water, both | {"material": "sand"}], "obstacles": [one]}
    )
    found = [finding for finding in check(scene).findings if "cross" in finding.problem]
    assert [finding.field for finding in found] == ["bodies[1]"]
