"""Forces on walls and obstacles: balances of momentum that hold exactly, and closed forms."""

import csv
import pickle
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from hybridmpm import ConfigError, MpmSolver, NeuralPhysics, Scene, Sleep, scenarios
from hybridmpm.probes import Force, Torque, record

G = 9.81
WALLS = ("x_lower", "x_upper", "y_lower", "y_upper")


def pool(resolution: int = 40, **fields: Any) -> Scene:
    """Return water, 0.3 m deep and 0.3 m wide between its walls."""
    body = {"shape": "box", "material": "water", "lower": [0.1, 0.1], "upper": [0.4, 0.4]}
    walls = {"lower": [0.1, 0.1], "upper": [0.4, 0.8]}
    return Scene.parse({"dim": 2, "resolution": resolution, "walls": walls, "bodies": [body]} | fields)


def crowd(dim: int, **fields: Any) -> Scene:
    """Return water, sand and a jelly that fall among obstacles, one of which turns and one moves."""
    rest = [0.4] * (dim - 2)
    wide = [0.7] * (dim - 2)
    bodies = [
        {"shape": "box", "material": "water", "lower": [0.1, 0.1, *rest], "upper": [0.4, 0.5, *wide]},
        {"shape": "box", "material": "sand", "lower": [0.6, 0.1, *rest], "upper": [0.85, 0.4, *wide]},
        {"shape": "ball", "material": "elastic", "center": [0.5, 0.7, *rest], "radius": 0.1},
    ]
    turn = 6.0 if dim == 2 else [0.0, 0.0, 6.0]
    middle = [0.5, 0.2, *rest]
    obstacles = [
        {"shape": "ball", "center": middle, "radius": 0.08, "contact": "sticky"},
        {
            "shape": "box",
            "lower": [0.44, 0.4, *rest],
            "upper": [0.56, 0.5, *wide],
            "motion": {"angular_velocity": turn, "center": [0.5, 0.45, *rest]},
        },
        {
            "shape": "ball",
            "center": [0.3, 0.6, *rest],
            "radius": 0.05,
            "motion": {"velocity": [0.5, -1.0, *[0.0] * (dim - 2)], "period": 0.4},
        },
    ]
    return Scene.parse(
        {"dim": dim, "resolution": 64 if dim == 2 else 20, "bodies": bodies, "obstacles": obstacles} | fields
    )


def momentum(solver: MpmSolver) -> np.ndarray:
    return solver.mass.astype(np.float64) @ solver.velocities.astype(np.float64)


@pytest.mark.parametrize("scene", [crowd(2), crowd(3), scenarios.sand_ramps_2d(7)], ids=["2D", "3D", "sand"])
def test_all_forces_together_are_the_weight_less_the_change_of_momentum(scene: Scene) -> None:
    solver = MpmSolver(scene)
    solver.keep_forces()
    before, impulse = momentum(solver), np.zeros(scene.dim)
    frames = 100
    for _ in range(frames):
        solver.advance()
        impulse += solver.frame_forces()[:, : scene.dim].sum(axis=0) * scene.frame_dt
    time = frames * scene.frame_dt
    weight = solver.mass.sum(dtype=np.float64) * np.array(scene.gravity)
    error = momentum(solver) - before - (weight * time - impulse)
    assert np.abs(error).max() < 1e-5 * np.abs(weight).max() * time
    assert np.abs(impulse).max() > 0.3 * np.abs(weight).max() * time


def test_forces_have_equal_bits_on_any_number_of_threads_and_after_a_restore() -> None:
    one, two, resumed = MpmSolver(crowd(2)), MpmSolver(crowd(2), threads=2), MpmSolver(crowd(2), threads=2)
    for solver in (one, two, resumed):
        solver.keep_forces()
    one.advance(60)
    two.advance(59)
    resumed.restore(two.snapshot())
    assert np.isnan(resumed.frame_forces()).all()
    for solver in (two, resumed):
        solver.advance()
        np.testing.assert_array_equal(one.frame_forces(), solver.frame_forces())
    copied = pickle.loads(pickle.dumps(one))  # noqa: S301 - of this very test
    np.testing.assert_array_equal(one.frame_forces(), copied.frame_forces())


