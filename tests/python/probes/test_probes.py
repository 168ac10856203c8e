"""Probes read what is known otherwise: closed forms, the rate of an emitter, what a sink has left."""

import csv
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from hybridmpm import (
    ConfigError,
    HybridSimulator,
    MpmSolver,
    NeuralPhysics,
    Scene,
    Simulator,
    probes,
    scenarios,
)
from hybridmpm.probes import (
    Density,
    FillLevel,
    Flow,
    HeightGauge,
    PatchDensity,
    PatchPressure,
    Pressure,
    Probe,
    Submerged,
    record,
)

G = 9.81


def pool(dim: int = 2, **fields: Any) -> Scene:
    """Return water at rest, 0.3 m deep, that fills the walls across; particles fit into it exactly."""
    upper, top = [0.4] * dim, [0.4] * dim
    upper[1], top[1] = 0.8, 0.4
    body = {"shape": "box", "material": "water", "lower": [0.1] * dim, "upper": top}
    return Scene.parse(
        {
            "dim": dim,
            "resolution": 40 if dim == 2 else 20,
            "walls": {"lower": [0.1] * dim, "upper": upper},
            "bodies": [body],
            **fields,
        }
    )


def spout(dim: int = 2, **fields: Any) -> Scene:
    """Return water that flows along x without gravity at 1 m/s."""
    lower, upper = ([0.1, 0.4], [0.1, 0.6]) if dim == 2 else ([0.1, 0.4, 0.4], [0.1, 0.6, 0.6])
    velocity = [1.0] + [0.0] * (dim - 1)
    emitter = {
        "shape": "rectangle",
        "material": "water",
        "lower": lower,
        "upper": upper,
        "velocity": velocity,
    }
    base = {"dim": dim, "resolution": 48 if dim == 2 else 24, "bodies": [], "gravity": [0.0] * dim}
    return Scene.parse(base | {"emitters": [emitter]} | fields)


@pytest.fixture(scope="module")
def settled() -> probes.TimeSeries:
    """Return readings of a pool after its first waves, over half a second."""
    solver = MpmSolver(pool())
    solver.advance(600)
    points = [[0.25, 0.1], [0.25, 0.2], [0.25, 0.3], [0.1, 0.2], [0.25, 0.6]]
    return record(
        solver,
        200,
        {
            "pressure": Pressure(points),
            "density": Density(points),
            "patch pressure": PatchPressure([0.15, 0.15], [0.35, 0.25]),
            "patch density": PatchDensity([0.15, 0.15], [0.35, 0.25]),
            "height": HeightGauge(0.25),
            "corner": HeightGauge(0.1),
            "filling": FillLevel([0.1, 0.1], [0.4, 0.4]),
            "upper half": FillLevel([0.1, 0.4], [0.4, 0.8]),
        },
        every=5,
    )


def test_pressure_and_density_of_a_pool_are_those_of_its_depth(settled: probes.TimeSeries) -> None:
    depth = 0.4 - np.array([0.1, 0.2, 0.3, 0.2])
    pressure, density = settled["pressure"].mean(axis=0), settled["density"].mean(axis=0)
    # On the floor, at the wall and in the bulk, within some percent of the pressure on the floor.
    np.testing.assert_allclose(pressure[:4], 1000 * G * depth, atol=0.1 * 1000 * G * 0.3)
    np.testing.assert_allclose(density[:4], 1000, rtol=0.06)
    assert pressure[4] == density[4] == 0
    assert settled["patch pressure"].mean() == pytest.approx(1000 * G * 0.2, rel=0.06)
    assert settled["patch density"].mean() == pytest.approx(1000, rel=0.03)


SLOPE = {"shape": "half_space", "point": [0.183, 0.1], "normal": [-math.sin(0.5), math.cos(0.5)]}
BLOCK = {"shape": "box", "lower": [0.28, 0.05], "upper": [0.4, 0.2625]}
GATE = {"shape": "box", "lower": [0.345, 0.05], "upper": [0.37, 0.7]}
BESIDE: list[tuple[Any, Any, float]] = [
    (SLOPE, [[0.183 + y / math.tan(0.5), 0.1 + y] for y in (0.05, 0.1, 0.15)], 0.5),
    (BLOCK, [[0.28, 0.13], [0.28, 0.19], [0.4, 0.13], [0.31, 0.2625], [0.36, 0.2625]], 0.5),
    (GATE, [[0.345, 0.13], [0.34, 0.2], [0.34, 0.25]], 0.245),
]


