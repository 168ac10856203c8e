"""Emitters and sinks that cannot be are refused, and the message names the field."""

from typing import Any

import numpy as np
import pytest

from hybridmpm import (
    BoxObstacle,
    ConfigError,
    MpmSolver,
    RectangularEmitter,
    Scene,
    SceneError,
    _native,
)

JET = RectangularEmitter(material="water", lower=(0.48, 0.85), upper=(0.56, 0.85), velocity=(0.0, -1.5))


def scene(*emitters: Any, **fields: Any) -> Scene:
    return Scene(**{"dim": 2, "resolution": 64, "bodies": (), "emitters": emitters} | fields)


ROUND = {"shape": "round", "material": "water", "center": [0.5, 0.5], "radius": 0.05, "velocity": [1, 0]}
FLAT = {
    "shape": "rectangle",
    "material": "water",
    "lower": [0.4, 0.5],
    "upper": [0.6, 0.5],
    "velocity": [0, 1],
}


@pytest.mark.parametrize(
    ("emitter", "field", "message"),
    [
        (ROUND | {"velocity": [0, 0]}, ".velocity", "must not be zero"),
        (ROUND | {"velocity": [60, 0]}, ".velocity[0]", "must be in [-50, 50] m/s, got 60"),
        (ROUND | {"velocity": [1, 0, 0]}, ".velocity", "must have dim = 2 numbers, got 3"),
        (ROUND | {"radius": 0}, ".radius", "must be in (0, 1] m, got 0"),
        (ROUND | {"start": 1, "stop": 0.5}, ".stop", "must be above start = 1, got 0.5"),
        (ROUND | {"center": [0.88, 0.5], "velocity": [20, 0]}, "", "must lie inside the walls"),
        (FLAT | {"velocity": [1, 1]}, ".velocity", "must be along one axis"),
        (FLAT | {"lower": [0.4, 0.5, 0.5]}, ".lower", "must have as many numbers as upper and velocity"),
        (FLAT | {"velocity": [1, 0]}, ".upper[0]", "must be equal to lower[0] = 0.4"),
        (
            FLAT | {"upper": [0.6, 0.6]},
            ".upper[1]",
            "must be equal to lower[1] = 0.5, because velocity[1] is 1",
        ),
        (FLAT | {"upper": [0.4, 0.5]}, ".upper[0]", "must be above lower[0] = 0.4"),
        (FLAT | {"lower": [0.4]}, ".lower", "must have 2 or more items, got 1"),
        (FLAT | {"rate": 2}, ".rate", "unknown field"),
    ],
)
def test_bad_emitters_are_refused_with_the_path_of_the_field(
    emitter: dict[str, Any], field: str, message: str
) -> None:
    with pytest.raises(SceneError) as caught:
        Scene.parse({"dim": 2, "bodies": [], "emitters": [emitter]})
    where, text = caught.value.problems[0]
    assert where == f"emitters[0]{field}"
    assert message in text


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"material": 3}, r"emitters\[0\]\.material must be an index into materials, got 3"),
        ({"velocity": [0.0, 0.0]}, r"velocity must be finite and not zero"),
        ({"spacing": 0.0}, r"spacing must be finite and > 0"),
        ({"start": 2.0, "stop": 1.0}, r"start must be >= 0 s and before stop"),
        (
            {"sites": np.full((1, 2), 0.95, np.float32)},
            r"sites must be an opening whose material stays inside",
        ),
        ({"sites": np.zeros((0, 2), np.float32), "jitter": np.zeros((1, 0, 2), np.float32)}, "one or more"),
        ({"velocity": [1.0, 0.0, 0.0]}, r"sites must have a shape that ends in \[3\]"),
        ({"jitter": np.zeros((4, 2, 2), np.float32)}, r"jitter must have a shape that ends in \[1, 2\]"),
        ({"sites": [0.5, 0.5]}, r"sites must be float32 of shape \(n, D\)"),
    ],
)
def test_the_core_checks_emitters_of_its_own_users(change: dict[str, Any], message: str) -> None:
    emitter: dict[str, Any] = {
        "material": 0,
        "velocity": [0.0, -1.0],
        "spacing": 0.01,
        "sites": np.full((1, 2), 0.5, dtype=np.float32),
        "jitter": np.zeros((2, 1, 2), dtype=np.float32),
        "mass": 0.1,
        "volume": 1e-4,
    }
    nobody = np.zeros(0, dtype=np.float32)
    with pytest.raises(ConfigError, match=message):
        _native.Solver(
            resolution=32,
            frame_dt=0.0025,
            gravity=[0.0, -9.81],
            wall_lower=[0.1, 0.1],
            wall_upper=[0.9, 0.9],
            materials=[_native.Material.water(density=1000.0, bulk_modulus=1e5)],
            emitters=[_native.Emitter(**emitter | change)],
            x=nobody.reshape(0, 2),
            v=nobody.reshape(0, 2),
            material=nobody.astype(np.uint8),
            mass=nobody,
            volume=nobody,
        )


def test_bad_sinks_and_scenes_without_anything_are_refused() -> None:
    sink = {"shape": "box", "lower": [0.1, 0.1], "upper": [0.1, 0.2]}
    with pytest.raises(SceneError, match=r"sinks\[0\]\.upper\[0\]: must be above lower\[0\]"):
        Scene.parse({"dim": 2, "bodies": [], "emitters": [ROUND], "sinks": [sink]})
    ball = {"shape": "ball", "center": [0.5, 0.5, 0.5], "radius": 0.1}
    with pytest.raises(SceneError, match=r"sinks\[0\]\.center: must have dim = 2 numbers, got 3"):
        Scene.parse({"dim": 2, "bodies": [], "emitters": [ROUND], "sinks": [ball]})
    with pytest.raises(
        SceneError, match="bodies: must have 1 or more items, got 0; only a scene with emitters needs none"
    ):
        Scene.parse({"dim": 2, "bodies": []})


def test_an_obstacle_at_rest_before_the_opening_is_refused() -> None:
    lid = BoxObstacle(lower=(0.45, 0.8), upper=(0.55, 0.848))
    with pytest.raises(SceneError, match=r"emitters\[0\]: must open into free space, but obstacles\[0\]"):
        MpmSolver(scene(JET, obstacles=(lid,)))
