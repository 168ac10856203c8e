"""Every bad scene is refused with the path of its field and what is allowed."""

import copy
import json
from typing import Any

import pytest

from hybridmpm import Ball, Box, MpmSolver, Scene, SceneError, Walls, Water

NAN, INFINITY = float("nan"), float("inf")
GOOD: dict[str, Any] = {
    "dim": 2,
    "bodies": [{"shape": "box", "material": {"kind": "water"}, "lower": [0.2, 0.2], "upper": [0.4, 0.5]}],
    "obstacles": [{"shape": "ball", "center": [0.6, 0.3], "radius": 0.05}],
}


def changed(path: str, value: object) -> dict[str, Any]:
    """Return GOOD with one value replaced or added, e.g. at "bodies.0.material.density"."""
    scene = copy.deepcopy(GOOD)
    *parents, last = [int(part) if part.isdigit() else part for part in path.split(".")]
    place: Any = scene
    for part in parents:
        place = place[part]
    place[last] = value
    return scene


@pytest.mark.parametrize(
    ("path", "value", "field", "message"),
    [
        ("dim", 4, "dim", "2 or 3"),
        ("resolution", 7, "resolution", r"must be in \[8, 1024\] cells, got 7"),
        ("resolution", "fine", "resolution", "valid integer"),
        ("frame_dt", 0, "frame_dt", r"must be in \(0, 0.1\] s, got 0"),
        ("frame_dt", NAN, "frame_dt", r"must be in \(0, 0.1\] s, got nan"),
        ("frames", 0, "frames", r"must be in \[1, 1000000\], got 0"),
        ("gravity", [0, INFINITY], "gravity[1]", r"must be in \[-1000, 1000\] m/s\^2, got inf"),
        ("gravity", [0, 0, -9.81], "gravity", "dim = 2 numbers, got 3"),
        ("gravity", 9.81, "gravity", "valid tuple"),
        ("gravity", [True, 0], "gravity[0]", "must be a number, got true"),
        ("frame_dt", False, "frame_dt", "must be a number, got false"),
        ("particles_per_cell", 65, "particles_per_cell", r"must be in \[1, 64\], got 65"),
        ("max_particles", 100, "bodies", r"about 3932 particles, allowed are \[1, 100\] \(max_particles\)"),
        ("walls", {"lower": [0.1, 0.1]}, "walls.upper", "is required"),
        ("walls", {"lower": [0.1, 0.9], "upper": [0.9, 0.9]}, "walls.upper[1]", r"above lower\[1\] = 0.9"),
        (
            "walls",
            {"lower": [-0.1, 0], "upper": [1, 1]},
            "walls.lower[0]",
            r"must be in \[0, 1\] m, got -0.1",
        ),
        ("walls", "sticky", "walls", "Walls must be an object with named fields"),
        ("speed", 1, "speed", "unknown field"),
        ("bodies", [], "bodies", "must have 1 or more items, got 0"),
        ("bodies.0", 5, "bodies[0]", "valid dictionary"),
        (
            "bodies.0.shape",
            "cone",
            "bodies[0]",
            "'shape' must be one of 'box', 'ball', 'cylinder', 'polygon', got 'cone'",
        ),
        ("bodies.0.color", "red", "bodies[0].color", "unknown field"),
        ("bodies.0.seed", -1, "bodies[0].seed", r"must be in \[0, 9007199254740991\], got -1"),
        ("bodies.0.velocity", [0, 51], "bodies[0].velocity[1]", r"must be in \[-50, 50\] m/s, got 51"),
        ("bodies.0.velocity", [0, 0, 0], "bodies[0].velocity", "dim = 2 numbers, got 3"),
        ("bodies.0.upper", [0.4, 0.1], "bodies[0].upper[1]", r"above lower\[1\] = 0.2, got 0.1"),
        ("bodies.0.upper", [0.4, 0.5, 0.5], "bodies[0].upper", "as many numbers as lower, 2, got 3"),
        (
            "bodies.0.upper",
            [0.4, 0.95],
            "bodies[0]",
            r"inside the walls, \(0.1, 0.1\) to \(0.9, 0.9\) m, but spans",
        ),
        ("bodies.0.upper", [0.4, 1.5], "bodies[0].upper[1]", r"must be in \[0, 1\] m, got 1.5"),
        ("bodies.0.material", "lava", "bodies[0].material", "'water', 'sand', 'elastic', got 'lava'"),
        ("bodies.0.material", {}, "bodies[0].material", "must name its 'kind'"),
        ("bodies.0.material.density", -1, "bodies[0].material.density", r"\(0, 100000\] kg/m\^3, got -1"),
        ("bodies.0.material.density", NAN, "bodies[0].material.density", r"\(0, 100000\] kg/m\^3, got nan"),
        ("bodies.0.material.density", "heavy", "bodies[0].material.density", "valid number"),
        ("bodies.0.material.bulk_modulus", 0, "bodies[0].material.bulk_modulus", r"\(0, 1e\+12\] Pa"),
        ("bodies.0.material.max_compression", 0, "bodies[0].material.max_compression", r"\(0, 0.5\], got 0"),
        (
            "bodies.0.material.max_compression",
            0.6,
            "bodies[0].material.max_compression",
            r"\(0, 0.5\], got 0.6",
        ),
        ("bodies.0.material.tension", 1.1, "bodies[0].material.tension", r"must be in \[0, 1\], got 1.1"),
        ("bodies.0.material.viscosity", 1, "bodies[0].material.viscosity", "unknown field"),
        (
            "bodies.0.material",
            {"kind": "sand", "friction_angle": 90},
            "bodies[0].material.friction_angle",
            r"\(0, 90\) degrees",
        ),
        (
            "bodies.0.material",
            {"kind": "elastic", "poisson_ratio": 0.5},
            "bodies[0].material.poisson_ratio",
            r"\(-1, 0.5\)",
        ),
        ("obstacles.0.radius", 0, "obstacles[0].radius", r"must be in \(0, 1\] m, got 0"),
        ("obstacles.0.center", [0.5], "obstacles[0].center", "must have 2 or more items, got 1"),
        ("obstacles.0.center", [0.5, 0.5, 0.5], "obstacles[0].center", "dim = 2 numbers, got 3"),
        ("obstacles.0.contact", "glue", "obstacles[0].contact", "'sticky', 'slip' or 'separating'"),
        ("obstacles.0.friction", -0.1, "obstacles[0].friction", r"must be in \[0, 10\], got -0.1"),
        (
            "obstacles.0",
            {"shape": "blob"},
            "obstacles[0]",
            "'segment', 'box', 'ball', 'cylinder', 'half_space', got 'blob'",
        ),
        (
            "obstacles.0",
            {"shape": "ball", "center": [0.5, 0.5], "radius": 0.1, "contact": "slip", "friction": 0.1},
            "obstacles[0].friction",
            "only for separating contact, not slip",
        ),
        (
            "obstacles.0",
            {"shape": "segment", "start": [0.5, 0.5], "end": [0.5, 0.5], "thickness": 0.02},
            "obstacles[0].end",
            "must differ from start",
        ),
        (
            "obstacles.0",
            {"shape": "half_space", "point": [0.5, 0.5], "normal": [0, 0]},
            "obstacles[0].normal",
            "at least 1e-6 long",
        ),
    ],
)
def test_bad_value(path: str, value: object, field: str, message: str) -> None:
    Scene.parse(GOOD)
    with pytest.raises(SceneError, match=message) as caught:
        Scene.parse(changed(path, value))
    assert [where for where, _ in caught.value.problems] == [field]
    assert str(caught.value).startswith(f"{field}: ")


