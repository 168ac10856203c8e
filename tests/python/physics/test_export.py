"""Exported files: what is in them, and that they compute what torch does."""

import json
from pathlib import Path

import numpy as np
import onnx
import pytest
import torch
from click.testing import Result
from tests.python.physics.conftest import TorchStepper, random_inputs, run_export, save_checkpoint

from hybridmpm import ConfigError, NeuralPhysics, radius_graph, scenarios
from hybridmpm._support.networks import OPSET
from hybridmpm.physics import NetworkSpec, NeuralModel, manifest
from hybridmpm.training.export import exported_model
from hybridmpm.training.physics.network.graph_network import GraphNetwork
from hybridmpm.training.physics.network.simulator import LearnedSimulator
from hybridmpm.training.physics.windows import edges_of
from hybridmpm.training.publish import MAX_BYTES

ALLOWED = {
    *("Add", "Sub", "Mul", "Div", "Neg", "Sqrt", "ReduceSum", "MatMul", "Gemm", "Relu", "LayerNormalization"),
    *("Gather", "Slice", "Concat", "Squeeze", "Unsqueeze", "Reshape", "Cast", "CastLike", "Constant"),
    *("Clip", "Min", "Max", "Equal", "Greater", "Where", "Exp", "Pow"),
    *("Conv", "Transpose", "Abs", "Identity", "Shape"),
}
CROWDS = [
    *((1, 0, 0.8), (2, 0, 0.8), (2, 0, 0.01), (2, 1, 0.01), (1, 1, 0.8)),
    *((40, 0, 0.1), (200, 30, 0.2), (90, 0, 0.8)),
]
"""Particles, kinematic ones among them, and the width of their box [m]."""


def _graph(path: Path) -> onnx.GraphProto:
    return onnx.load_from_string(path.read_bytes()).graph


def test_only_known_operators(model_file: Path, model_file_3d: Path) -> None:
    """Nothing that writes in scattered places, loops, branches or makes sizes from values."""
    for path in (model_file, model_file_3d):
        assert {node.op_type for node in _graph(path).node} <= ALLOWED
        assert {node.domain for node in _graph(path).node} == {""}


def test_normalisation_is_one_operator(model_file: Path, simulator: LearnedSimulator) -> None:
    norms = sum(isinstance(module, torch.nn.LayerNorm) for module in simulator.modules())
    assert sum(node.op_type == "LayerNormalization" for node in _graph(model_file).node) == norms


def test_sizes_are_free_and_weights_inside(model_file: Path, simulator: LearnedSimulator) -> None:
    data = model_file.read_bytes()
    model = onnx.load_from_string(data)
    shapes = {
        one.name: [d.dim_param or d.dim_value for d in one.type.tensor_type.shape.dim]
        for one in (*model.graph.input, *model.graph.output)
    }
    n, e = shapes["types"][0], shapes["senders"][0]
    assert isinstance(n, str)
    assert shapes == {
        "history": [6, n, 2],
        "types": [n],
        "acceleration": [n, 2],
        "walls": [2, 2],
        "senders": [e],
        "receivers": [e],
        "arrivals": [n, shapes["mask"][1]],
        "mask": [n, shapes["mask"][1]],
        "share": [n],
        "positions": [n, 2],
    }
    assert [tensor.name for tensor in model.graph.initializer if tensor.external_data] == []
    weights = 4 * sum(parameter.numel() for parameter in simulator.parameters())
    assert weights < len(data) < weights + 40_000
    assert [entry.version for entry in model.opset_import] == [OPSET]


def test_the_file_tells_no_paths(model_file: Path) -> None:
    data = model_file.read_bytes()
    assert str(Path(__file__).parents[3]).encode() not in data
    assert b".py" not in data
    assert b"site-packages" not in data


def test_metadata_comes_back(model: NeuralModel, simulator: LearnedSimulator) -> None:
    info = model.info
    assert (info.spec, info.scales, info.parameters) == (simulator.spec, simulator.scales, 123)
    assert info.training["command"] == "hybridmpm train physics"
    assert info.errors == [{"scenario": "water_2d", "frame": 40, "error": 0.5}]


@pytest.mark.parametrize("crowd", CROWDS)
@pytest.mark.parametrize("dim", [2, 3])
def test_onnxruntime_computes_what_torch_does(
    request: pytest.FixtureRequest, crowd: tuple[int, int, float], dim: int
) -> None:
    count, kinematic, width = crowd
    suffix = "" if dim == 2 else "_3d"
    served = request.getfixturevalue(f"model{suffix}")
    stepper = TorchStepper(request.getfixturevalue(f"simulator{suffix}"))
    for seed in range(3):
        given = random_inputs(np.random.default_rng(seed), count, dim, kinematic=kinematic, width=width)
        found, wanted = served.step(**given), stepper.step(**given)
        assert found.dtype == np.float32
        way = np.sqrt(np.mean(np.square(np.diff(given["history"], axis=0)))) or 0.004
        assert np.abs(found - wanted).max() <= 1e-4 * way
        still = given["types"] == 3
        np.testing.assert_array_equal(found[still], given["history"][-1][still])


def test_rollout_of_50_frames_is_that_of_torch(model: NeuralModel, simulator: LearnedSimulator) -> None:
    scene = scenarios.water_ramps_2d(4)
    served, trained = NeuralPhysics(scene, model), NeuralPhysics(scene, TorchStepper(simulator))
    paths = []
    for physics in (served, trained):
        physics.advance(20)
        paths.append(physics.rollout(50))
    # Of what particles travel. One unit in the last place on torch's own first step makes twice as much.
    way = np.sqrt(np.mean(np.square(paths[0][-1] - paths[0][0])))
    assert way > 0.1
    assert np.abs(paths[0] - paths[1]).max() <= 1e-4 * way