@pytest.mark.parametrize(("obstacle", "points", "wide"), BESIDE)
def test_pressure_at_an_obstacle_is_that_of_its_depth(obstacle: Any, points: Any, wide: float) -> None:
    walls = {"lower": [0.1, 0.1], "upper": [0.6, 0.6]}
    water = {"shape": "box", "material": "water", "lower": [0.1, 0.1], "upper": [0.1 + wide, 0.4]}
    solver = MpmSolver(pool(walls=walls, bodies=[water], obstacles=[obstacle], resolution=64))
    solver.advance(600)
    found = record(solver, 200, {"at": Pressure([*points, [0.1, 0.42], [0.37, 0.3]])}, every=5)["at"]
    at, above, behind = np.split(found.mean(axis=0), [-2, -1])
    np.testing.assert_allclose(at, 1000 * G * (0.4 - np.array(points)[:, 1]), rtol=0.07)
    assert abs(above) < 60
    assert obstacle is not GATE or behind == 0


def test_height_and_filling_of_a_pool_are_those_at_rest(settled: probes.TimeSeries) -> None:
    for name in ("height", "corner"):
        assert settled[name].mean() == pytest.approx(0.3, abs=0.01)
    assert settled["filling"].mean() == pytest.approx(1.0, abs=0.02)
    assert settled["upper half"].mean() < 0.01


def test_a_dam_has_the_height_it_was_built_with_everywhere_and_on_obstacles() -> None:
    body = {"shape": "box", "material": "water", "lower": [0.1, 0.3], "upper": [0.5, 0.55]}
    step = {"shape": "box", "lower": [0.05, 0.05], "upper": [0.5, 0.3]}
    for gravity, expected in (([0, -G], 0.45), ([0, G], 0.6)):
        made = Scene.parse(
            {"dim": 2, "resolution": 40, "bodies": [body], "obstacles": [step], "gravity": gravity}
        )
        solver = MpmSolver(made)
        for x in (0.1, 0.2, 0.31, 0.45):
            assert float(solver.probe(HeightGauge(x))) == pytest.approx(expected, abs=0.003)
        assert float(solver.probe(HeightGauge(0.6))) == 0
    deep = MpmSolver(pool(3))
    assert float(deep.probe(HeightGauge([0.2, 0.3]))) == pytest.approx(0.3, abs=0.01)
    full = {"shape": "box", "material": "water", "lower": [0.1, 0.1], "upper": [0.4, 0.4]}
    walls = {"lower": [0.1, 0.1], "upper": [0.4, 0.4]}
    brimming = MpmSolver(Scene.parse({"dim": 2, "resolution": 40, "bodies": [full], "walls": walls}))
    assert float(brimming.probe(HeightGauge(0.2))) == pytest.approx(0.3, abs=0.003)


@pytest.mark.parametrize("dim", [2, 3])
def test_a_body_is_submerged_up_to_the_surface(dim: int) -> None:
    wide = {"world": {"size": [1.0] * dim}, "walls": {"lower": [0.1] * dim, "upper": [0.9] * dim}}
    water = {"shape": "box", "material": "water", "lower": [0.1] * dim, "upper": [0.9, 0.35, 0.9][:dim]}

    def share(**body: Any) -> float:
        made = Scene.parse({"dim": dim, "resolution": 32, "bodies": [water], "rigid": [body], **wide})
        return float(MpmSolver(made).probe(Submerged(0)))

    for lower, expected in ((0.32, 0.15), (0.29, 0.3), (0.25, 0.5), (0.19, 0.8), (0.12, 1.0), (0.4, 0.0)):
        top = [0.6, lower + 0.2, 0.6][:dim]
        read = share(shape="box", lower=[0.4, lower, 0.4][:dim], upper=top)
        assert read == pytest.approx(expected, abs=0.006), lower
    # A ball, down to a depth of 0.7 radii.
    part = (math.acos(0.3) - 0.3 * math.sqrt(1 - 0.3**2)) / math.pi if dim == 2 else 0.7**2 * (3 - 0.7) / 4
    ball = share(shape="ball", center=[0.5, 0.38, 0.5][:dim], radius=0.1)
    assert ball == pytest.approx(part, abs=0.006)
    # On its corner, up to the middle.
    box = {"shape": "box", "lower": [0.4, 0.25], "upper": [0.6, 0.45], "rotation": math.pi / 4}
    flat = {"shape": "box", "material": "water", "lower": [0.1, 0.1], "upper": [0.9, 0.35]}
    tilted = Scene.parse({"dim": 2, "resolution": 32, "bodies": [flat], "rigid": [box]})
    assert float(MpmSolver(tilted).probe(Submerged(0))) == pytest.approx(0.5, abs=0.01)
    # No room beside it.
    walls = {"lower": [0.3, 0.1], "upper": [0.7, 0.9]}
    filled = flat | {"lower": [0.3, 0.1], "upper": [0.7, 0.3]}
    narrow = Scene.parse({"dim": 2, "resolution": 32, "bodies": [filled], "rigid": [box], "walls": walls})
    assert np.isnan(MpmSolver(narrow).probe(Submerged(0)))