def test_all_faults_are_listed() -> None:
    scene = changed("bodies.0.material.density", -1)
    scene["frames"] = 0
    with pytest.raises(SceneError) as caught:
        Scene.parse(scene)
    assert [field for field, _ in caught.value.problems] == ["bodies[0].material.density", "frames"]


def test_two_stiffnesses_are_one_too_many() -> None:
    with pytest.raises(SceneError, match="bulk_modulus or max_compression, not both"):
        Water(bulk_modulus=1e5, max_compression=0.01)


def test_walls_are_four_cells_apart() -> None:
    narrow = {"lower": [0.1, 0.2], "upper": [0.9, 0.23]}
    with pytest.raises(SceneError, match=r"walls: must be at least 4 cells, 0\.03125 m, apart along axis 1"):
        Scene.parse(GOOD | {"walls": narrow})


@pytest.mark.parametrize("resolution", [40, 48, 100])
def test_a_slot_of_exactly_four_cells_is_no_fault_of_rounding(resolution: int) -> None:
    slots = [Walls(lower=(low, 0.1), upper=(low + 4 / resolution, 0.9)) for low in (0.1, 0.3, 0.7)]
    for walls in slots:
        across = (walls.lower[0], walls.upper[0])
        body = Box(material=Water(), lower=(across[0], 0.1), upper=(across[1], 0.3))
        solver = MpmSolver(Scene(dim=2, resolution=resolution, walls=walls, bodies=(body,)))
        solver.advance(2)
        assert solver.frame == 2


