"""Networks of one's own: trained on a scene file or a data set, exported, and used on that very scene."""

import json
import os
import signal
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
import yaml
from click.testing import CliRunner, Result

from hybridmpm import HybridSimulator, NeuralPhysics, Scene, data, scenarios
from hybridmpm._support.signals import TerminatedError, raising_at_end
from hybridmpm.cli import cli
from hybridmpm.cli.progress import progress
from hybridmpm.cli.train.common import sources_of
from hybridmpm.control.methods.learned.serving import why_foreign
from hybridmpm.control.methods.learned.spec import TransportSpec
from hybridmpm.errors import ConfigError, DataError
from hybridmpm.physics import NetworkSpec
from hybridmpm.scenarios.trained_on import TrainedOn
from hybridmpm.training import run
from hybridmpm.training.control import scene_files
from hybridmpm.training.control.controlnet import cases
from hybridmpm.training.control.controlnet.trainer import ControlNetTrainer
from hybridmpm.training.control.pasts import Past, read_examples
from hybridmpm.training.control.transport.trainer import TransportTrainer
from hybridmpm.training.control.transport.windows import check_frame, check_pasts, drawn
from hybridmpm.training.settings import TransportSettings
from hybridmpm.training.sources import DataSet, Drawn, check_particles, described

OWN: dict[str, Any] = {
    "name": "step",
    "dim": 2,
    "resolution": 32,
    "walls": {"lower": [0.0, 0.0], "upper": [1.0, 1.0]},
    "bodies": [
        {
            "shape": "box",
            "lower": [0.1, 0.5],
            "upper": {"uniform": [[0.3, 0.8], [0.4, 0.9]]},
            "material": {"kind": "water", "max_compression": 0.02},
        }
    ],
    "obstacles": [{"shape": "box", "lower": [0.6, 0.0], "upper": [0.8, 0.15]}],
}
TINY = ("--steps", 2, "--batch", 1, "--threads", 1)
PHYSICS = ("--latent", 1, "--layers", 1, "--grid-cells", 0, "--unroll", 1)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with the scene file `own.yaml` and a data set of its examples of control."""
    made = tmp_path_factory.mktemp("own")
    (made / "own.yaml").write_text(yaml.safe_dump(OWN))
    few = ("--trajectories", 2, "--valid", 1, "--test", 0, "--frames", 100, "--substeps", "cfl")
    source = ("--scene", made / "own.yaml", "--out", made / "examples")
    result = invoke("dataset", "generate", "--control", *source, *few)
    assert result.exit_code == 0, result.output
    return made


def invoke(*arguments: object) -> Result:
    return CliRunner().invoke(cli, [str(one) for one in arguments], prog_name="hybridmpm")


def trained(folder: Path, kind: str, *arguments: object) -> Path:
    """Return the checkpoint of a training of two steps that was interrupted after the first."""
    out = folder / f"{kind}-run"
    for more in ((*TINY, "--until", 1), ("--threads", 1)):
        result = invoke("train", kind, *arguments, *more, "--out", out)
        assert result.exit_code == 0, result.output
    return out / "checkpoint.pt"


def test_physics_of_a_scene_file_runs_on_that_scene(folder: Path) -> None:
    options = (*PHYSICS, "--r-p", "1/4", "--trajectories", 1, "--frames", 64, "--data", folder / "data")
    file = folder / "physics.onnx"
    checkpoint = trained(folder, "physics", "--scene", folder / "own.yaml", *options)
    assert invoke("export", checkpoint, "--out", file).exit_code == 0
    scene = data.SceneTemplate.load(folder / "own.yaml").draw(1_200_000)
    for simulator in (NeuralPhysics(scene, file), HybridSimulator(scene, file)):
        simulator.advance(28)
        assert np.isfinite(simulator.positions).all()
    with pytest.raises(ConfigError, match=r"trained on step [0-9a-f]{8}, with particle spacing 0.015625"):
        NeuralPhysics(scenarios.water_2d(), file)
    other = {**OWN, "bodies": [{**OWN["bodies"][0], "upper": [0.35, 0.85], "material": "water"}]}
    with pytest.raises(ConfigError, match=r"with water of bulk_modulus \d+ to \d+; the scene's has"):
        NeuralPhysics(Scene.parse({**other, "frames": 9}), file)


@pytest.mark.long
def test_control_of_a_data_set_serves_that_scene(folder: Path) -> None:
    """An export keeps the description: test_transport.py."""
    checkpoint = trained(folder, "control", "--dataset", folder / "examples", "--width", 4)
    spec = TransportTrainer.load(checkpoint, torch.device("cpu")).spec
    assert spec.shortest == spec.longest == pytest.approx(0.25)
    scene = data.SceneTemplate.load(folder / "own.yaml").draw(1_200_000)
    assert why_foreign(scene, spec.trained_on) is None
    assert why_foreign(scenarios.water_2d(), spec.trained_on) == "it is trained in another box"
    assert "examples" not in spec.scenarios[0]
    assert spec.scenarios[0].startswith("step ")


def test_controlnet_of_a_data_set_learns_its_examples(folder: Path) -> None:
    checkpoint = trained(folder, "controlnet", "--dataset", folder / "examples", "--latent", 4, "--layers", 1)
    assert ControlNetTrainer.load(checkpoint).spec.trained_on.obstacles
    source = DataSet(folder / "examples")
    past, case = next(read_examples(source, "train")), cases.read(folder, source, range(0), "train")[0]
    for found, where in ((case.x, past.positions(1)), (case.end, past.positions(0))):
        # Nodes are of nearly equal mass.
        np.testing.assert_allclose(found.mean(axis=0), where.mean(axis=0), atol=2e-3)
    assert case.is_arrow is (past.sketch is not None and past.sketch.kind == "arrow")
    assert case.picture.any()
    with pytest.raises(DataError, match=r"of 100 frames, got 80: make them by .* --frames 100"):
        cases.of_example(replace(past, stride=80))


@pytest.mark.parametrize("kind", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_while_data_are_made_leaves_whole_files(tmp_path: Path, kind: signal.Signals) -> None:
    """The fifth scene is sent a signal; the others do not begin, and the same call makes them."""
    source, made = Drawn(scenario="water_2d"), []

    def make(_scene: Scene, seed: int) -> dict[str, np.ndarray[Any, Any]]:
        made.append(seed)
        if len(made) == 5:
            os.kill(os.getpid(), kind)
        time.sleep(0.05)
        return {"seed": np.array(seed)}

    with pytest.raises((KeyboardInterrupt, TerminatedError)), raising_at_end():
        scene_files.prepare(tmp_path, source, range(100), make)
    assert len(made) < 50
    assert sorted(int(file.stem) for file in (tmp_path / "water_2d").iterdir()) == sorted(made)
    scene_files.prepare(tmp_path, source, range(8), make)
    assert [seed for seed, _ in scene_files.read(tmp_path, source, range(8), ("seed",))] == list(range(8))


def test_examples_of_control_lead_back_to_their_target(folder: Path) -> None:
    source = DataSet(folder / "examples")
    pasts = list(read_examples(source, "train"))
    (trajectory, _) = source.read("train")
    assert len(pasts) == 2
    fluid = trajectory.types != 3
    np.testing.assert_allclose(pasts[0].positions(0), trajectory.control.target[fluid], atol=2e-5)
    np.testing.assert_allclose(pasts[0].positions(1), trajectory.positions[0, fluid], atol=2e-5)
    check_pasts(pasts, shortest=0.25, longest=0.25)
    sample = drawn(np.random.default_rng(0), pasts, shortest=0.25, longest=0.25)
    assert sample.aim.seconds == pytest.approx(0.25)
    ends = [past.positions(0) for past in pasts]
    assert any(end.shape == sample.end.shape and np.array_equal(end, sample.end) for end in ends), (
        "not mirrored"
    )


def test_what_a_data_set_lacks_is_named(folder: Path, tmp_path: Path) -> None:
    (tmp_path / "empty").mkdir()
    plain, bare = tmp_path / "plain", tmp_path / "bare"
    made = invoke("dataset", "generate", "--scene", folder / "own.yaml", "--out", plain, "--frames", 40,
                  "--trajectories", 1, "--substeps", "cfl", "--r-p", "1/4")  # fmt: skip
    assert made.exit_code == 0, made.output
    assert invoke("dataset", "convert", plain, "--to", "gns", "--out", bare).exit_code == 0
    cases = [
        ("physics", tmp_path / "none", "is no folder"),
        ("physics", tmp_path / "empty", "holds no split of any known format"),
        ("physics", bare, "comes without its scene, which gives walls, gravity and materials"),
        ("control", plain, "is no example of control; make a data set of such by"),
        ("controlnet", plain, "is no example of control; make a data set of such by"),
    ]
    for kind, place, message in cases:
        result = invoke("train", kind, "--dataset", place, *TINY, "--out", tmp_path / kind)
        assert result.exit_code == 2, result.output
        assert message in " ".join(result.stderr.split())
    (plain / "valid.h5").unlink()
    with pytest.raises(DataError, match="has no split 'valid', but train, test"):
        DataSet(plain)


def test_a_scene_that_cannot_be_learned_is_refused() -> None:
    scene = data.SceneTemplate(OWN).draw(0)
    with pytest.raises(DataError, match="has 3 particles, and training needs at least 16"):
        check_particles(scene, 3)
    with pytest.raises(ConfigError, match=r"frame_dt must be in \[0.0005, 0.04\] s"):
        check_frame(0.05, shortest=0.1, longest=0.4)
    flat = Scene.parse({**OWN, "obstacles": [], "bodies": [
        {"shape": "box", "lower": [0.0, 0.0], "upper": [1.0, 0.2], "material": "water"}]})  # fmt: skip
    with pytest.raises(DataError, match=r"moves by \S+ m at most .* must move by 0.03 m: let bodies fall"):
        check_pasts([Past.simulated(flat)], shortest=0.1, longest=0.4)
    moving = {**OWN["obstacles"][0], "motion": {"velocity": [0.1, 0.0]}}
    with pytest.raises(ConfigError, match="obstacles at rest: remove the motion"):
        TrainedOn.of([Scene.parse({**OWN, "bodies": scene.model_dump()["bodies"], "obstacles": [moving]})])
    both = [Drawn(template=data.SceneTemplate(OWN)), Drawn(scenario="water_2d")]
    with pytest.raises(ConfigError, match=r"spacing is 0\.015625 in step seed 0 and 0\.00390625 in water_2d"):
        described(both)


def test_descriptions_survive_their_file() -> None:
    scenes = described([Drawn(template=data.SceneTemplate(OWN))])
    for spec in (NetworkSpec(**scenes, radius=0.1), TransportSpec(**scenes)):
        plain = json.loads(json.dumps(spec.to_dict()))
        assert type(spec).from_dict(plain, where="file") == spec  # type: ignore[attr-defined]
        assert spec.trained_on.obstacles
        for damaged in ({"dim": 2}, {**plain["scenes"], "dim": 4}, {**plain["scenes"], "materials": 3}, []):
            with pytest.raises(ConfigError, match="scenes of"):
                type(spec).from_dict({**plain, "scenes": damaged}, where="file")  # type: ignore[attr-defined]


def test_a_network_of_own_scenes_needs_them_to_go_on() -> None:
    older = NetworkSpec(**described([Drawn(template=data.SceneTemplate(OWN))]), radius=0.1)
    with pytest.raises(Exception, match="give their --scene or --dataset again"):
        sources_of({"names": (), "files": (), "folders": ()}, older)


@pytest.mark.parametrize("kind", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_ends_a_training_after_its_step(tmp_path: Path, kind: signal.Signals) -> None:
    """The second step is sent a signal, and done nevertheless; the checkpoint goes on after it."""
    spec = TransportSpec(scenarios=("water_2d",), width=4)
    trainer = TransportTrainer(spec, TransportSettings(steps=9), torch.device("cpu"))
    before = signal.getsignal(kind)

    def step() -> float:
        trainer.step_count += 1
        if trainer.step_count == 2:
            signal.raise_signal(kind)
        return 0.5

    with pytest.raises(KeyboardInterrupt):
        run.train(trainer, tmp_path, step=step, validate=lambda: None, about={}, on_step=lambda _loss: None)
    assert TransportTrainer.load(tmp_path / run.CHECKPOINT, torch.device("cpu")).step_count == 2
    assert signal.getsignal(kind) is before


def test_without_a_terminal_a_line_says_how_long_it_takes(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    now = iter([0.0, 10.0, 40.0, 50.0])
    monkeypatch.setattr("hybridmpm.cli.progress.time.monotonic", lambda: next(now))
    with progress("Training", 100, done=20) as bar:
        bar.label = "Training, loss 0.5"
        for _ in range(3):
            bar.update(10)
    lines = capsys.readouterr().err.splitlines()
    assert lines == ["Training", "Training, loss 0.5: 40 of 100, 2 min left"]
