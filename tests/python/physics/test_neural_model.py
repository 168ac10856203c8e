"""`NeuralModel`: symmetries of a step, files and scenes that it refuses, and the models that ship."""

import json
import subprocess
import sys
import threading
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import onnx
import pytest
from tests.python.physics.conftest import random_inputs

from hybridmpm import (
    BallObstacle,
    BoxSink,
    ConfigError,
    DataError,
    GraphSizeError,
    Motion,
    NeuralPhysics,
    Sand,
    Scene,
    UnknownScenarioError,
    Water,
    physics,
    scenarios,
)
from hybridmpm.errors import SimulationError
from hybridmpm.physics import NeuralModel, manifest
from hybridmpm.physics.manifest import WEIGHTS
from hybridmpm.scenarios.trained_on import TrainedOn
from hybridmpm.scene import LIQUIDS
from hybridmpm.training.export import exported_model


@pytest.fixture
def weights(tmp_path: Path, model_file: Path, model: NeuralModel) -> Path:
    """Return a folder with one published model, `small`."""
    (tmp_path / "manifest.json").write_text("{}")
    exported_model(model_file.read_bytes(), model.info).publish("small", tmp_path)
    return tmp_path


def test_a_shifted_scene_moves_the_same(model: NeuralModel) -> None:
    given = random_inputs(np.random.default_rng(0), 80, 2, kinematic=10, width=0.15)
    shift = np.array([0.0625, -0.03125], np.float32)
    moved = {key: given[key] + shift if key in {"history", "walls"} else given[key] for key in given}
    np.testing.assert_allclose(model.step(**moved), model.step(**given) + shift, atol=2e-6)


def test_the_order_of_particles_does_not_matter(model: NeuralModel) -> None:
    rng = np.random.default_rng(1)
    given = random_inputs(rng, 80, 2, kinematic=10, width=0.15)
    order = rng.permutation(80)
    shuffled = {
        "history": given["history"][:, order],
        "types": given["types"][order],
        "acceleration": given["acceleration"][order],
        "walls": given["walls"],
    }
    np.testing.assert_allclose(model.step(**shuffled), model.step(**given)[order], atol=2e-7)


def test_a_far_particle_changes_nothing(model: NeuralModel) -> None:
    near = random_inputs(np.random.default_rng(2), 40, 2, width=0.15)
    far = random_inputs(np.random.default_rng(3), 1, 2, width=0.01)
    far["history"] += np.float32(0.7)
    both = {
        key: np.concatenate([near[key], far[key]], axis=near[key].ndim - 2) for key in near if key != "types"
    }
    both |= {"types": np.full(41, 5), "walls": near["walls"]}
    found = model.step(**both)
    np.testing.assert_allclose(found[:40], model.step(**near), atol=2e-7)
    np.testing.assert_allclose(found[40:], model.step(**far), atol=2e-7)


@pytest.mark.parametrize("count", [0, 1, 2])
@pytest.mark.parametrize("kinematic", [0, 1, 2])
def test_few_particles(model: NeuralModel, model_3d: NeuralModel, count: int, kinematic: int) -> None:
    for one, dim in ((model, 2), (model_3d, 3)):
        given = random_inputs(np.random.default_rng(0), count, dim, kinematic=min(count, kinematic))
        after = one.step(**given)
        assert after.shape == (count, dim)
        assert np.isfinite(after).all()


def test_positions_end_at_the_walls(model: NeuralModel) -> None:
    given = random_inputs(np.random.default_rng(0), 30, 2)
    given["acceleration"][:15, 0] = -1e5
    after = model.step(**given)
    assert (after[:15, 0] == np.float32(0.1)).all()
    assert ((after >= np.float32(0.1)) & (after <= np.float32(0.9))).all()


@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_what_is_not_finite_does_not_hide_at_a_wall(model: NeuralModel, value: float) -> None:
    given = random_inputs(np.random.default_rng(0), 10, 2)
    given["history"][2, 4] = value
    after = model.step(**given)
    assert np.isnan(after[4]).any()