def test_the_floor_of_a_pool_carries_its_weight_and_walls_hold_its_thrust() -> None:
    solver = MpmSolver(pool())
    solver.advance(200)
    weight = float(solver.mass.sum()) * G
    gauges = {
        "floor": Force(wall="y_lower"),
        "wall": Force(wall="x_upper"),
        "foot": Torque(wall="x_upper", about=(0.4, 0.1)),
    }
    series = record(solver, 200, gauges, every=200)
    assert series["floor"][1, 1] == pytest.approx(-weight, rel=0.01)
    assert series["wall"][1] == pytest.approx([1000 * G * 0.3**2 / 2, 0.0], rel=0.05)
    assert series["foot"][1] == pytest.approx(-1000 * G * 0.3**3 / 6, rel=0.1)


@pytest.mark.parametrize(
    ("body", "area", "tolerance"),
    [
        ({"shape": "ball", "center": [0.35, 0.28], "radius": 0.06}, np.pi * 0.06**2, 0.03),
        # Contact acts on lines a cell apart, and leaves out those at an edge: four cells are few for a face.
        ({"shape": "box", "lower": [0.3, 0.225], "upper": [0.4, 0.3]}, 0.0075, 0.1),
    ],
    ids=["ball", "box"],
)
def test_a_held_body_is_lifted_by_the_weight_of_the_water_that_it_displaces(
    body: dict[str, Any], area: float, tolerance: float
) -> None:
    water = {"shape": "box", "material": "water", "lower": [0.1, 0.1], "upper": [0.6, 0.45]}
    walls = {"lower": [0.1, 0.1], "upper": [0.6, 0.8]}
    solver = MpmSolver(pool(walls=walls, bodies=[water], obstacles=[body]))
    solver.advance(400)
    gauges = {"body": Force(obstacle=0), "floor": Force(wall="y_lower")}
    series = record(solver, 800, gauges, every=800)
    lift = float(series["body"][1, 1])
    assert lift == pytest.approx(1000 * G * area, rel=tolerance)
    weight = float(solver.mass.sum()) * G
    assert lift + series["floor"][1, 1] == pytest.approx(-weight, rel=0.002)


def test_a_jet_presses_on_a_plate_with_its_momentum() -> None:
    speed, width = 2.0, 0.08
    emitter = {
        "shape": "rectangle",
        "material": "water",
        "lower": [0.2, 0.5 - width / 2],
        "upper": [0.2, 0.5 + width / 2],
        "velocity": [speed, 0.0],
    }
    drains = [{"shape": "box", "lower": [0.1, low], "upper": [0.95, low + 0.1]} for low in (0.05, 0.85)]
    plate = {"shape": "box", "lower": [0.7, 0.2], "upper": [0.75, 0.8]}
    walls = {"lower": [0.1, 0.05], "upper": [0.95, 0.95]}
    scene = pool(64, gravity=[0.0, 0.0], walls=walls, bodies=[], emitters=[emitter])
    scene = Scene.parse(scene.model_dump(exclude_none=True) | {"sinks": drains, "obstacles": [plate]})
    solver = MpmSolver(scene)
    solver.advance(250)
    force = record(solver, 200, {"plate": Force(obstacle=0)}, every=200)["plate"][1]
    assert force[0] == pytest.approx(1000 * speed**2 * width, rel=0.05)
    assert abs(force[1]) < 0.03 * force[0]


def test_the_gate_of_the_guide_turns_about_its_hinge_as_the_closed_form_says() -> None:
    scene = Scene.load(Path(__file__).parents[3] / "docs" / "examples" / "gate.yaml")
    solver = MpmSolver(scene.model_copy(update={"resolution": 80}))
    solver.advance(200)
    gauges = {"gate": Force(obstacle=0), "hinge": Torque(obstacle=0, about=(0.4, 0.0))}
    series = record(solver, 200, gauges, every=200)
    assert series["gate"][1, 0] == pytest.approx(1000 * G * 0.25**2 / 2, rel=0.02)
    assert series["hinge"][1] == pytest.approx(-1000 * G * 0.25**3 / 6, rel=0.03)


