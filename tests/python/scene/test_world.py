"""Worlds of any size: their scenes, grids, particles and simulations."""

import json
import warnings
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from hybridmpm import (
    ConfigError,
    HybridSimulator,
    MpmSolver,
    NeuralPhysics,
    RoundedWorldWarning,
    Scene,
    SceneError,
    World,
    check,
    control,
    load,
    metrics,
    probes,
    scenarios,
)
from hybridmpm.coarse.splines import Stencils
from hybridmpm.scenarios.trained_on import TrainedOn

TANK = (1.61, 0.6)


def dam(size: tuple[float, ...] = TANK, resolution: int = 50, **fields: Any) -> Scene:
    """Return a column of water behind a dam that is gone, at the left end of a world."""
    upper = [0.4 * size[0], 0.5 * size[1], *size[2:]]
    body = {"shape": "box", "material": "water", "lower": [0.0] * len(size), "upper": upper}
    scene = {"dim": len(size), "world": {"size": size}, "resolution": resolution, "bodies": [body]}
    return Scene.parse(scene | fields)


def test_a_world_has_cubic_cells_and_walls_at_its_faces(tmp_path: Path) -> None:
    scene = dam()
    assert (scene.size, scene.cells, scene.dx) == (TANK, (81, 30), 0.02)
    assert (scene.walls.lower, scene.walls.upper) == ((0.0, 0.0), TANK)
    for name in ("scene.json", "scene.yaml"):
        scene.save(tmp_path / name)
        assert Scene.load(tmp_path / name) == scene
    assert json.loads(scene.to_json())["world"] == {"size": [1.61, 0.6]}


def test_scenes_of_one_metre_are_as_before() -> None:
    ball = {"shape": "ball", "material": "water", "center": [0.5, 0.5], "radius": 0.1}
    said = dam((1.0, 1.0), bodies=[ball])
    assert said.world is None
    assert "world" not in said.to_json()
    assert said.cells == (50, 50)
    assert said == Scene.parse({"dim": 2, "resolution": 50, "bodies": [ball]})


@pytest.mark.parametrize(
    ("fields", "message"),
    [
        ({"world": {"size": [1.6]}}, r"world\.size: must have 2 or more items"),
        ({"world": {"size": [1.6, 0.6, 1.0]}}, r"world\.size: must have dim = 2 numbers, got 3"),
        ({"world": {"size": [0.0, 0.6]}}, r"world\.size\[0\]: must be in \(0, 4096\] m, got 0"),
        ({"world": {"size": [float("nan"), 0.6]}}, r"world\.size\[0\]: must be in"),
        (
            {"world": {"size": [50.0, 50.0]}, "resolution": 100},
            r"resolution: must be in \[1, 81\] cells per metre",
        ),
        ({"world": {"size": [2.0, 0.1]}, "resolution": 50}, r"resolution: must be in \[71, 2048\] .* got 50"),
        ({"world": {"size": [4000.0, 1.0]}}, r"world\.size: is too long for its width: 4000 x 1 m"),
        ({"walls": {"lower": [0, 0], "upper": [1.7, 0.6]}}, r"walls\.upper\[0\]: must be in \[0, 1\.61\] m"),
        (
            {"obstacles": [{"shape": "ball", "center": [1.0, 0.7], "radius": 0.1}]},
            r"center\[1\]: .*\[0, 0\.6\] m",
        ),
        (
            {"obstacles": [{"shape": "ball", "center": [1.0, 0.5], "radius": 2}]},
            r"radius: must be in \(0, 1\.61\] m",
        ),
    ],
)
def test_what_does_not_fit_is_refused_with_its_range(fields: dict[str, Any], message: str) -> None:
    with pytest.raises(SceneError, match=message):
        dam(**fields)


def test_sizes_between_cells_are_rounded_up_and_said() -> None:
    with pytest.warns(RoundedWorldWarning, match=r"81 cells, 1\.62 m, for 1\.61 m along x"):
        solver = MpmSolver(dam())
    found = [one for one in check(dam()).findings if one.field == "world.size"]
    assert [one.severity for one in found] == ["note"]
    solver.advance(150)
    assert 1.4 < solver.positions[:, 0].max() <= np.float32(1.61)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        MpmSolver(dam((1.6, 0.6)))


def test_the_same_matter_moves_alike_in_a_world_that_is_longer() -> None:
    walls = {"lower": [0.1, 0.1], "upper": [0.9, 0.9]}
    ball = {"shape": "ball", "center": [0.3, 0.4], "radius": 0.02}
    body = {"shape": "box", "material": "water", "lower": [0.1, 0.1], "upper": [0.25, 0.5]}
    small = Scene.parse({"dim": 2, "resolution": 64, "walls": walls, "bodies": [body], "obstacles": [ball]})
    large = Scene.parse(json.loads(small.to_json()) | {"world": {"size": [3.0, 1.5]}})
    one, two = MpmSolver(small), MpmSolver(large, threads=2)
    for solver in (one, two):
        solver.keep_forces()
        solver.advance(60)
    np.testing.assert_array_equal(one.positions, two.positions)
    np.testing.assert_array_equal(one.frame_forces(), two.frame_forces())