def test_particles_in_one_place_stay_finite(model: NeuralModel) -> None:
    """The exporter's optimizer once dropped the 1e-12 under a root, and coincident particles became NaN."""
    x = np.full((6, 5, 2), 0.5, np.float32)
    walls = np.array([[0.1, 0.1], [0.9, 0.9]], np.float32)
    assert np.isfinite(model.step(x, np.full(5, 5), np.zeros((5, 2), np.float32), walls)).all()


def test_command_exports_a_checkpoint(
    exported_3d: tuple[Result, Path], model_3d: NeuralModel, simulator_3d: LearnedSimulator
) -> None:
    result, out = exported_3d
    assert result.exit_code == 0, result.output
    assert str(out) in result.stdout
    info = model_3d.info
    assert info.spec == simulator_3d.spec
    (row,) = info.errors
    assert {key: value for key, value in row.items() if value != ""} == {
        "scenario": "sand_3d",
        "method": "neural",
        "error_40": 0.25,
    }
    assert info.parameters == sum(parameter.numel() for parameter in simulator_3d.parameters())
    assert (info.training["steps"], info.training["seconds"]) == ("70", "3600")
    assert info.training["machine"] == "a processor, 2 cores"
    given = random_inputs(np.random.default_rng(0), 50, 3, width=0.1)
    np.testing.assert_allclose(model_3d.step(**given), TorchStepper(simulator_3d).step(**given), atol=4e-7)


def test_command_refuses_what_it_cannot_use(tmp_path: Path, simulator: LearnedSimulator) -> None:
    file, out = tmp_path / "checkpoint.pt", tmp_path / "model.onnx"
    save_checkpoint(simulator, file)
    (tmp_path / "rows.json").write_text("{}")
    foreign = torch.load(file, weights_only=True)
    spec = json.loads(foreign["spec"])
    torch.save({**foreign, "spec": json.dumps({**spec, "features": 7})}, tmp_path / "other.pt")
    torch.save({**foreign, "spec": json.dumps({**spec, "latent": 4})}, tmp_path / "small.pt")
    cases = [
        ((file,), "--out FILE.onnx, --publish NAME"),
        ((file, "--out", "model.pb"), "--out must end in .onnx, got 'model.pb'"),
        ((file, "--out", out, "--errors", tmp_path / "no.json"), "cannot be read as JSON"),
        ((file, "--out", out, "--errors", tmp_path / "rows.json"), "must be a JSON list of objects"),
        ((tmp_path / "none.pt", "--out", out), "does not exist"),
        ((tmp_path / "rows.json", "--out", out), "no checkpoint"),
        ((tmp_path / "other.pt", "--out", out), "features version 7; this library has 1"),
        ((tmp_path / "small.pt", "--out", out), "its weights are not those of its network"),
    ]
    for arguments, message in cases:
        result = run_export(*arguments)
        assert result.exit_code == 2, arguments
        assert message in " ".join(result.stderr.split()), result.stderr
    assert not out.exists()


def test_publishing_adds_model_entry_and_card(tmp_path: Path, model_file: Path, model: NeuralModel) -> None:
    (tmp_path / "manifest.json").write_text("{}")
    data = model_file.read_bytes()
    files = exported_model(data, model.info).publish("water-small", tmp_path)
    assert [file.name for file in files] == ["water-small.onnx", "water-small.md", "manifest.json"]
    assert manifest.read_model("water-small", tmp_path) == data
    exported_model(data, model.info).publish("second", tmp_path)
    exported_model(data, model.info).publish("water-small", tmp_path)
    assert list(manifest.models(tmp_path)) == ["water-small", "second"]
    assert manifest.default_model("water_ramps_2d", tmp_path) == "water-small"
    assert manifest.models(tmp_path)["water-small"].solver_versions == (1, 2)
    card = (tmp_path / "water-small.md").read_text()
    for text in (
        "hybridmpm train physics",
        "1.0 minutes",
        "r_t = 4 frames of 2.5 ms",
        "| solver | version 1, 2 |",
        "| water_2d | 40 | 0.5 |",
    ):
        assert text in card
    with pytest.raises(ConfigError, match="a letter first; got 'Water'"):
        exported_model(data, model.info).publish("Water", tmp_path)
    with pytest.raises(ConfigError, match="at most 8000000 bytes, got 8000001"):
        exported_model(bytes(8_000_001), model.info).publish("large", tmp_path)


def test_the_papers_network_is_small_enough_to_ship() -> None:
    network = GraphNetwork(NetworkSpec(scenarios=("water_2d",), radius=0.015, r_p=1 / 1.75, r_t=2))
    assert 4 * sum(parameter.numel() for parameter in network.parameters()) < 0.9 * MAX_BYTES


def test_graph_of_types_is_that_of_training() -> None:
    """Serving and training join the same particles: none of the kinematic ones to each other."""
    given = random_inputs(np.random.default_rng(3), 120, 2, kinematic=40, width=0.15)
    x, types = given["history"][-1], given["types"]
    served = radius_graph(x, 0.0275, types, kinematic=3)
    trained = edges_of(torch.from_numpy(x), torch.from_numpy(types), (120,), 0.0275)
    index = torch.arange(120).unsqueeze(1)
    np.testing.assert_array_equal(trained.from_senders(index)[:, 0], served.senders)
    np.testing.assert_array_equal(trained.from_receivers(index)[:, 0], served.receivers)
    assert not ((types[served.senders] == 3) & (types[served.receivers] == 3)).any()
