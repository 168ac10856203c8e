"""Moving obstacles: checks of scenes, and that solver, pictures and snapshots agree on where they are."""

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from hybridmpm import Ball, BallObstacle, BoxObstacle, Motion, MpmSolver, Scene, SceneError, _native
from hybridmpm.export import Style, save
from hybridmpm.recording import record
from hybridmpm.render import view_of

EXAMPLE = Path(__file__).parents[3] / "docs" / "examples" / "wave-maker.yaml"


def scene(motion: Any, dim: int = 2, **obstacle: Any) -> Scene:
    center = (0.3,) * dim
    solid = {"shape": "ball", "center": center, "radius": 0.1} | obstacle | {"motion": motion}
    body = {"shape": "ball", "material": "water", "center": (0.6,) * dim, "radius": 0.05}
    return Scene.parse({"dim": dim, "resolution": 32, "bodies": [body], "obstacles": [solid]})


@pytest.mark.parametrize(
    ("motion", "field", "message"),
    [
        ({}, "", "must have a velocity, an angular_velocity or both"),
        ("fast", "", "Motion must be an object with named fields"),
        ({"angular_velocity": 1}, ".center", "is required with angular_velocity"),
        ({"velocity": [1, 0], "center": [0.5, 0.5]}, ".center", "needs an angular_velocity"),
        ({"angular_velocity": 1, "center": [0, 0, 0]}, ".center", "must have dim = 2 numbers, got 3"),
        ({"angular_velocity": [0, 0, 1], "center": [0, 0]}, ".angular_velocity", "must be one number"),
        (
            {"angular_velocity": 1e4, "center": [0, 0]},
            ".angular_velocity",
            "must be in [-1000, 1000] rad/s, got 10000",
        ),
        ({"velocity": [1, 0], "phase": 0.5}, ".phase", "needs a period"),
        ({"velocity": [1, 0], "period": 1, "phase": 1}, ".phase", "must be in [0, 1), got 1"),
        ({"velocity": [1, 0], "speed": 2}, ".speed", "unknown field"),
    ],
)
def test_bad_motions_are_refused_with_the_path_of_the_field(motion: Any, field: str, message: str) -> None:
    with pytest.raises(SceneError) as caught:
        scene(motion)
    assert len(caught.value.problems) == 1
    path, text = caught.value.problems[0]
    assert path == "obstacles[0].motion" + field
    assert message in text


def test_in_3d_a_rotation_has_an_axis() -> None:
    with pytest.raises(SceneError, match=r"obstacles\[0\].motion.angular_velocity: must be three numbers"):
        scene({"angular_velocity": 1, "center": [0, 0, 0]}, dim=3)
    with pytest.raises(SceneError, match=r"motion.angular_velocity\[2\]: must be in"):
        scene({"angular_velocity": [0, 0, 1e4], "center": [0, 0, 0]}, dim=3)
    solver = MpmSolver(scene({"angular_velocity": [0, 0, 2], "center": [0.5, 0.5, 0.5]}, dim=3))
    solver.advance(2)


def test_the_core_places_solids_by_the_documented_formula() -> None:
    velocity, turn, period, phase, time = np.array([0.3, -0.2]), 3.0, 0.6, 0.2, 0.47
    center = np.array([0.5, 0.4])
    motion = Motion(
        velocity=(0.3, -0.2), angular_velocity=turn, center=(0.5, 0.4), period=period, phase=phase
    )
    solid = BoxObstacle(lower=(0.45, 0.3), upper=(0.6, 0.5), motion=motion).to_native()
    start = 2 * math.pi * phase
    clock = period / (2 * math.pi) * (math.sin(2 * math.pi * time / period + start) - math.sin(start))
    c, s = math.cos(turn * clock), math.sin(turn * clock)
    corner = np.array([[0.6, 0.5]], dtype=np.float32)
    expected = center + velocity * clock + np.array([[c, -s], [s, c]]) @ (corner[0] - center)
    moved = solid.moved(corner, time)
    np.testing.assert_allclose(moved[0], expected, atol=1e-6)
    assert solid.signed_distance(moved, time) == pytest.approx(0, abs=1e-6)
    np.testing.assert_allclose(solid.moved(corner, 0.0), corner, atol=1e-7)
    with pytest.raises(_native.ConfigError, match="angular_velocity needs a center"):
        solid.moving(angular_velocity=[1.0])


