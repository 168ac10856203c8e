"""`hybridmpm train physics` as one types it: begin, go on, finetune, export; and what it refuses."""

import dataclasses
import json
from collections.abc import Callable
from pathlib import Path

import onnx
import pytest
import torch
from click.testing import CliRunner, Result

from hybridmpm import SOLVER_VERSION
from hybridmpm.cli import cli
from hybridmpm.physics import NetworkSpec, NeuralModel
from hybridmpm.physics.manifest import read_model
from hybridmpm.training import checkpoint
from hybridmpm.training.export import export_checkpoint

TINY = ("--latent", "4", "--layers", "1", "--r-p", "1/16", "--r-t", "8", "--batch", "1", "--unroll", "1")
Train = Callable[..., Result]


@pytest.fixture
def train(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Train:
    """Return the command with data of one short trajectory; what it is called with goes into checkpoints."""

    def command(*arguments: object) -> Result:
        mine = ["train", "physics", *map(str, arguments), "--device", "cpu"]
        monkeypatch.setattr("sys.argv", ["hybridmpm", *mine])
        small = ["--data", str(tmp_path / "data"), "--trajectories", "1", "--frames", "120"]
        return CliRunner().invoke(cli, [*mine, *small], prog_name="hybridmpm")

    return command


def weights_of(state: dict[str, torch.Tensor]) -> torch.Tensor:
    return torch.cat([tensor.ravel() for tensor in state.values()])


def weights(file: Path) -> torch.Tensor:
    return weights_of(checkpoint.read(file)["weights"])


def made_before_solvers_had_versions(file: Path) -> None:
    """Take the version of the solver out of a checkpoint."""
    state = checkpoint.read(file)
    del state["about"]["solver_versions"]
    torch.save(state, file)


def test_a_training_goes_on_and_is_finetuned(
    train: Train, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    whole, parts, fine = tmp_path / "whole", tmp_path / "parts", tmp_path / "fine"
    for folder, more in ((whole, ()), (parts, ("--until", 3)), (parts, ())):
        result = train("--scenario", "water_2d", *TINY, "--steps", 6, "--out", folder, *more)
        assert result.exit_code == 0, result.output
    file = parts / "checkpoint.pt"
    assert torch.equal(weights(file), weights(whole / "checkpoint.pt"))
    assert "1 trajectories of water_2d, on cpu" in result.stderr
    rows = (parts / "rollouts.jsonl").read_text(encoding="utf-8").splitlines()
    assert json.loads(rows[-1])["trained_steps"] == 6
    assert (parts / "rollout.png").stat().st_size > 1000
    assert checkpoint.read(file)["about"]["solver_versions"] == str(SOLVER_VERSION)

    made_before_solvers_had_versions(file)
    result = train("--finetune", file, "--steps", 2, "--batch", 1, "--unroll", 1, "--out", fine)
    assert result.exit_code == 0, result.output
    state, before = checkpoint.read(fine / "checkpoint.pt"), checkpoint.read(file)
    assert json.loads(state["spec"]) == json.loads(before["spec"])
    assert state["scales"] == before["scales"]
    assert 0 < (weights(fine / "checkpoint.pt") - weights(file)).abs().max() < 0.01
    # The file would take seconds to write; tests/python/physics/test_export.py holds what is in one.
    exported: list[torch.nn.Module] = []
    monkeypatch.setattr(
        "hybridmpm.training.export.to_onnx", lambda one, _info: exported.append(one.network) or b""
    )
    made = export_checkpoint(fine / "checkpoint.pt")
    first, second = made.training["command"].split("; ")
    assert first.startswith("hybridmpm train physics --scenario water_2d --latent 4")
    assert first.endswith("--until 6")
    assert second.startswith(f"hybridmpm train physics --finetune {file}")
    assert made.training["steps"] == "8"
    assert made.entry["solver_versions"] == (1, SOLVER_VERSION)
    assert checkpoint.spent(state)[1] == pytest.approx(before["seconds"] + state["seconds"], abs=0.1)
    assert made.entry["r_t"] == 8
    (network,) = exported
    assert torch.equal(weights_of(network.state_dict()), weights(fine / "checkpoint.pt"))


def test_what_does_not_fit_is_refused(train: Train, tmp_path: Path) -> None:
    out = tmp_path / "run"
    begin = ("--scenario", "water_2d", *TINY, "--out", out)
    assert train(*begin, "--steps", 1).exit_code == 0
    cases = [
        (
            ("--out", tmp_path / "new"),
            "Give at least one --scenario, --scene FILE or --dataset DIR. Scenarios are water_2d",
        ),
        (("--scenario", "sand_2d", "--out", out), "was trained on water_2d, not on sand_2d"),
        ((*begin, "--latent", 8), "has --latent 4, not 8; leave it out or choose another --out"),
        (("--finetune", tmp_path / "none.pt", "--out", tmp_path / "new"), "none.pt does not exist"),
        (("--finetune", "fluids", "--out", tmp_path / "new"), "no model 'fluids'; known are fluids_2d"),
        (("--finetune", tmp_path / "none.onnx", "--out", tmp_path / "new"), "cannot read"),
        (
            ("--finetune", out / "checkpoint.pt", "--latent", 8, "--out", tmp_path / "new"),
            "has --latent 4, not 8; leave it out or leave out --finetune",
        ),
        (("--scenario", "water_2d", "--noise", 2, "--out", tmp_path / "new"), "2.0 is not in the range"),
        (("--scenario", "water_2d", "--scenario", "water_3d", "--out", tmp_path / "new"), "of one dimension"),
    ]
    for arguments, message in cases:
        result = train(*arguments)
        assert result.exit_code == 2, (arguments, result.output)
        assert message in " ".join(result.stderr.split()), result.stderr


def test_a_network_of_the_library_is_finetuned(train: Train, tmp_path: Path) -> None:
    out = tmp_path / "fine"
    begin = ("--finetune", "fluids_3d", "--scenario", "sand_3d")
    result = train(*begin, "--steps", 1, "--batch", 1, "--unroll", 1, "--noise", 0.15, "--out", out)
    assert result.exit_code == 0, result.output
    state, served = checkpoint.read(out / "checkpoint.pt"), NeuralModel.load("fluids_3d")
    spec = NetworkSpec.from_dict(json.loads(state["spec"]), where="checkpoint")
    assert spec == dataclasses.replace(served.spec, scenarios=("sand_3d",))
    held = onnx.load_from_string(read_model("fluids_3d")).graph.initializer
    before = {one.name.removeprefix("simulator.network."): onnx.numpy_helper.to_array(one) for one in held}
    change = [abs(part.numpy() - before[name]).max() for name, part in state["weights"].items()]
    assert 0 < max(change) < 0.01, "a training of one step begins with the weights of the network"
    assert json.loads(state["scales"])["noise_std"] == pytest.approx(served.info.scales.noise_std, rel=0.5)
    about = state["about"]
    assert about["command"].startswith(served.info.training["command"] + "; hybridmpm train physics")
    assert int(about["steps_before"]) == int(served.info.training["steps"]) > 0


def test_damaged_networks_are_not_finetuned(train: Train, tmp_path: Path) -> None:
    file, data = tmp_path / "one.onnx", read_model("fluids_3d")
    foreign = onnx.load_from_string(data)
    foreign.graph.initializer[0].name = "another"
    cases = [
        (data[:1000], "no ONNX model"),
        (b"", "has model format none"),
        (foreign.SerializeToString(), "its weights are not those of its network"),
    ]
    for content, message in cases:
        file.write_bytes(content)
        result = train("--finetune", file, "--out", tmp_path / "fine")
        assert result.exit_code == 2, result.output
        assert message in " ".join(result.stderr.split()), result.stderr