@pytest.mark.parametrize("dim", [2, 3])
def test_flow_is_the_rate_of_the_emitter(dim: int) -> None:
    scene = spout(dim)
    emitter = scene.emitters[0]
    rate = emitter.measure * emitter.speed * 1000
    through = {
        2: {
            "all": (Flow([0.3, 0.3], [0.3, 0.7]), 1.0),
            "back": (Flow([0.3, 0.7], [0.3, 0.3]), -1.0),
            "slant": (Flow([0.2, 0.3], [0.4, 0.7]), 1.0),
            "half": (Flow([0.3, 0.5], [0.3, 0.8]), 0.5),
            "beside": (Flow([0.3, 0.7], [0.3, 0.8]), 0.0),
            "along": (Flow([0.15, 0.5], [0.3, 0.5]), 0.0),
        },
        3: {
            "all": (Flow([0.25, 0.3, 0.3], [0.25, 0.7, 0.7]), 1.0),
            "quarter": (Flow([0.25, 0.5, 0.5], [0.25, 0.7, 0.7]), 0.25),
        },
    }[dim]
    found = record(MpmSolver(scene), 140, {name: one for name, (one, _) in through.items()}, every=2)
    for name, (_, part) in through.items():
        assert found[name][-20:].mean() == pytest.approx(part * rate, abs=0.03 * rate), name


def test_an_emptying_tank_loses_what_the_sink_takes() -> None:
    scene = pool(sinks=[{"shape": "box", "lower": [0.1, 0.1], "upper": [0.16, 0.13]}])
    solver = MpmSolver(scene)
    level = FillLevel([0.1, 0.1], [0.4, 0.8])
    before, mass = float(solver.probe(level)), solver.diagnostics().mass
    found = record(solver, 120, {"level": level}, every=20)["level"]
    assert (np.diff(found) < 0).all()
    assert found[-1] / before == pytest.approx(solver.diagnostics().mass / mass, rel=1e-3)
    assert found[-1] < 0.8 * before


def test_obstacles_take_no_part() -> None:
    block = {"shape": "box", "lower": [0.2, 0.05], "upper": [0.3, 0.25]}
    solver = MpmSolver(pool(obstacles=[block]))
    for at in ([0.2, 0.2], [0.15, 0.25], [0.25, 0.25]):
        assert float(solver.probe(Density(at))) == pytest.approx(1000, rel=0.1), at
    assert np.isnan(solver.probe(Density([0.25, 0.12])))
    assert float(solver.probe(FillLevel([0.1, 0.1], [0.4, 0.4]))) == pytest.approx(1.0, abs=0.02)
    assert float(solver.probe(PatchDensity([0.15, 0.15], [0.35, 0.35]))) == pytest.approx(1000, rel=0.02)
    assert np.isnan(solver.probe(FillLevel([0.21, 0.11], [0.29, 0.2])))


def test_a_turning_obstacle_is_where_it_is_now() -> None:
    motion = {"velocity": [0.2, 0.0]}
    paddle = {"shape": "box", "lower": [0.15, 0.5], "upper": [0.2, 0.7], "motion": motion}
    solver = MpmSolver(pool(obstacles=[paddle]))
    at = FillLevel([0.151, 0.51], [0.174, 0.69])
    assert np.isnan(solver.probe(at))
    solver.advance(60)
    assert float(solver.probe(at)) == 0


def simulators() -> dict[str, Simulator]:
    scene = scenarios.water_2d(7)
    return {
        "mpm": MpmSolver(scene),
        "few": MpmSolver(scene, r_p=0.25),
        "carried": MpmSolver(scene, coarse="1/16"),
        "network": NeuralPhysics(scene, "fluids_2d"),
        "hybrid": HybridSimulator(scene, "fluids_2d"),
    }


def test_every_simulator_can_be_probed_and_pressure_is_for_mpm() -> None:
    made = simulators()
    body = scenarios.water_2d(7).bodies[0]
    lower, upper = body.bounds
    middle = (lower + upper) / 2
    for name, solver in made.items():
        solver.advance(3)
        assert float(solver.probe(Density(middle))) == pytest.approx(1000, rel=0.1), name
        assert float(solver.probe(HeightGauge(middle[0]))) > 0
        before = solver.snapshot()
        if name in {"network", "hybrid"}:
            with pytest.raises(ConfigError, match=r"a simulator of kind '.*' has no pressure"):
                solver.probe(Pressure(middle))
        else:
            assert np.isfinite(solver.probe(Pressure(middle)))
        assert solver.snapshot() == before