def test_a_world_far_from_the_origin_moves_as_one_near_it() -> None:
    """The same column in the last corner of a long world, mirrored: float32 has fewer digits there."""
    size = (8.0, 0.5)
    body = {"shape": "box", "material": "water", "lower": [7.6, 0.0], "upper": [8.0, 0.3]}
    far = MpmSolver(dam(size, 64, bodies=[body]))
    near = MpmSolver(dam(size, 64, bodies=[body | {"lower": [0.0, 0.0], "upper": [0.4, 0.3]}]))
    far.advance(80)
    near.advance(80)
    assert 8.0 - far.positions[:, 0].min() == pytest.approx(near.positions[:, 0].max(), abs=0.03)
    assert far.diagnostics().centroid[1] == pytest.approx(near.diagnostics().centroid[1], abs=0.002)


def test_a_box_of_space_is_no_cube_by_need(tmp_path: Path) -> None:
    scene = dam((0.8, 0.3, 0.2), 40)
    assert scene.cells == (32, 12, 8)
    solver = MpmSolver(scene, threads=2)
    solver.advance(80)
    assert solver.positions[:, 0].max() > 0.5
    solver.save(tmp_path / "state.npz")
    again = load(tmp_path / "state.npz")
    for one in (solver, again):
        one.advance(5)
    np.testing.assert_array_equal(solver.positions, again.positions)
    mass = solver.diagnostics().mass
    force = probes.record(solver, 200, {"floor": probes.Force(wall="y_lower")}, every=200)["floor"][1]
    assert force[1] == pytest.approx(-9.81 * mass, rel=0.1)


def test_probes_and_measures_speak_metres_of_the_world() -> None:
    solver = MpmSolver(dam((2.0, 0.6)))
    solver.advance(200)
    gauges = {
        "level": probes.HeightGauge(1.5),
        "end": probes.Pressure((1.99, 0.0)),
        "flow": probes.Flow((1.2, 0.0), (1.2, 0.6)),
    }
    series = probes.record(solver, 100, gauges)
    assert series["level"].max() > 0.02
    assert series["flow"].max() > 1.0
    with pytest.raises(ConfigError, match=r"inside the walls, \(0, 0\) to \(2, 0\.6\)"):
        solver.probe(probes.HeightGauge(2.5))
    scene = solver.scene
    grid = metrics.grid_mass(solver.positions, solver.mass, scene.resolution, scene.cells)
    assert grid.shape == (101, 31)
    assert grid.sum() == pytest.approx(solver.mass.sum(), rel=1e-5)
    stencils = Stencils.at(solver.positions, scene.resolution, scene.cells)
    np.testing.assert_allclose(stencils.scatter(solver.mass.astype(float)), grid, rtol=1e-3, atol=1e-3)
    with pytest.raises(ConfigError, match="x must be in"):
        metrics.density_extremes(solver.positions, solver.mass, scene.resolution)
    low, high = metrics.density_extremes(solver.positions, solver.mass, scene.resolution, scene.cells)
    assert 0 < low < 1000 < high < 1500


def test_coarse_levels_show_all_particles_of_a_world() -> None:
    scene = dam((2.0, 0.625), 96)
    solver = MpmSolver(scene, coarse="1/16")
    solver.advance(200)
    reference = MpmSolver(scene, r_p=0.25)
    reference.advance(200)
    assert solver.positions[:, 0].max() > 1.5
    shown, simulated = solver.positions.mean(axis=0), reference.positions.mean(axis=0)
    np.testing.assert_allclose(shown, simulated, atol=0.03)


def test_small_tanks_have_fine_cells() -> None:
    scene = dam((0.15, 0.1), 400)
    assert scene.cells == (60, 40)
    solver = MpmSolver(scene)
    solver.advance(40)
    assert solver.positions[:, 0].max() > 0.1
    assert MpmSolver(scene, r_p=0.25).resolution == 282


def test_networks_refuse_worlds_that_they_were_not_trained_for() -> None:
    scene = scenarios.water_2d(7)
    large = Scene.parse(json.loads(scene.to_json()) | {"world": World(size=(2.0, 1.0)).model_dump()})
    for simulator in (NeuralPhysics, HybridSimulator):
        with pytest.raises(
            ConfigError, match="a world of one metre along each axis; that of the scene has 2 x 1 m"
        ):
            simulator(large, "fluids_2d")


def test_what_is_for_one_metre_refuses_other_worlds() -> None:
    with pytest.raises(ConfigError, match="trained in a world of one metre"):
        TrainedOn.of([dam((2.0, 0.6))])
    with pytest.raises(ConfigError, match="reversed cases are for worlds of one metre"):
        control.reversed_case(dam((2.0, 0.6)), control_frame=10, frames=5)


def test_moving_obstacles_reach_all_of_a_world() -> None:
    piston = {
        "shape": "box",
        "lower": [0.0, 0.0],
        "upper": [0.1, 0.6],
        "motion": {"velocity": [2.0, 0.0], "period": 2.0},
    }
    body = {"shape": "box", "material": "water", "lower": [0.1, 0.0], "upper": [3.0, 0.2]}
    solver = MpmSolver(dam((3.0, 0.625), 32, bodies=[body], obstacles=[piston]))
    solver.advance(300)
    piston_front = 0.1 + 2 / np.pi * np.sin(np.pi * 0.75) * 1.0
    # A few drops may fall behind it.
    assert np.percentile(solver.positions[:, 0], 1) == pytest.approx(piston_front, abs=0.06)