def test_a_clump_is_refused(model: NeuralModel) -> None:
    x = np.full((6, 300, 2), 0.5, np.float32)
    walls = np.array([[0.1, 0.1], [0.9, 0.9]], np.float32)
    with pytest.raises(GraphSizeError):
        model.step(x, np.full(300, 5), np.zeros((300, 2), np.float32), walls)
    # A clump among many others passes the limit on all edges, and is found by its own neighbours.
    spread = np.stack(np.meshgrid(*[np.linspace(0.1, 0.9, 25)] * 2), axis=-1).reshape(-1, 2)
    x = np.concatenate([x, np.broadcast_to(spread, (6, 625, 2))], axis=1).astype(np.float32)
    with pytest.raises(
        GraphSizeError, match=r"particle \d+ has 3\d\d neighbours within 0.0275 m, more than 256"
    ):
        model.step(x, np.full(925, 5), np.zeros((925, 2), np.float32), walls)


def test_threads_may_share_a_model(model: NeuralModel) -> None:
    given = [random_inputs(np.random.default_rng(seed), 60 + 10 * seed, 2, width=0.15) for seed in range(4)]
    wanted = [model.step(**one) for one in given]
    found: dict[int, list[bool]] = {seed: [] for seed in range(4)}

    def work(seed: int) -> None:
        for _ in range(20):
            found[seed].append(np.array_equal(model.step(**given[seed]), wanted[seed]))

    workers = [threading.Thread(target=work, args=(seed,)) for seed in range(4)]
    for worker in workers:
        worker.start()
    for worker in workers:
        worker.join()
    assert all(len(same) == 20 and all(same) for same in found.values())


def test_more_threads_compute_the_same(model_file: Path, model: NeuralModel) -> None:
    given = random_inputs(np.random.default_rng(0), 200, 2, width=0.2)
    two = NeuralModel.load(model_file, threads=2)
    np.testing.assert_allclose(two.step(**given), model.step(**given), atol=1e-7)
    with pytest.raises(ConfigError, match=r"threads must be in \[1, 1024\], got 0"):
        NeuralModel.load(model_file, threads=0)


def test_serving_imports_neither_torch_nor_onnx(model_file: Path) -> None:
    program = (
        "import sys\n"
        "from hybridmpm import NeuralPhysics, scenarios\n"
        f"physics = NeuralPhysics(scenarios.water_2d(0), {str(model_file)!r})\n"
        "physics.advance(30)\n"
        "print(physics.frame, sorted({'torch', 'onnx', 'h5py', 'matplotlib'} & set(sys.modules)))\n"
    )
    run = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert run.stdout == "30 []\n"


SCENES = [
    ("water_3d", "with dim 2; the scene has dim 3"),
    ("sand_2d", "with water; the scene has sand"),
    ("water_sand_2d", "with water; the scene has sand"),
]


@pytest.mark.parametrize(("name", "message"), SCENES)
def test_scenes_of_another_kind_are_refused(model: NeuralModel, name: str, message: str) -> None:
    with pytest.raises(ConfigError, match=f"trained on water_2d, water_ramps_2d, {message}"):
        model.check(scenarios.get(name, 0))