def test_pressure_of_the_core_is_that_of_the_equation_of_state() -> None:
    solver = MpmSolver(pool())
    solver.advance(40)
    ratio = solver.volume_ratio
    expected = 277_778 * np.where(ratio > 1, 0.25, 1.0) * (1 - ratio)
    np.testing.assert_allclose(solver.pressure, expected, rtol=1e-3, atol=1.0)
    sand = {"shape": "box", "material": "sand", "lower": [0.1, 0.1], "upper": [0.4, 0.3]}
    heap = MpmSolver(pool(bodies=[sand]))
    heap.advance(300)
    found = float(heap.probe(PatchPressure([0.2, 0.11], [0.3, 0.15])))
    # The mean of the stresses of sand is below the vertical one, whose share rests on the walls.
    assert 0.3 * 1600 * G * 0.17 < found < 1.05 * 1600 * G * 0.17


@pytest.mark.parametrize(
    ("probe", "words"),
    [
        (
            Density([0.05, 0.2]),
            r"points must lie inside the walls, \(0\.1, 0\.1\) to \(0\.4, 0\.8\) m, got \(0\.05",
        ),
        (Pressure([0.2, 0.2, 0.2]), "one point of 2 numbers, or K of them"),
        (Pressure("here"), "points must be numbers: could not convert string to float: 'here'"),
        (PatchDensity([0.1, 0.1], [0.5, 0.2]), "upper must lie inside the walls"),
        (PatchPressure([0.3, 0.2], [0.2, 0.3]), "upper must be above lower along each axis"),
        (HeightGauge(0.9), "place must lie inside the walls"),
        (Submerged(0), "body 0 does not exist: the scene has no rigid bodies"),
        (HeightGauge([0.2, 0.2]), "place must be the 1 coordinates across gravity in 2D"),
        (Flow([0.2, 0.2], [0.2, 0.2]), "end must differ from start"),
    ],
)
def test_what_does_not_fit_into_the_scene_is_refused(probe: Probe, words: str) -> None:
    solver = MpmSolver(pool())
    with pytest.raises(ConfigError, match=words):
        solver.probe(probe)
    with pytest.raises(ConfigError, match=words):
        record(solver, 5, {"one": probe})
    assert solver.frame == 0


def test_other_mistakes_say_what_to_write() -> None:
    solver, deep = MpmSolver(pool()), MpmSolver(pool(3))
    with pytest.raises(
        ConfigError, match=r"this takes a probe, such as probes\.Density\(\(0\.5, 0\.2\)\); got a tuple"
    ):
        solver.probe((0.2, 0.2))  # type: ignore[arg-type]
    with pytest.raises(ConfigError, match="a mapping of names to probes"):
        record(solver, 1, HeightGauge(0.2))  # type: ignore[arg-type]
    with pytest.raises(ConfigError, match=r"every must be .*\[1, 1000000\]"):
        record(solver, 1, {"a": HeightGauge(0.2)}, every=0)
    with pytest.raises(ConfigError, match="must be equal along one axis of the three"):
        deep.probe(Flow([0.2, 0.2, 0.2], [0.3, 0.3, 0.3]))
    with pytest.raises(ConfigError, match="needs gravity along one axis"):
        MpmSolver(pool(gravity=[1.0, -9.0])).probe(HeightGauge(0.2))
    with pytest.raises(ConfigError, match="has no pressure"):
        record(simulators()["network"], 1, {"p": Pressure([0.5, 0.5])})


def test_a_series_has_its_times_and_becomes_a_table(tmp_path: Path) -> None:
    solver = MpmSolver(pool())
    solver.advance(3)
    found = record(
        solver,
        7,
        {"h": HeightGauge(0.2), "rho": Density([[0.2, 0.2], [0.3, 0.2]])},
        every=3,
        force=[0.5, 0.0],
    )
    assert found.frame.tolist() == [3, 6, 9, 10]
    np.testing.assert_allclose(found.time, found.frame * 0.0025)
    assert found["h"].shape == (4,)
    assert found["rho"].shape == (4, 2)
    assert repr(found) == "TimeSeries(h [m], rho [kg/m^3]; 4 readings from 0.0075 to 0.025 s)"
    found.to_csv(tmp_path / "series.csv")
    with (tmp_path / "series.csv").open(encoding="utf-8", newline="") as file:
        head, *rows = list(csv.reader(file))
    assert head == ["frame", "time [s]", "h [m]", "rho[0] [kg/m^3]", "rho[1] [kg/m^3]"]
    assert [float(row[4]) for row in rows] == found["rho"][:, 1].tolist()
    # Looking changes nothing.
    other = MpmSolver(pool())
    other.advance(3)
    other.advance(7, [0.5, 0.0])
    assert np.array_equal(other.positions, solver.positions)
