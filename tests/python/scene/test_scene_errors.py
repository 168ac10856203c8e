"""Every bad scene is refused with the path of its field, and so is a file that could mean two things."""

import copy
import json
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from click.testing import CliRunner

from hybridmpm import Ball, Box, ConfigError, MpmSolver, RigidBox, Scene, SceneError, Walls, Water
from hybridmpm.cli import cli
from hybridmpm.data import SceneTemplate
from hybridmpm.scene.plain_data import from_json, from_yaml

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
    ("path", "value", "message"),
    [
        ("dim", 4, "dim: Input should be 2 or 3"),
        ("resolution", 7, "resolution: must be in [8, 4096] cells per metre in this world, got 7"),
        ("resolution", "fine", "resolution: Input should be a valid integer"),
        ("frame_dt", 0, "frame_dt: must be in (0, 0.1] s, got 0"),
        ("frame_dt", NAN, "frame_dt: must be in (0, 0.1] s, got nan"),
        ("gravity", [0, INFINITY], "gravity[1]: must be in [-1000, 1000] m/s^2, got inf"),
        ("gravity", [0, 0, -9.81], "gravity: must have dim = 2 numbers, got 3"),
        ("gravity", 9.81, "gravity: must be a list, got 9.81"),
        ("gravity", [True, 0], "gravity[0]: must be a number, got true"),
        ("max_particles", 100, "bodies: need about 3932 particles, allowed are [1, 100] (max_particles)"),
        ("walls", {"lower": [0.1, 0.1]}, "walls.upper: is required"),
        ("walls", {"lower": [0.1, 0.9], "upper": [0.9, 0.9]}, "walls.upper[1]: … lower[1] = 0.9, got 0.9"),
        ("walls", "sticky", "walls: Walls must be an object with named fields"),
        ("speed", 1, "speed: unknown field"),
        ("bodies", [], "bodies: must have 1 or more items, got 0; only a scene with emitters needs none"),
        ("bodies.0", 5, "bodies[0]: must be a name or an object with named fields, got 5"),
        ("bodies.0.shape", "cone", "bodies[0]: … 'box', 'ball', 'cylinder', 'polygon', 'mesh', got 'cone'"),
        ("bodies.0.color", "red", "bodies[0].color: unknown field"),
        ("bodies.0.velocity", [0, 51], "bodies[0].velocity[1]: must be in [-50, 50] m/s, got 51"),
        ("bodies.0.upper", [0.4, 0.1], "bodies[0].upper[1]: must be above lower[1] = 0.2, got 0.1"),
        ("bodies.0.upper", [0.4, 0.5, 0.5], "bodies[0].upper: must have as many numbers as lower, 2, got 3"),
        (
            "bodies.0.upper",
            [0.4, 0.95],
            "bodies[0]: … inside the walls, (0.1, 0.1) to (0.9, 0.9) m, but spans",
        ),
        ("bodies.0.material", "jam", "bodies[0].material: … got 'jam'"),
        ("bodies.0.material", {}, "bodies[0].material: must name its 'kind'"),
        ("bodies.0.material.density", -1, "bodies[0].material.density: … (0, 100000] kg/m^3, got -1"),
        ("bodies.0.material.max_compression", 0, "bodies[0].material.max_compression: … (0, 0.5], got 0"),
        ("bodies.0.material.tension", 1.1, "bodies[0].material.tension: must be in [0, 1], got 1.1"),
        (
            "bodies.0.material",
            {"kind": "sand", "friction_angle": 90},
            "bodies[0].material.friction_angle: must be in (0, 90) degrees, got 90",
        ),
        (
            "bodies.0.material",
            {"kind": "elastic", "poisson_ratio": 0.5},
            "bodies[0].material.poisson_ratio: must be in (-1, 0.5), got 0.5",
        ),
        ("obstacles.0.radius", 0, "obstacles[0].radius: must be in (0, 4096] m, got 0"),
        ("obstacles.0.contact", "glue", "obstacles[0].contact: … 'sticky', 'slip' or 'separating'"),
        (
            "obstacles.0",
            {"shape": "blob"},
            "obstacles[0]: … 'ball', 'cylinder', 'half_space', 'polygon', 'mesh', got 'blob'",
        ),
        (
            "obstacles.0",
            {"shape": "ball", "center": [0.5, 0.5], "radius": 0.1, "contact": "slip", "friction": 0.1},
            "obstacles[0].friction: is only for separating contact, not slip",
        ),
        (
            "obstacles.0",
            {"shape": "segment", "start": [0.5, 0.5], "end": [0.5, 0.5], "thickness": 0.02},
            "obstacles[0].end: must differ from start",
        ),
        (
            "obstacles.0",
            {"shape": "half_space", "point": [0.5, 0.5], "normal": [0, 0]},
            "obstacles[0].normal: must be at least 1e-6 long",
        ),
        ("rigid", {}, "rigid: must be a list, got {}"),
        ("rigid", ["box"], "rigid[0]: must be an object with named fields, got 'box'"),
        ("rigid", [{"file": "a.svg"}], "rigid[0]: must name its 'shape': Scene.load reads files of shapes"),
        (
            "rigid",
            [{"shape": "hull", "points": [[0.5, 0.5], [0.6, 0.5, 0.4], [0.6, 0.6]]}],
            "rigid[0].points[1]: must have as many numbers as points[0], 2, got 3",
        ),
        (
            "bodies.0",
            {"shape": "polygon", "material": "sand", "vertices": [[0.2, 0.2], [0.6, 0.6], [0.3, 0.3]]},
            "bodies[0].vertices: must enclose an area",
        ),
        (
            "rigid",
            [{"shape": "ball", "center": [0.5, 0.5], "radius": 0.1, "rotation": 1e9}],
            "rigid[0].rotation: must be in [-100, 100] rad, got 1e+09",
        ),
    ],
)
def test_bad_value(path: str, value: object, message: str) -> None:
    """The ellipsis in a message stands for anything."""
    Scene.parse(GOOD)
    with pytest.raises(SceneError) as caught:
        Scene.parse(changed(path, value))
    assert len(caught.value.problems) == 1
    assert re.match(re.escape(message).replace("…", ".*"), str(caught.value))


