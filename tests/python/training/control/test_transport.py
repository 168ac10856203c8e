"""Training of the transport network: that it learns, goes on after an interruption, and is exported."""

import dataclasses
from itertools import permutations, product
from pathlib import Path

import numpy as np
import onnx
import pytest
import torch
from click.testing import CliRunner, Result

from hybridmpm.cli import cli
from hybridmpm.control.methods.learned.features import inputs
from hybridmpm.control.methods.learned.network import TransportNetwork as ServedNetwork
from hybridmpm.control.methods.learned.noise import smooth_noise
from hybridmpm.control.methods.learned.spec import TransportSpec
from hybridmpm.errors import ConfigError, DataError
from hybridmpm.training import checkpoint
from hybridmpm.training.control import pasts, scene_files
from hybridmpm.training.control.transport.beginning import Beginning
from hybridmpm.training.control.transport.export import export_transport
from hybridmpm.training.control.transport.supply import Stock, Supply, batch_at
from hybridmpm.training.control.transport.trainer import TransportTrainer
from hybridmpm.training.control.transport.windows import batch_of, drawn
from hybridmpm.training.settings import TransportSettings
from hybridmpm.training.sources import Drawn

CPU = torch.device("cpu")
WATER = {dim: Drawn(scenario=f"water_{dim}d") for dim in (2, 3)}
SPECS = {dim: TransportSpec(scenarios=(f"water_{dim}d",), width=4) for dim in (2, 3)}