def test_scenes_of_other_numbers_are_refused(model: NeuralModel, model_3d: NeuralModel) -> None:
    scene = scenarios.water_2d(0)
    moving = BallObstacle(center=(0.5, 0.85), radius=0.03, motion=Motion(velocity=(0.1, 0.0)))
    sink = BoxSink(lower=(0.8, 0.1), upper=(0.9, 0.2))
    cases: list[tuple[dict[str, Any], str]] = [
        ({"frame_dt": 0.005}, "with frame_dt 0.0025; the scene has frame_dt 0.005"),
        ({"resolution": 64}, "with particle spacing 0.00390625; the scene has particle spacing 0.0078125"),
        ({"obstacles": (moving,)}, "with obstacles at rest; the scene has one that moves"),
        ({"sinks": (sink,)}, "with fixed particles; the scene has emitters or sinks"),
        ({"transfer_loss": 500.0}, "without transfer_loss; the scene has 500 1/s"),
    ]
    for change, message in cases:
        with pytest.raises(ConfigError, match=message):
            model.check(scene.model_copy(update=change))
    soft = [body.model_copy(update={"material": Water(max_compression=0.01)}) for body in scene.bodies]
    with pytest.raises(ConfigError, match=r"with water of bulk_modulus 277778; the scene's has bulk_modulus"):
        model.check(scene.model_copy(update={"bodies": tuple(soft)}))
    rough = [body.model_copy(update={"material": Water(wall_friction=0.5)}) for body in scene.bodies]
    with pytest.raises(ConfigError, match=r"of wall_friction 0; the scene's has wall_friction 0\.5"):
        model.check(scene.model_copy(update={"bodies": tuple(rough)}))
    honey = [body.model_copy(update={"material": LIQUIDS["honey"]}) for body in scene.bodies]
    with pytest.raises(ConfigError, match="with water; the scene has liquid"):
        model.check(scene.model_copy(update={"bodies": tuple(honey)}))
    ball = BallObstacle(center=(0.5, 0.5, 0.5), radius=0.1)
    with pytest.raises(ConfigError, match="trained on sand_3d, without obstacles; the scene has 1"):
        model_3d.check(scenarios.sand_3d(0).model_copy(update={"obstacles": (ball,)}))
    model.check(scenarios.water_ramps_2d(1))


def test_density_alone_matters_beside_another_one_only(model_3d: NeuralModel) -> None:
    """Matter of one density moves by its stiffness over its density alone."""
    scene = scenarios.sand_3d(0)

    def of(material: Sand) -> Scene:
        return scene.model_copy(
            update={"bodies": tuple(body.model_copy(update={"material": material}) for body in scene.bodies)}
        )

    for density in (500.0, 1000.0, 2700.0):
        model_3d.check(of(Sand(density=density, youngs_modulus=1000 * density)))
    with pytest.raises(ConfigError, match=r"youngs_modulus per 1000 kg/m\^3 1e\+06; .* kg/m\^3 625000"):
        model_3d.check(of(Sand(youngs_modulus=1e6)))
    known = TrainedOn.of_scenarios(("water_2d", "sand_2d", "water_sand_2d"))
    mixed = scenarios.water_sand_2d(0)
    assert known.constant_beyond(mixed) is None
    heavy = tuple(
        body.model_copy(update={"material": Sand()}) if isinstance(body.material, Sand) else body
        for body in mixed.bodies
    )
    beyond = known.constant_beyond(mixed.model_copy(update={"bodies": heavy}))
    assert beyond is not None
    assert beyond[1:] == ("density", 1600.0, (1000.0, 1000.0))
    # Metadata of before, with the density of the scenes.
    plain = TrainedOn.of([scene]).to_dict()
    plain["materials"]["sand"] |= {"density": (800.0, 800.0), "youngs_modulus": (8e5, 8e5)}
    assert TrainedOn.from_dict(plain, where="file").constant_beyond(scene) is None


def _changed(data: bytes, change: Callable[[onnx.ModelProto], None]) -> bytes:
    model = onnx.load_from_string(data)
    change(model)
    changed: bytes = model.SerializeToString()
    return changed


def _outside(model: onnx.ModelProto) -> None:
    tensor = model.graph.initializer[0]
    onnx.external_data_helper.set_external_data(tensor, location="weights.bin")
    tensor.ClearField("raw_data")


def _property(key: str, value: str | None) -> Callable[[onnx.ModelProto], None]:
    def change(model: onnx.ModelProto) -> None:
        properties = {entry.key: entry.value for entry in model.metadata_props}
        del model.metadata_props[:]
        kept = {k: v for k, v in properties.items() if k != key}
        onnx.helper.set_model_props(model, kept if value is None else kept | {key: value})

    return change


def _opset(model: onnx.ModelProto) -> None:
    model.opset_import[0].version = 17


def _spec(**changes: Any) -> Callable[[onnx.ModelProto], None]:
    def change(model: onnx.ModelProto) -> None:
        spec = next(json.loads(entry.value) for entry in model.metadata_props if entry.key == "spec")
        _property("spec", json.dumps(spec | changes))(model)

    return change


