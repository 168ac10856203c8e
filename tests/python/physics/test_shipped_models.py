"""The models in the package, as they ship: laws that training was meant to teach them."""

import numpy as np
import pytest

from hybridmpm import NeuralPhysics, Scene, physics, scenarios
from hybridmpm.errors import SimulationError
from hybridmpm.physics.manifest import WEIGHTS

MODELS = physics.models()
SERVED = [(name, scenario) for name, entry in MODELS.items() for scenario in entry.scenarios]
CPU_SIZED = [entry for entry in MODELS.values() if entry.parameters < 200_000]


def dim_of(name: str) -> int:
    return scenarios.describe(MODELS[name].scenarios[0]).dim


def scene_with(dim: int, lower: list[float], upper: list[float], kind: str, velocity: list[float]) -> Scene:
    body = {"shape": "box", "lower": lower, "upper": upper, "velocity": velocity, "material": {"kind": kind}}
    resolution = 128 if dim == 2 else 64
    return Scene.parse({"dim": dim, "resolution": resolution, "bodies": [body]})


def mirrored(scene: Scene) -> Scene:
    """Swap left and right of a scene whose walls are at 0.1 and 0.9."""
    plain = scene.model_dump(exclude_none=True)
    for body in plain["bodies"]:
        low, high = body["lower"][0], body["upper"][0]
        body["lower"] = [1.0 - high, *body["lower"][1:]]
        body["upper"] = [1.0 - low, *body["upper"][1:]]
        body["velocity"] = [-body["velocity"][0], *body["velocity"][1:]]
    return Scene.parse(plain)


def test_every_scenario_has_a_model_of_cpu_size() -> None:
    served = {scenario for model in CPU_SIZED for scenario in model.scenarios}
    assert served == set(scenarios.NAMES)


@pytest.mark.parametrize("name", MODELS)
def test_a_block_in_free_fall_accelerates_as_gravity_says(name: str) -> None:
    dim, r_t = dim_of(name), MODELS[name].r_t
    kinds = {
        material.kind for served in MODELS[name].scenarios for material in scenarios.get(served, 0).materials
    }
    for kind in sorted(kinds):
        scene = scene_with(
            dim, [0.4] + [0.6] * (dim - 1), [0.6] + [0.8] * (dim - 1), kind, [0.5] + [0.0] * (dim - 1)
        )
        fall = NeuralPhysics(scene, name)
        fall.advance(5 * r_t)
        steps = 3
        centres = []
        for _ in range(steps + 2):
            centres.append(np.average(fall.positions.astype(float), axis=0, weights=fall.mass))
            fall.advance(r_t)
        dt = r_t * scene.frame_dt
        acceleration = np.diff(centres, n=2, axis=0).mean(axis=0) / dt**2
        assert np.allclose(acceleration, scene.gravity, atol=0.02 * 9.81), (kind, acceleration)


@pytest.mark.parametrize(("name", "scenario"), SERVED)
def test_a_rollout_stays_finite_and_in_the_box(name: str, scenario: str) -> None:
    """Ten times the nine steps of the longest window of training, or an error that says what happened."""
    scene = scenarios.get(scenario, 1_100_007)
    run = NeuralPhysics(scene, name)
    for _ in range(10):
        try:
            run.advance(9 * MODELS[name].r_t)
        except SimulationError as error:
            pytest.fail(f"{name} on {scenario}: {error}")
        assert np.isfinite(run.positions).all()
        assert (run.positions >= np.float32(scene.walls.lower) - 1e-6).all()
        assert (run.positions <= np.float32(scene.walls.upper) + 1e-6).all()


@pytest.mark.parametrize("name", MODELS)
def test_left_and_right_are_alike(name: str) -> None:
    """Trained on mirrored windows, a network is nearly symmetric: centres of mass agree within 2 cm."""
    dim = dim_of(name)
    # In space a slice, for time: left and right are along the first axis.
    lower, upper = [0.15, 0.15, 0.15][:dim], [0.35, 0.4, 0.3][:dim]
    scene = scene_with(dim, lower, upper, "water", [0.5, 0.0, 0.0][:dim])
    one, other = (NeuralPhysics(each, name) for each in (scene, mirrored(scene)))
    for run in (one, other):
        run.advance(100)
    centres = [np.average(run.positions, axis=0, weights=run.mass) for run in (one, other)]
    assert centres[0][0] == pytest.approx(1.0 - centres[1][0], abs=0.02)
    assert centres[0][1:] == pytest.approx(centres[1][1:], abs=0.02)


@pytest.mark.parametrize("name", MODELS)
def test_a_model_knows_where_it_comes_from(name: str) -> None:
    about = physics.NeuralModel.load(name).info
    assert about.spec.scenarios == MODELS[name].scenarios
    assert about.training["command"].startswith("hybridmpm train physics")
    assert {row["scenario"] for row in about.errors} == set(MODELS[name].scenarios)
    assert about.solver_versions == MODELS[name].solver_versions
    versions = ", ".join(map(str, about.solver_versions))
    assert f"| solver | version {versions} |" in (WEIGHTS / f"{name}.md").read_text(encoding="utf-8")
