"""Small untrained networks, in torch and exported.

An export takes seconds, so each network is exported once: that in 2D by a call, that in 3D by the command.
"""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
import torch
from click.testing import CliRunner, Result

from hybridmpm import Scene
from hybridmpm.cli import cli
from hybridmpm.physics import ModelInfo, NetworkSpec, NeuralModel, Normalization
from hybridmpm.training import checkpoint
from hybridmpm.training.export import to_onnx
from hybridmpm.training.physics.network.simulator import LearnedSimulator
from hybridmpm.training.physics.trainer import Trainer
from hybridmpm.training.physics.windows import edges_of
from hybridmpm.training.settings import TrainingSettings

_Floats = npt.NDArray[np.float32]
Make = Callable[..., LearnedSimulator]


def make_simulator(*, scale: float = 0.2, seed: int = 0, **changes: Any) -> LearnedSimulator:
    """Return a network with random weights, whose accelerations are some `scale` of their deviation."""
    settings = {
        "scenarios": ("water_2d", "water_ramps_2d"),
        "latent": 8,
        "layers": 2,
        "hidden_layers": 2,
        "radius": 0.0275,
        "r_p": 1 / 8,
        "r_t": 4,
    }
    spec = NetworkSpec(**{**settings, **changes})
    scales = Normalization(
        velocity_mean=(0.0, -0.002, 0.0)[: spec.dim],
        velocity_std=(0.004, 0.006, 0.005)[: spec.dim],
        acceleration_mean=(0.0, 0.0002, 0.0)[: spec.dim],
        acceleration_std=(0.0006, 0.0008, 0.0007)[: spec.dim],
        noise_std=1e-4,
    )
    torch.manual_seed(seed)
    simulator = LearnedSimulator(spec, scales)
    with torch.no_grad():
        for parameter in simulator.network.decoder.node_rest.parameters():
            parameter.mul_(scale)
    return simulator.eval()


def export(simulator: LearnedSimulator) -> bytes:
    """Return it as an ONNX file with a made-up origin."""
    training = {
        "command": "hybridmpm train physics",
        "data": "none",
        "seconds": "60",
        "solver_versions": "1, 2",
    }
    rows = [{"scenario": "water_2d", "frame": 40, "error": 0.5}]
    info = ModelInfo(
        spec=simulator.spec, scales=simulator.scales, parameters=123, training=training, errors=rows
    )
    return to_onnx(simulator, info)


def save_checkpoint(simulator: LearnedSimulator, path: Path) -> None:
    """Save it as the training of an hour would, after 70 steps."""
    trainer = Trainer(simulator.spec, simulator.scales, TrainingSettings(steps=1), torch.device("cpu"))
    trainer.simulator.load_state_dict(simulator.state_dict())
    trainer.step_count, trainer.seconds = 70, 3600.0
    checkpoint.save(path, trainer, {"command": "hybridmpm train", "machine": "a processor, 2 cores"})


def run_export(*arguments: object) -> Result:
    """Return what `hybridmpm export` says to some arguments."""
    return CliRunner().invoke(cli, ["export", *map(str, arguments)], prog_name="hybridmpm")


class TorchStepper:
    """A `Stepper` that runs the network in torch."""

    def __init__(self, simulator: LearnedSimulator) -> None:
        self.simulator = simulator
        self.r_p, self.r_t = simulator.spec.r_p, simulator.spec.r_t

    def check(self, scene: Scene) -> None:
        """Take any scene."""

    @torch.no_grad()
    def step(
        self, history: _Floats, types: npt.NDArray[np.int64], acceleration: _Floats, walls: _Floats
    ) -> _Floats:
        """Return positions one step later."""
        x, kinds = torch.from_numpy(history), torch.from_numpy(types)
        graph = edges_of(x[-1], kinds, (len(types),), self.simulator.spec.radius)
        known = (torch.from_numpy(acceleration), torch.from_numpy(walls))
        after: _Floats = self.simulator(x, kinds, *known, graph).numpy()
        return after


@pytest.fixture(scope="session", autouse=True)
def _one_thread() -> None:
    torch.set_num_threads(1)


@pytest.fixture(scope="session")
def simulator() -> LearnedSimulator:
    """Return a small network for water in 2D, with and without ramps."""
    return make_simulator()


@pytest.fixture(scope="session")
def simulator_3d() -> LearnedSimulator:
    """Return a small network for sand in 3D, with a grid branch."""
    return make_simulator(scenarios=("sand_3d",), radius=0.03, hidden_layers=1, grid_cells=6)


@pytest.fixture(scope="session")
def model_file(simulator: LearnedSimulator, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the exported `simulator`."""
    path = tmp_path_factory.mktemp("models") / "small.onnx"
    path.write_bytes(export(simulator))
    return path


@pytest.fixture(scope="session")
def exported_3d(
    simulator_3d: LearnedSimulator, tmp_path_factory: pytest.TempPathFactory
) -> tuple[Result, Path]:
    """Return what `hybridmpm export` says when it exports a checkpoint of `simulator_3d`, and its file."""
    folder = tmp_path_factory.mktemp("command")
    save_checkpoint(simulator_3d, folder / "checkpoint.pt")
    spec = simulator_3d.spec
    own = {"scenario": spec.scenarios[0], "method": "neural", "error_40": 0.25, "ms_p95": 3.0}
    of_others = [
        {**own, "scenario": "sand_ramps_2d"},
        {**own, "method": "mpm", "r_p": 2 * spec.r_p},
        {**own, "method": "still", "warm_up": 5 * spec.r_t + 1},
    ]
    (folder / "errors.json").write_text(json.dumps([own, *of_others]))
    out = folder / "model.onnx"
    result = run_export(folder / "checkpoint.pt", "--out", out, "--errors", folder / "errors.json")
    return result, out


@pytest.fixture(scope="session")
def model_file_3d(exported_3d: tuple[Result, Path]) -> Path:
    """Return the exported `simulator_3d`."""
    return exported_3d[1]


@pytest.fixture(scope="session")
def model(model_file: Path) -> NeuralModel:
    """Return `simulator` as it is served."""
    return NeuralModel.load(model_file)


@pytest.fixture(scope="session")
def model_3d(model_file_3d: Path) -> NeuralModel:
    """Return `simulator_3d` as it is served."""
    return NeuralModel.load(model_file_3d)


def random_inputs(
    rng: np.random.Generator, count: int, dim: int, *, kinematic: int = 0, width: float = 0.8
) -> dict[str, Any]:
    """Draw what `Stepper.step` takes: particles in a box of a width [m], moving about 4 mm a step."""
    x = rng.uniform(0.1, 0.1 + width, (count, dim))
    ways = np.cumsum(rng.normal(0, 0.004, (6, count, dim)), axis=0)
    types = np.full(count, 5)
    types[count - kinematic :] = 3
    ways[:, types == 3] = 0
    return {
        "history": np.clip(x + ways, 0.1, 0.9).astype(np.float32),
        "types": types,
        "acceleration": rng.normal(0, 5, (count, dim)).astype(np.float32),
        "walls": np.array([[0.1] * dim, [0.9] * dim], dtype=np.float32),
    }