@pytest.fixture(scope="module")
def root(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with the pasts of six scenes in 2D and of four in 3D."""
    folder = tmp_path_factory.mktemp("pasts")
    pasts.prepare(folder, WATER[2], range(6))
    pasts.prepare(folder, WATER[3], range(4))
    return folder


@pytest.fixture(scope="module")
def six(root: Path) -> list[pasts.Past]:
    """Return the six pasts."""
    return pasts.read(root, WATER[2], range(6))


@pytest.fixture(scope="module")
def four(root: Path) -> list[pasts.Past]:
    """Return the four pasts in 3D."""
    return pasts.read(root, WATER[3], range(4))


def trainer(dim: int, steps: int = 40, rate: float = 1.5e-3) -> TransportTrainer:
    settings = TransportSettings(steps=steps, batch=4, particles=32, learning_rate=rate)
    return TransportTrainer(SPECS[dim], settings, CPU)


def take_steps(one: TransportTrainer, found: list[pasts.Past], count: int) -> list[float]:
    return [one.step(*batch_at(one.step_count, found, one.spec, one.settings)) for _ in range(count)]


def test_pasts_are_kept_and_made_anew_where_missing(root: Path, six: list[pasts.Past]) -> None:
    assert scene_files.missing(root, WATER[2], range(8)) == 2
    again = pasts.Past.simulated(six[2].scene)
    np.testing.assert_array_equal(again.x, six[2].x)
    np.testing.assert_array_equal(again.v, six[2].v)
    assert len(again.x) == pasts.STATES


def test_a_damaged_past_is_named(tmp_path: Path) -> None:
    (tmp_path / "water_2d").mkdir()
    (tmp_path / "water_2d" / "0000000.npz").write_bytes(b"half")
    with pytest.raises(DataError, match=r"0000000\.npz is damaged"):
        pasts.read(tmp_path, WATER[2], range(1))


@pytest.mark.parametrize("dim", [2, 3])
def test_samples_lead_back_to_the_past(six: list[pasts.Past], four: list[pasts.Past], dim: int) -> None:
    """A sample's end is a state of the same run, some strides earlier, both mirrored and turned alike."""
    rng = np.random.default_rng(0)
    mine = six if dim == 2 else four
    states = [past.positions(index) for past in mine for index in range(pasts.STATES)]
    turns = [[0, 1]] if dim == 2 else [list(order) for order in permutations(range(3)) if order[1] == 1]
    seen = set()
    for _ in range(30):
        sample = drawn(rng, mine, shortest=0.1, longest=0.4)
        strides = round(sample.aim.seconds / mine[0].seconds)
        assert 4 <= strides <= 16
        both = sample.state.lower + sample.state.upper
        found = []
        for order, signs in product(turns, product(*[(1, -1)] * (dim - 1))):
            sign = np.ones(dim)
            sign[::2] = signs
            for index, x in enumerate(states):
                moved = np.where(sign < 0, both, 0) + sign * x[:, order]
                if moved.shape == sample.end.shape and np.allclose(moved, sample.end):
                    later = np.where(sign < 0, both, 0) + sign * states[index + strides][:, order]
                    np.testing.assert_allclose(later, sample.state.x, atol=1e-9)
                    found.append((tuple(order), signs))
        assert len(found) == 1
        seen.add(found[0])
        np.testing.assert_allclose(sample.aim.mean, sample.state.weight @ sample.end, atol=1e-9)
    assert len(seen) == (2 if dim == 2 else 8)


def test_a_sample_in_3d_has_the_covariance_of_the_view(four: list[pasts.Past]) -> None:
    rng = np.random.default_rng(0)
    samples = [drawn(rng, four, shortest=0.1, longest=0.4) for _ in range(8)]
    for sample in (one for one in samples if not one.is_arrow):
        root = sample.aim.root
        assert root is not None
        spread = np.cov(sample.end[:, :2].T, bias=True, aweights=sample.state.weight)
        np.testing.assert_allclose(root @ root, spread, atol=1e-9)


@pytest.mark.parametrize("dim", [2, pytest.param(3, marks=pytest.mark.long)])
def test_training_lowers_the_error(six: list[pasts.Past], four: list[pasts.Past], dim: int) -> None:
    """Before training all are sent to the middle of the aim; after some steps less is unexplained."""
    mine = six if dim == 2 else four
    one = trainer(dim, 60, rate=0.02)
    rng = np.random.default_rng(1)
    samples = [drawn(rng, mine, shortest=0.1, longest=0.4) for _ in range(16)]
    np.testing.assert_allclose(one.unexplained(samples), 1.0, atol=1e-5)
    take_steps(one, mine, 60)
    assert one.unexplained(samples).mean() < 0.8


def test_ends_that_lie_too_close_cost_more_with_a_weight_on_their_spread(four: list[pasts.Past]) -> None:
    """Ends at half of the true distance from their mean have a quarter of the covariance."""
    spec = SPECS[3]
    plain, weighted = (
        TransportTrainer(spec, TransportSettings(steps=9, batch=3, spread=weight), CPU)
        for weight in (0.0, 2.0)
    )
    batch, time = batch_at(0, four, spec, plain.settings)
    middle = batch.target.mean(dim=1, keepdim=True)
    for one in (plain, weighted):
        one.network.forward = lambda *_inputs: (batch.target + middle) / 2  # type: ignore[method-assign]
    assert float(weighted.loss(batch, time) - plain.loss(batch, time)) == pytest.approx(2 * 0.75, rel=1e-4)


@pytest.mark.parametrize("dim", [2, 3])
def test_an_interrupted_training_gives_the_same_weights(
    six: list[pasts.Past], four: list[pasts.Past], tmp_path: Path, dim: int
) -> None:
    mine = six if dim == 2 else four
    whole, half = trainer(dim), trainer(dim)
    losses = take_steps(whole, mine, 6)
    first = take_steps(half, mine, 3)
    checkpoint.save(tmp_path / "checkpoint.pt", half, {})
    rest = TransportTrainer.load(tmp_path / "checkpoint.pt", CPU)
    assert losses == first + take_steps(rest, mine, 3)
    for name, weights in whole.average.state_dict().items():
        torch.testing.assert_close(weights, rest.average.state_dict()[name], rtol=0, atol=0)


def test_another_process_makes_the_same_batches(root: Path, four: list[pasts.Past]) -> None:
    settings = TransportSettings(steps=9, batch=2, particles=16, seed=3)
    with Supply(Stock(root, [WATER[3]], range(4), SPECS[3], settings), 5) as supply:
        for step in (5, 6):
            wanted, got = batch_at(step, four, SPECS[3], settings), supply.take()
            assert torch.equal(wanted[1], got[1])
            for name, tensor in vars(wanted[0]).items():
                assert torch.equal(tensor, getattr(got[0], name)), name


def test_what_another_process_cannot_read_is_told(root: Path) -> None:
    settings = TransportSettings(steps=9, batch=2, particles=16)
    with (
        Supply(Stock(root / "none", [WATER[2]], range(4), SPECS[2], settings), 0) as supply,
        pytest.raises(DataError, match="damaged"),
    ):
        supply.take()


@pytest.mark.long
@pytest.mark.parametrize("dim", [2, 3])
def test_the_command_trains_and_the_export_answers_alike(
    root: Path, six: list[pasts.Past], four: list[pasts.Past], tmp_path: Path, dim: int
) -> None:
    """The exported network gives the ends that torch gives, for any number of particles."""
    out, mine = tmp_path / "run", six if dim == 2 else four

    def invoke(*arguments: object) -> Result:
        data = ["--data", root, "--scenes", len(mine), "--valid", 1, "--device", "cpu"]
        every = ["train", "control", *data, "--out", out, *arguments]
        return CliRunner().invoke(cli, [*map(str, every)], prog_name="hybridmpm")

    first = invoke("--scenario", f"water_{dim}d", "--width", 4, "--steps", 8, "--batch", 2, "--until", 4)
    assert first.exit_code == 0, first.output
    assert invoke().exit_code == 0
    made = export_transport(out / "checkpoint.pt")
    data = made.data
    assert made.training["steps"] == "8"
    assert made.publish("mine", tmp_path)[0].read_bytes() == data
    served, torch_one = ServedNetwork(data, where="test"), TransportTrainer.load(out / "checkpoint.pt", CPU)
    rng = np.random.default_rng(2)
    for count in (1, 57, 400):
        sample = drawn(rng, mine, shortest=0.1, longest=0.4)
        batch = batch_of(rng, [sample], count, obstacles=False)
        with torch.no_grad():
            wanted = torch_one.average(*batch.inputs, batch.noise, torch.tensor([0.25])).numpy()
        names = ("grid", "numbers", "particles", "places")
        feed = {name: getattr(batch, name).numpy() for name in names}
        feed |= {"noisy": batch.noise.numpy(), "time": np.array([0.25], np.float32)}
        (found,) = served._session.run(["end"], feed)
        np.testing.assert_allclose(found, wanted, atol=2e-5)


@pytest.mark.parametrize("dim", [2, 3])
def test_a_training_begins_with_a_network_of_the_library(
    six: list[pasts.Past], four: list[pasts.Past], dim: int
) -> None:
    """Its answers in open space stay as they are, also where the training adds obstacles to what it sees."""
    name, mine = f"transport_{dim}d", six if dim == 2 else four
    beginning = Beginning.read(Path(name))
    assert beginning.origin["command"].startswith("hybridmpm train control")
    scenes = dataclasses.replace(beginning.spec.trained_on, obstacles=True)
    spec = dataclasses.replace(beginning.spec, scenes=scenes)
    served, sample = (
        ServedNetwork.load(name),
        drawn(np.random.default_rng(2), mine, shortest=0.1, longest=0.4),
    )
    wanted = sample.aim.to_own(served.ends(sample.state, sample.aim, seed=0, evaluations=1))
    for own in (beginning.spec, spec):
        one = TransportTrainer(own, TransportSettings(steps=9), CPU)
        one.begin_with(beginning.weights_for(own, name))
        given = [
            torch.from_numpy(part)
            for part in vars(inputs([sample.state], [sample.aim], [None], obstacles=own.obstacles)).values()
        ]
        noise = smooth_noise(np.random.default_rng(0), given[3][0].numpy().astype(np.float64))
        with torch.no_grad():
            found = one.average(*given, torch.from_numpy(noise[None]).float(), torch.zeros(1))[0].numpy()
        np.testing.assert_allclose(found, wanted, atol=2e-4)


def test_what_a_training_cannot_begin_with(tmp_path: Path) -> None:
    beginning, data = Beginning.read(Path("transport_2d")), ServedNetwork.FOLDER.read("transport_2d")
    with pytest.raises(ConfigError, match="transport_2d is for 2D, and the scenes are in 3D"):
        beginning.weights_for(SPECS[3], "transport_2d")
    seeing = dataclasses.replace(beginning, spec=TransportSpec(scenarios=("water_ramps_2d",)))
    with pytest.raises(ConfigError, match="sees obstacles: add a scenario that has some"):
        seeing.weights_for(SPECS[2], "mine")
    model = onnx.load_from_string(data)
    next(one for one in model.graph.initializer if one.name == "first.weight").name = "another"
    files = {"half": data[:1000], "renamed": model.SerializeToString()}
    for name, content in files.items():
        (tmp_path / f"{name}.onnx").write_bytes(content)
    with pytest.raises(DataError, match="no ONNX model, or damaged"):
        Beginning.read(tmp_path / "half.onnx")
    with pytest.raises(DataError, match="weights are not those of its network"):
        Beginning.read(tmp_path / "renamed.onnx")
