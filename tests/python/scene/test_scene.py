"""Scenes as data: defaults, files, schema, and the law behind `max_compression`."""

import json
from pathlib import Path

import pytest

from hybridmpm import (
    Ball,
    BallObstacle,
    Box,
    BoxSink,
    Cylinder,
    CylinderObstacle,
    ExportError,
    Motion,
    MpmSolver,
    Polygon,
    RoundEmitter,
    Scene,
    SceneError,
    SegmentObstacle,
    Walls,
    Water,
)

BOX_2D = Box(material="water", lower=(0.2, 0.2), upper=(0.4, 0.5))
BOX_3D = Box(material="sand", lower=(0.2, 0.2, 0.2), upper=(0.4, 0.5, 0.3))
DEEP = Scene(
    dim=3,
    bodies=(Cylinder(material="sand", start=(0.5, 0.2, 0.5), end=(0.5, 0.4, 0.5), radius=0.1),),
    obstacles=(
        CylinderObstacle(
            start=(0.5, 0.1, 0.3),
            end=(0.5, 0.2, 0.3),
            radius=0.07,
            motion=Motion(angular_velocity=(0.0, 1.0, 2.0), center=(0.4, 0.4, 0.4)),
        ),
    ),
)
RICH = Scene(
    name="everything",
    dim=2,
    resolution=96,
    frame_dt=0.002,
    gravity=(0.5, -9.0),
    walls=Walls(lower=(0.05, 0.1), upper=(0.95, 0.9), contact="sticky"),
    bodies=(
        Box(material=Water(max_compression=0.01), lower=(0.2, 0.2), upper=(0.4, 0.5), velocity=(1.0, -1e-05)),
        Ball(material="sand", center=(0.6, 0.6), radius=0.1, seed=7),
        Polygon(material="elastic", vertices=((0.5, 0.2), (0.7, 0.2), (0.6, 0.4))),
    ),
    obstacles=(
        SegmentObstacle(start=(0.3, 0.15), end=(0.6, 0.12), thickness=0.02, friction=0.3),
        BallObstacle(
            center=(0.8, 0.5), radius=0.05, motion=Motion(velocity=(0.1, 0.1), period=0.5, phase=0.75)
        ),
    ),
    emitters=(RoundEmitter(material="water", center=(0.3, 0.8), radius=0.04, velocity=(0.0, -2.0)),),
    sinks=(BoxSink(lower=(0.1, 0.1), upper=(0.9, 0.15)),),
    frames=10,
)


def test_defaults_follow_the_dimension() -> None:
    flat, deep = Scene(dim=2, bodies=(BOX_2D,)), Scene(dim=3, bodies=(BOX_3D,))
    assert (flat.resolution, flat.particles_per_cell, flat.gravity) == (128, 4, (0.0, -9.81))
    assert (deep.resolution, deep.particles_per_cell, deep.gravity) == (64, 8, (0.0, -9.81, 0.0))
    assert flat.walls == Walls(lower=(0.1, 0.1), upper=(0.9, 0.9))
    assert deep.walls.upper == (0.9, 0.9, 0.9)
    assert flat.spacing == pytest.approx(1 / 256)
    assert deep.spacing == pytest.approx(1 / 128)


@pytest.mark.parametrize("scene", [RICH, DEEP])
def test_json_and_yaml_give_an_equal_scene_back(scene: Scene) -> None:
    assert Scene.from_json(scene.to_json()) == scene
    assert Scene.from_yaml(scene.to_yaml()) == scene
    assert Scene.from_yaml(scene.to_json()) == scene  # JSON is YAML


@pytest.mark.parametrize("name", ["scene.json", "scene.yaml", "scene.YML"])
def test_files_by_suffix(tmp_path: Path, name: str) -> None:
    RICH.save(tmp_path / name)
    assert Scene.load(tmp_path / name) == RICH
    assert [file.name for file in tmp_path.iterdir()] == [name]


def test_files_that_cannot_be(tmp_path: Path) -> None:
    with pytest.raises(SceneError, match=r"\.json, \.yaml or \.yml, got 'scene\.txt'"):
        RICH.save(tmp_path / "scene.txt")
    with pytest.raises(ExportError, match="cannot write"):
        RICH.save(tmp_path / "nowhere" / "scene.json")


def test_material_name_stands_for_the_reference_material() -> None:
    named = Scene.parse(
        {
            "dim": 2,
            "bodies": [{"shape": "box", "material": "water", "lower": [0.2, 0.2], "upper": [0.4, 0.5]}],
        }
    )
    assert named == Scene(dim=2, bodies=(BOX_2D,))
    assert named.bodies[0].material == Water(density=1000, tension=0.25, wall_friction=0)


def test_distinct_materials_in_order_of_use() -> None:
    soft = Water(bulk_modulus=1e4)
    bodies = [BOX_2D.model_copy(update={"material": material}) for material in (soft, Water(), soft)]
    assert Scene(dim=2, bodies=tuple(bodies)).materials == (soft, Water())


def test_schema_describes_the_fields_and_refuses_others() -> None:
    schema = Scene.json_schema()
    json.dumps(schema)
    assert schema["required"] == ["dim", "bodies"]
    assert schema["additionalProperties"] is False
    length = schema["$defs"]["World"]["properties"]["size"]["items"]
    assert (length["exclusiveMinimum"], length["maximum"]) == (0, 4096)
    density = schema["$defs"]["Water"]["properties"]["density"]
    assert (density["exclusiveMinimum"], density["maximum"], density["default"]) == (0, 1e5, 1000.0)


@pytest.mark.parametrize("gravity", [(0.0, -9.81), (4.0, 0.0), (3.0, -4.0)])
def test_max_compression_bounds_the_pressure_law(gravity: tuple[float, float]) -> None:
    """At the foot of the highest possible column p = rho g h, and p = lambda (1 - J) gives J = 1 - c."""
    water = Water(density=800.0, max_compression=0.02)
    scene = Scene(dim=2, gravity=gravity, bodies=(BOX_2D.model_copy(update={"material": water}),))
    # The farthest corner of the box (0.2, 0.2)-(0.4, 0.5) above the farthest corner of the walls 0.1-0.9.
    g_h = {(0.0, -9.81): 9.81 * 0.4, (4.0, 0.0): 4.0 * 0.7, (3.0, -4.0): 3.0 * 0.7 + 4.0 * 0.4}[gravity]
    pressure = 800.0 * g_h
    assert pressure / water.stiffness(scene.potential_drop) == pytest.approx(0.02)


def test_stiffness_without_a_compression() -> None:
    assert Water().stiffness(3.0) == 277_778
    assert Water(bulk_modulus=5e4).stiffness(3.0) == 5e4


def test_only_water_counts_for_the_depth() -> None:
    sand = Box(material="sand", lower=(0.2, 0.6), upper=(0.4, 0.9))
    assert Scene(dim=2, bodies=(sand,)).potential_drop == 0
    assert Scene(dim=2, bodies=(sand, BOX_2D)).potential_drop == pytest.approx(9.81 * 0.4)


def test_stiffness_reaches_the_solver() -> None:
    """Stiffer water needs more substeps: c is proportional to the square root of lambda."""
    counts = []
    for compression in (0.04, 0.01):
        water = Water(max_compression=compression)
        solver = MpmSolver(Scene(dim=2, bodies=(BOX_2D.model_copy(update={"material": water}),)))
        solver.advance()
        counts.append(solver.last_frame.substeps)
    assert counts[0] < counts[1] <= 2 * counts[0] + 1
