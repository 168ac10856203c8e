"""Training of the transport network: that it learns, goes on after an interruption, and is exported."""

from pathlib import Path

import numpy as np
import pytest
import torch
from click.testing import CliRunner, Result

from hybridmpm.cli import cli
from hybridmpm.control import manifest
from hybridmpm.control.methods.learned.network import TransportNetwork as ServedNetwork
from hybridmpm.control.methods.learned.spec import TransportSpec
from hybridmpm.errors import ConfigError, DataError
from hybridmpm.training import checkpoint
from hybridmpm.training.control import pasts, scene_files
from hybridmpm.training.control.published import Exported
from hybridmpm.training.control.transport.export import export_transport
from hybridmpm.training.control.transport.trainer import TransportSettings, TransportTrainer
from hybridmpm.training.control.transport.windows import batch_of, drawn

CPU = torch.device("cpu")
SPEC = TransportSpec(scenarios=("water_2d",), width=4)


@pytest.fixture(scope="module")
def root(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with the pasts of six scenes."""
    folder = tmp_path_factory.mktemp("pasts")
    pasts.prepare(folder, "water_2d", range(6))
    return folder


@pytest.fixture(scope="module")
def six(root: Path) -> list[pasts.Past]:
    """Return the six pasts."""
    return pasts.read(root, "water_2d", range(6))


def trainer(steps: int = 40, rate: float = 1.5e-3) -> TransportTrainer:
    settings = TransportSettings(steps=steps, batch=4, particles=32, learning_rate=rate)
    return TransportTrainer(SPEC, settings, CPU)


def test_pasts_are_kept_and_made_anew_where_missing(root: Path, six: list[pasts.Past]) -> None:
    assert scene_files.missing(root, "water_2d", range(8)) == 2
    again = pasts.Past.simulated(six[2].scene)
    np.testing.assert_array_equal(again.x, six[2].x)
    np.testing.assert_array_equal(again.v, six[2].v)
    assert len(again.x) == pasts.STATES


def test_a_damaged_past_is_named(tmp_path: Path) -> None:
    (tmp_path / "water_2d").mkdir()
    (tmp_path / "water_2d" / "0000000.npz").write_bytes(b"half")
    with pytest.raises(DataError, match=r"0000000\.npz is damaged"):
        pasts.read(tmp_path, "water_2d", range(1))


def test_samples_lead_back_to_the_past(six: list[pasts.Past]) -> None:
    """A sample's end is a state of the same run, some strides earlier, mirrored or not."""
    rng = np.random.default_rng(0)
    for _ in range(20):
        sample = drawn(rng, six, shortest=0.1, longest=0.4)
        strides = round(sample.aim.seconds / six[0].seconds)
        assert 4 <= strides <= 16
        states = [past.positions(index) for past in six for index in range(pasts.STATES)]
        both = sample.state.lower[0] + sample.state.upper[0]
        mirrored = [np.column_stack([both - x[:, 0], x[:, 1]]) for x in states]
        found = [
            index
            for index, x in enumerate([*states, *mirrored])
            if x.shape == sample.end.shape and np.allclose(x, sample.end)
        ]
        later = [*states, *mirrored][found[0] + strides]
        np.testing.assert_allclose(later, sample.state.x, atol=1e-9)
        np.testing.assert_allclose(sample.aim.mean, sample.end.mean(axis=0), atol=1e-9)


def test_training_lowers_the_error(six: list[pasts.Past]) -> None:
    """Before training all are sent to the middle of the aim; after some steps less is unexplained."""
    one = trainer(60, rate=0.02)
    rng = np.random.default_rng(1)
    samples = [drawn(rng, six, shortest=0.1, longest=0.4) for _ in range(16)]
    np.testing.assert_allclose(one.unexplained(samples), 1.0, atol=1e-5)
    for _ in range(60):
        one.step(six)
    assert one.unexplained(samples).mean() < 0.8


def test_an_interrupted_training_gives_the_same_weights(six: list[pasts.Past], tmp_path: Path) -> None:
    whole, half = trainer(), trainer()
    for _ in range(6):
        whole.step(six)
    for _ in range(3):
        half.step(six)
    checkpoint.save(tmp_path / "checkpoint.pt", half, {})
    rest = TransportTrainer.load(tmp_path / "checkpoint.pt", CPU)
    for _ in range(3):
        rest.step(six)
    for name, weights in whole.average.state_dict().items():
        torch.testing.assert_close(weights, rest.average.state_dict()[name], rtol=0, atol=0)


def test_the_command_trains_and_the_export_answers_alike(
    root: Path, six: list[pasts.Past], tmp_path: Path
) -> None:
    """The exported network gives the ends that torch gives, for any number of particles."""
    out = tmp_path / "run"

    def invoke(*arguments: object) -> Result:
        data = ["--data", root, "--scenes", 6, "--valid", 1, "--device", "cpu"]
        mine = ["train", "control", *data, "--out", out, *arguments]
        return CliRunner().invoke(cli, [*map(str, mine)], prog_name="hybridmpm")

    first = invoke("--scenario", "water_2d", "--width", 4, "--steps", 8, "--batch", 2, "--until", 4)
    assert first.exit_code == 0, first.output
    other = invoke("--steps", 9)
    assert other.exit_code == 2
    assert "has --steps 8, not 9" in other.output
    assert invoke().exit_code == 0
    made = export_transport(out / "checkpoint.pt")
    data = made.data
    assert made.training["steps"] == "8"
    served, torch_one = ServedNetwork(data, where="test"), TransportTrainer.load(out / "checkpoint.pt", CPU)
    rng = np.random.default_rng(2)
    for count in (1, 57, 400):
        sample = drawn(rng, six, shortest=0.1, longest=0.4)
        batch = batch_of(rng, [sample], count)
        with torch.no_grad():
            wanted = torch_one.average(*batch.told, batch.noise, torch.tensor([0.25])).numpy()
        names = ("grid", "numbers", "particles", "places")
        feed = {name: getattr(batch, name).numpy() for name in names}
        feed |= {"noisy": batch.noise.numpy(), "time": np.array([0.25], np.float32)}
        (found,) = served._session.run(["end"], feed)
        np.testing.assert_allclose(found, wanted, atol=2e-5)
    _published(made, tmp_path)


def _published(made: Exported, folder: Path) -> None:
    (folder / "manifest.json").write_text("{}", encoding="utf-8")
    written = made.publish("mine", folder)
    assert [path.name for path in written] == ["mine.onnx", "mine.md", "manifest.json"]
    assert manifest.read_network("mine", folder) == made.data
    (folder / "mine.onnx").write_bytes(made.data[:-1])
    with pytest.raises(DataError, match="SHA-256"):
        manifest.read_network("mine", folder)
    with pytest.raises(DataError, match="no network 'other'; known are mine"):
        manifest.read_network("other", folder)
    with pytest.raises(ConfigError, match="lower-case"):
        made.publish("Mine!", folder)