def test_a_part_in_the_wrong_list_is_named() -> None:
    water = Box(material="water", lower=(0.1, 0.1), upper=(0.4, 0.4))
    crate = RigidBox(lower=(0.5, 0.5), upper=(0.6, 0.6))
    cases: list[tuple[dict[str, Any], str]] = [
        ({"bodies": [crate]}, "bodies[0]: must be a Box, got a RigidBox"),
        ({"bodies": [water], "rigid": [water]}, "rigid[0]: must be a RigidBox, got a Box"),
        ({"bodies": [water], "rigid": crate}, "rigid: must be a list, got a RigidBox: write it within [ ]"),
        ({"bodies": water}, "bodies: must be a list, got a Box: write it within [ ]"),
    ]
    for fields, text in cases:
        with pytest.raises(SceneError) as caught:
            Scene(dim=2, **fields)
        assert str(caught.value) == text
    with pytest.raises(
        SceneError, match=r"'honey', 'oil', 'mud', 'lava', got 'Honny'; did you mean 'honey'\?"
    ):
        Box(material="Honny", lower=(0.1, 0.1), upper=(0.4, 0.4))


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
    with pytest.raises(SceneError, match=r"resolution: must be in \[8, 512\] cells per metre .*, got 513"):
        Scene(dim=3, resolution=513, bodies=(ball,))


def test_constructors_raise_the_same_error_as_parse() -> None:
    with pytest.raises(SceneError, match=r"lower\[0\]: must be in \[0, 4096\] m, got -1"):
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


BODY = "{shape: ball, material: water, center: [0.5, 0.5], radius: 0.1}"
TEXT = f"dim: 2\nresolution: 64\nbodies:\n  - {BODY}\n"
YAML = {
    "a twin at the top": TEXT + "dim: 2\n",
    "in a body": TEXT.replace("radius: 0.1", "radius: 0.1, radius: 0.2"),
    "in a material": TEXT.replace("material: water", "material: {kind: water, tension: 0, tension: 1}"),
    "with other quotes": TEXT + '"dim": 2\n',
    "an octal": TEXT.replace("64", "064"),
    "an eight that is none": TEXT.replace("64", "08"),
    "an octal in a list": TEXT.replace("0.5, 0.5", "0.5, -01"),
    "base 60": TEXT.replace("64", "1:04"),
    "a fraction in base 60": TEXT.replace("0.1}", "1:04.5}"),
}
READERS: dict[str, Callable[[Path], Any]] = {
    "scene": Scene.load,
    "template": SceneTemplate.load,
    "text": lambda path: Scene.from_yaml(path.read_text(encoding="utf-8")),
    "bytes": lambda path: Scene.from_yaml(path.read_bytes()),
}