def test_too_fast_an_obstacle_is_an_error_that_says_so(tmp_path: Path) -> None:
    racing = scene({"angular_velocity": 1000, "center": [0.6, 0.6]}).model_copy(update={"frame_dt": 0.1})
    with pytest.raises(_native.StepSizeError, match=r"substep of .* is above .* limit of .* \(obstacle\)"):
        MpmSolver(racing, substeps="reference").advance()


def centre_of_change(moving: Scene, time: float) -> tuple[float, float]:
    """Where a picture of 200 pixels differs from that without obstacles: mean column and row."""
    x = np.empty((0, moving.dim), dtype=np.float32)
    types = np.empty(0, dtype=np.uint8)
    bare = moving.model_copy(update={"obstacles": ()})
    with_it = view_of(moving, types, 200).draw(x, x, time).astype(int)
    without = view_of(bare, types, 200).draw(x, x, time).astype(int)
    rows, columns = np.nonzero(np.abs(with_it - without).sum(axis=-1) > 30)
    return float(columns.mean()), float(rows.mean())


def test_flat_pictures_show_obstacles_where_they_are() -> None:
    moving = scene({"velocity": [0.5, 0.25]})
    scale = 200 / 0.848  # walls of 0.8 m and a margin of 3 % on each side
    for time in (0.0, 0.4):
        column, row = centre_of_change(moving, time)
        x, y = 0.1 - 0.024 + (column + 0.5) / scale, 0.9 + 0.024 - (row + 0.5) / scale
        assert (x, y) == pytest.approx((0.3 + 0.5 * time, 0.3 + 0.25 * time), abs=4e-3)


def test_a_moving_obstacle_looks_as_one_at_rest_does() -> None:
    none, types = np.empty((0, 2), dtype=np.float32), np.empty(0, dtype=np.uint8)
    moving = scene({"velocity": [0.5, 0.0]})
    still = scene(None, center=(0.5, 0.3))
    there = view_of(moving, types, 200).draw(none, none, 0.4).astype(int)
    difference = np.abs(there - view_of(still, types, 200).draw(none, none).astype(int))
    # Both smooth the edge, one by finer pixels, the other by the distance.
    assert difference.max() < 40
    assert difference.mean() < 0.2


def test_pictures_in_3d_show_obstacles_where_they_are() -> None:
    moving = scene({"velocity": [0.0, 0.5, 0.0]}, dim=3)
    before, after = centre_of_change(moving, 0.0), centre_of_change(moving, 0.6)
    # Raised by 0.3 m, seen from 2.08 m under 20 degrees through a lens of 238 pixels.
    raised = 0.3 * 238 / 2.08 * math.cos(math.radians(20))
    assert before[1] - after[1] == pytest.approx(raised, rel=0.15)
    assert after[0] == pytest.approx(before[0], abs=6)


def test_exported_pictures_follow_the_recording(tmp_path: Path) -> None:
    """A picture of the last state shows the obstacle at the time of that state."""
    ball = BallObstacle(center=(0.3, 0.6), radius=0.1, motion=Motion(velocity=(0.5, 0.0)))
    drop = Ball(material="sand", center=(0.7, 0.3), radius=0.03)
    solver = MpmSolver(Scene(dim=2, resolution=32, bodies=(drop,), obstacles=(ball,)))
    recording = record(solver, 80, every=40)
    assert recording.time(2) == pytest.approx(0.2)
    from PIL import Image

    save(tmp_path / "s%d.png", recording, Style(width=100))
    for row, name in ((0, "s0.png"), (2, "s80.png")):
        drawn = view_of(solver.scene, recording.types, 100).draw(
            recording.positions[row], recording.velocities[row], 0.0025 * int(recording.frames[row])
        )
        with Image.open(tmp_path / name) as image:
            np.testing.assert_array_equal(np.asarray(image), drawn)


def test_the_example_makes_waves() -> None:
    solver = MpmSolver(Scene.load(EXAMPLE))
    paddle = solver.scene.obstacles[0].to_native()
    level = []
    for _ in range(8):
        solver.advance(50)
        x = solver.positions
        # Nothing gets behind the paddle.
        assert paddle.signed_distance(x, solver.time).min() > -1e-5
        middle = x[(x[:, 0] > 0.4) & (x[:, 0] < 0.45)]
        level.append(float(np.sort(middle[:, 1])[-20:].mean()))
    assert max(level) - min(level) > 0.01
    assert solver.positions[:, 0].min() > 0.1