FILES: list[tuple[Callable[[onnx.ModelProto], None], type[Exception], str]] = [
    (_outside, DataError, r"keeps .+ in another file \(external data\)"),
    (_opset, DataError, "is of ONNX opset 17; this library serves opset 18"),
    (_property("format", "1"), DataError, "has model format 1; this library serves format 4"),
    (_property("format", None), DataError, "has model format none; this library serves format 4"),
    (_property("scales", None), DataError, "its metadata is damaged: KeyError.'scales'"),
    (_property("training", "{"), DataError, "its metadata is damaged: JSONDecodeError"),
    (_spec(features=9), ConfigError, "has features version 9; this library has 1"),
    (_spec(latent=0), ConfigError, r"latent must be in \[1, 1024\], got 0"),
    (lambda model: model.graph.ClearField("node"), DataError, "no model that onnxruntime can load"),
]


@pytest.mark.parametrize(("change", "kind", "message"), FILES)
def test_foreign_files_are_refused(
    model_file: Path, change: Callable[[onnx.ModelProto], None], kind: type[Exception], message: str
) -> None:
    data = _changed(model_file.read_bytes(), change)
    with pytest.raises(kind, match=message):
        NeuralModel(data, where="model foreign")


def test_files_that_are_no_models_are_refused(tmp_path: Path, model_file: Path) -> None:
    path = tmp_path / "broken.onnx"
    for data in (b"", b"text", bytes(100), model_file.read_bytes()[:-7]):
        path.write_bytes(data)
        with pytest.raises(DataError, match=r"broken.onnx is no ONNX model, or damaged or cut off"):
            NeuralModel.load(path)
    with pytest.raises(DataError, match=r"cannot read .*none.onnx: No such file"):
        NeuralModel.load(tmp_path / "none.onnx")


def test_a_flipped_byte_is_noticed(weights: Path) -> None:
    path = weights / "small.onnx"
    data = bytearray(path.read_bytes())
    good = manifest.models(weights)["small"].sha256
    data[len(data) // 2] ^= 1
    path.write_bytes(data)
    with pytest.raises(DataError, match=rf"its SHA-256 is [0-9a-f]{{64}}, the manifest has {good}"):
        manifest.read_model("small", weights)
    path.unlink()
    with pytest.raises(DataError, match=r"cannot read .*small.onnx"):
        manifest.read_model("small", weights)


def test_models_by_name(weights: Path) -> None:
    entry = manifest.models(weights)["small"]
    assert (entry.r_t, entry.latent, entry.layers, entry.scenarios) == (
        4,
        8,
        2,
        ("water_2d", "water_ramps_2d"),
    )
    assert manifest.default_model("water_2d", weights) == "small"
    with pytest.raises(ConfigError, match="no model serves sand_2d; there are models for water_2d, water_r"):
        manifest.default_model("sand_2d", weights)
    with pytest.raises(UnknownScenarioError):
        manifest.default_model("sand_4d", weights)
    with pytest.raises(ConfigError, match="there is no model 'large'; known are small"):
        manifest.read_model("large", weights)
    (weights / "manifest.json").write_text('{"small": {}}')
    with pytest.raises(DataError, match=r"manifest.json is missing or damaged"):
        manifest.models(weights)


def test_the_models_that_come_with_the_library_are_whole() -> None:
    for name, entry in physics.models().items():
        model = NeuralModel.load(name)
        spec = model.spec
        for key in ("scenarios", "r_p", "r_t", "radius", "latent", "layers"):
            assert getattr(spec, key) == getattr(entry, key)
        assert model.info.parameters == entry.parameters
        for scenario in spec.scenarios:
            model.check(scenarios.get(scenario, 1))
        card = (manifest.WEIGHTS / f"{name}.md").read_text(encoding="utf-8")
        assert "Apache-2.0" in card


def test_every_file_among_the_weights_is_in_the_manifest() -> None:
    entries = physics.models()
    known = {f"{name}.md" for name in entries} | {entry.file for entry in entries.values()}
    assert {file.name for file in manifest.WEIGHTS.iterdir()} == known | {"manifest.json"}


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
