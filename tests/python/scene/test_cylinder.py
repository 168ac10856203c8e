"""Cylinders in 3D: as bodies that become particles, and as obstacles."""

import math

import numpy as np
import pytest

from hybridmpm import Box, Cylinder, CylinderObstacle, Motion, MpmSolver, Scene, SceneError, metrics


@pytest.mark.parametrize(
    ("start", "end"), [((0.5, 0.1, 0.5), (0.5, 0.4, 0.5)), ((0.3, 0.3, 0.4), (0.6, 0.5, 0.6))]
)
def test_a_body_is_filled_to_its_volume(start: tuple[float, ...], end: tuple[float, ...]) -> None:
    body = Cylinder(material="sand", start=start, end=end, radius=0.1)
    scene = Scene(dim=3, bodies=(body,))
    length = math.dist(start, end)
    assert body.measure == pytest.approx(math.pi * 0.01 * length)
    x = scene.sample().x
    assert len(x) * scene.spacing**3 == pytest.approx(body.measure, rel=0.02)
    lower, upper = body.bounds
    assert (x > lower).all()
    assert (x < upper).all()
    along = (np.array(end) - start) / length
    away = (x - start) - ((x - start) @ along)[:, None] * along
    assert np.linalg.norm(away, axis=1).max() == pytest.approx(0.1, abs=scene.spacing)
    # The bounding box is tight: slightly larger cylinders reach out of it.
    assert (lower - (np.minimum(start, end) - 0.1)).min() >= -1e-12


def test_both_are_for_space_alone() -> None:
    flat = {"material": "water", "start": (0.3, 0.3), "end": (0.5, 0.3), "radius": 0.05}
    with pytest.raises(
        SceneError, match=r"bodies\[0\].shape: cylinder is for dim 3 only; dim 2 allows box, ball"
    ):
        Scene(dim=2, bodies=(Cylinder(**flat),))
    post = CylinderObstacle(start=(0.3, 0.3), end=(0.5, 0.3), radius=0.05)
    water = Box(material="water", lower=(0.2, 0.5), upper=(0.4, 0.6))
    with pytest.raises(SceneError, match=r"obstacles\[0\].shape: cylinder is for dim 3 only"):
        Scene(dim=2, bodies=(water,), obstacles=(post,))
    with pytest.raises(SceneError, match="end: must differ from start"):
        CylinderObstacle(start=(0.3, 0.3, 0.3), end=(0.3, 0.3, 0.3), radius=0.05)


@pytest.mark.parametrize("turns", [False, True])
def test_nothing_enters_a_post(*, turns: bool) -> None:
    motion = Motion(angular_velocity=(0.0, 0.0, 4.0), center=(0.5, 0.25, 0.5)) if turns else None
    post = CylinderObstacle(start=(0.35, 0.25, 0.5), end=(0.65, 0.25, 0.5), radius=0.07, motion=motion)
    water = Box(material="water", lower=(0.4, 0.4, 0.4), upper=(0.6, 0.55, 0.6), velocity=(0, -2, 0))
    scene = Scene(dim=3, resolution=40, bodies=(water,), obstacles=(post,))
    solver = MpmSolver(scene)
    path = solver.rollout(80)
    assert metrics.penetration_count(scene, path, tolerance=1e-4).max() == 0
    assert path[-1][:, 1].min() < 0.2
    assert "<ellipse" in scene._repr_html_()


def test_json_and_thickness() -> None:
    post = CylinderObstacle(start=(0.5, 0.1, 0.5), end=(0.5, 0.105, 0.5), radius=0.07)
    body = Cylinder(material="sand", start=(0.5, 0.2, 0.5), end=(0.5, 0.4, 0.5), radius=0.1)
    scene = Scene(dim=3, bodies=(body,), obstacles=(post,))
    assert Scene.from_json(scene.to_json()) == scene
    assert "0.005 m thick" in scene.thin_obstacles()[0]