def test_a_record_reads_means_over_the_frames_between_readings(tmp_path: Path) -> None:
    gauges = {"floor": Force(wall="y_lower"), "foot": Torque(wall="y_lower", about=(0.1, 0.1))}
    fine = record(MpmSolver(pool()), 20, gauges)
    coarse = record(MpmSolver(pool()), 20, gauges, every=10)
    assert np.isnan(fine["floor"][0]).all()
    assert np.isnan(coarse["foot"][0])
    np.testing.assert_allclose(coarse["floor"][1], fine["floor"][1:11].mean(axis=0), rtol=1e-12)
    assert fine.units == {"floor": "N", "foot": "N m"}
    coarse.to_csv(tmp_path / "forces.csv")
    with (tmp_path / "forces.csv").open(encoding="utf-8") as file:
        rows = list(csv.reader(file))
    assert rows[0] == ["frame", "time [s]", "floor[0] [N]", "floor[1] [N]", "foot [N m]"]
    assert float(rows[2][3]) == coarse["floor"][1, 1]


def test_torques_have_the_arms_of_the_forces() -> None:
    lower, upper, top = [0.1, 0.1, 0.1], [0.4, 0.8, 0.3], [0.4, 0.4, 0.3]
    body = {"shape": "box", "material": "water", "lower": lower, "upper": top}
    scene = Scene.parse(
        {"dim": 3, "resolution": 20, "walls": {"lower": lower, "upper": upper}, "bodies": [body]}
    )
    gauges = {wall: Force(wall=wall) for wall in (*WALLS, "z_lower", "z_upper")}
    gauges |= {f"{wall} turns": Torque(wall=wall, about=(0.0, 0.0, 0.0)) for wall in gauges}
    gauges["moved"] = Torque(wall="y_lower", about=(0.3, 0.0, 0.2))
    series = record(MpmSolver(scene), 200, gauges, every=200)
    thrust_at = 0.2
    places = {
        "x_lower": (0.1, thrust_at, 0.2),
        "x_upper": (0.4, thrust_at, 0.2),
        "y_lower": (0.25, 0.1, 0.2),
        "z_lower": (0.25, thrust_at, 0.1),
        "z_upper": (0.25, thrust_at, 0.3),
    }
    for wall, place in places.items():
        force, torque = series[wall][1], series[f"{wall} turns"][1]
        np.testing.assert_allclose(torque, np.cross(place, force), atol=0.03 * np.abs(force).max())
    shift = np.cross((0.3, 0.0, 0.2), series["y_lower"][1])
    np.testing.assert_allclose(series["moved"][1], series["y_lower turns"][1] - shift)


@pytest.mark.parametrize(
    ("probe", "message"),
    [
        (Force(), "either an obstacle"),
        (Force(obstacle=0, wall="x_lower"), "either an obstacle"),
        (Force(obstacle=3), r"obstacle must be .*\[0, 2\]"),
        (Force(wall="z_lower"), "wall must be one of x_lower, x_upper, y_lower, y_upper in 2D"),
        (Force(wall="y_lowr"), "did you mean 'y_lower'"),
        (Torque(wall="y_lower", about=(0.1,)), "about must be a point of 2 numbers"),
    ],
)
def test_bad_solids_are_refused_before_anything_moves(probe: Force, message: str) -> None:
    solver = MpmSolver(crowd(2))
    with pytest.raises(ConfigError, match=message):
        record(solver, 1, {"force": probe})
    assert solver.frame == 0


def test_forces_are_refused_where_there_are_none() -> None:
    with pytest.raises(ConfigError, match="no obstacles"):
        MpmSolver(pool()).probe(Force(obstacle=0))
    with pytest.raises(ConfigError, match="read them off an MpmSolver"):
        record(NeuralPhysics(scenarios.water_2d(7), "fluids_2d"), 1, {"floor": Force(wall="y_lower")})
    with pytest.raises(ConfigError, match=r"call keep_forces\(\) before the frames"):
        MpmSolver(pool()).probe(Force(wall="y_lower"))
    with pytest.raises(ConfigError, match="without sleep"):
        MpmSolver(pool(), sleep=Sleep()).keep_forces()


def test_forces_are_summed_from_the_moment_on_when_they_are_wanted() -> None:
    solver = MpmSolver(pool())
    solver.advance(2)
    idle = solver.copy()
    assert len(solver.last_frame.forces) == 0  # type: ignore[union-attr] - frames were simulated
    series = record(solver, 2, {"floor": Force(wall="y_lower")})["floor"]
    assert np.isnan(series[0]).all()
    assert np.isfinite(series[1:]).all()
    idle.advance(2)
    assert idle.snapshot() == solver.snapshot(), "sums change no motion"
    assert solver.copy().frame_forces().tolist() == solver.frame_forces().tolist()