@pytest.mark.parametrize("reader", READERS)
@pytest.mark.parametrize("fault", YAML)
def test_yaml_that_could_mean_two_things_is_refused(fault: str, reader: str, tmp_path: Path) -> None:
    path = tmp_path / "scene.yaml"
    path.write_text(YAML[fault], encoding="utf-8")
    with pytest.raises(SceneError, match=r"line \d.*(keep one of them|octal|base 60)"):
        READERS[reader](path)


@pytest.mark.parametrize("text", ['{"a": 1, "a": 1}', '{"b": [{"a": {"c": 1, "\\u0063": 2}}]}'])
def test_a_key_stands_once_in_json_too(text: str) -> None:
    for read in (from_json, from_yaml):
        with pytest.raises(ValueError, match="keep one of them"):
            read(text)


def test_what_means_one_thing_is_read() -> None:
    text = "a: &x {p: 0, q: 0.50, r: -0.5, s: 0x40, t: 1_000, u: '064', v: +7}\nb: {<<: *x, p: 10}\n"
    plain = {"p": 0, "q": 0.5, "r": -0.5, "s": 64, "t": 1000, "u": "064", "v": 7}
    assert from_yaml(text) == {"a": plain, "b": plain | {"p": 10}}
    assert from_json('[{"a": 1}, {"a": 1, "b": {"a": 012}}]'.replace("012", "12")) == [
        {"a": 1},
        {"a": 1, "b": {"a": 12}},
    ]


@pytest.mark.parametrize("name", ["scene.yaml", "scene.json"])
def test_a_byte_order_mark_is_skipped(name: str, tmp_path: Path) -> None:
    scene = Scene.from_yaml(TEXT)
    path = tmp_path / name
    text = scene.to_json() if name.endswith("json") else scene.to_yaml()
    path.write_text(text, encoding="utf-8-sig")
    assert Scene.load(path) == scene
    read = Scene.from_json if name.endswith("json") else Scene.from_yaml
    assert read("\ufeff" + text) == scene
    assert len(SceneTemplate.load(path).draw(0).bodies) == 1


@pytest.mark.parametrize(
    ("line", "message"),
    [
        ("name: no", "name: must be text, got false"),
        ("name: 2024-05-01", "name: must be text, got 2024-05-01"),
        ("name: 7", "name: must be text, got 7"),
        ("walls: {lower: [0, 0], upper: [1, 1], contact: off}", "'separating', got false"),
        ("on: 1", "keys must be text"),
        ("name: ~", "name: must be text, got null"),
        ("sinks: [{shape: no}]", "sinks[0]: 'shape' must be one of 'box', 'ball', got false"),
        ("emitters: [{shape: round, material: 2024-05-01}]", "emitters[0].material: must be a name or"),
    ],
)
def test_text_without_quotes_gets_a_hint(line: str, message: str) -> None:
    with pytest.raises(SceneError, match=re.escape(message)) as caught:
        Scene.from_yaml(f"{TEXT}{line}\n")
    assert "quotes" in str(caught.value)


def test_a_file_of_ranges_says_so_and_takes_a_seed(tmp_path: Path) -> None:
    path = tmp_path / "ranges.yaml"
    path.write_text(TEXT.replace("radius: 0.1", "radius: {uniform: [0.05, 0.1]}"), encoding="utf-8")
    with pytest.raises(SceneError, match=r"is a range.*SceneTemplate"):
        Scene.load(path)
    saved = tmp_path / "state"
    for seed in (0, 3):
        options = ["--scene", str(path), "--seed", str(seed), "--frames", "1", "--save", str(saved)]
        result = CliRunner().invoke(cli, ["simulate", *options], catch_exceptions=False)
        assert result.exit_code == 0, result.output
        assert f"has ranges; this is its scene of seed {seed}" in result.stderr
        assert f"scene seed {seed}" in result.stdout
    assert CliRunner().invoke(cli, ["check", str(path), "--seed", "2"]).exit_code == 0


def test_a_sketch_file_has_each_key_once(tmp_path: Path) -> None:
    path = tmp_path / "sketch.json"
    stroke = json.dumps({"points": [[0.2, 0.2], [0.7, 0.6]]})
    path.write_text(f'{{"strokes": [{stroke}], "strokes": [{stroke}]}}', encoding="utf-8")
    result = CliRunner().invoke(cli, ["control", "water_2d", "--sketch", str(path), "--frames", "1"])
    assert isinstance(result.exception, SystemExit | ConfigError)
    assert "keep one of them" in result.output