def test_max_compression_needs_gravity() -> None:
    scene = changed("bodies.0.material.max_compression", 0.01)
    with pytest.raises(SceneError, match=r"bodies\[0\]\.material\.max_compression: needs gravity"):
        Scene.parse(scene | {"gravity": [0, 0]})


def test_polygons_and_fine_grids_are_for_2d() -> None:
    triangle = {
        "shape": "polygon",
        "material": "water",
        "vertices": [[0.2, 0.2, 0.2], [0.4, 0.2, 0.2], [0.3, 0.4, 0.2]],
    }
    with pytest.raises(SceneError, match=r"bodies\[0\]\.shape: polygon is for dim 2 only"):
        Scene.parse({"dim": 3, "bodies": [triangle]})
    ball = Ball(material="water", center=(0.5, 0.5, 0.5), radius=0.01)
    with pytest.raises(SceneError, match=r"resolution: must be in \[8, 512\] for dim 3, got 513"):
        Scene(dim=3, resolution=513, bodies=(ball,))


def test_constructors_raise_the_same_error_as_parse() -> None:
    with pytest.raises(SceneError, match=r"lower\[0\]: must be in \[0, 1\] m, got -1"):
        Box(material="water", lower=(-1, 0), upper=(1, 1))
    with pytest.raises(SceneError, match="bodies: is required"):
        Scene(dim=2)  # type: ignore[call-arg]


@pytest.mark.parametrize("data", [None, 5, "water_2d", [], b"x"])
def test_not_an_object(data: object) -> None:
    with pytest.raises(SceneError, match="Scene must be an object with named fields"):
        Scene.parse(data)


@pytest.mark.parametrize("text", ["", "{", "[1", '{"dim": 2,}', b"\xff\xfe", "[" * 100_000])
def test_not_json(text: str | bytes) -> None:
    with pytest.raises(SceneError, match="the scene is not JSON"):
        Scene.from_json(text)


@pytest.mark.parametrize(
    "text",
    [
        "{",
        "a: b: c",
        "!!python/object:os.system {}",
        b"\xff\xfa",
        "\x00",
        "name: 2024-13-45",
        "dim: !!bool maybe",
        "dim: !!int two",
        "dim: !!timestamp today",
        f"dim: {'9' * 5000}",
        "[" * 100_000,
    ],
)
def test_not_yaml(text: str | bytes) -> None:
    with pytest.raises(SceneError, match="the scene is not YAML"):
        Scene.from_yaml(text)


def test_json_may_not_smuggle_in_nan() -> None:
    with pytest.raises(SceneError, match=r"frame_dt: must be in \(0, 0\.1\] s, got nan"):
        Scene.from_json(json.dumps(changed("frame_dt", NAN)))
