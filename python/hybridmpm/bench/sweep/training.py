"""Networks of a sweep: trained for some minutes, or with random weights for their latency alone."""

import functools
import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import torch

from hybridmpm.bench.accuracy.methods import RATIOS
from hybridmpm.bench.sweep.sweep import SCENARIOS, Point, Settings
from hybridmpm.data import Recipe, Trajectory, simulate
from hybridmpm.physics.model import NeuralModel
from hybridmpm.physics.model_info import ModelInfo
from hybridmpm.physics.spec import HISTORY, NetworkSpec, Normalization
from hybridmpm.training import checkpoint, run
from hybridmpm.training.export import described, export_checkpoint, to_onnx
from hybridmpm.training.physics.scales import normalization
from hybridmpm.training.physics.simulator import LearnedSimulator
from hybridmpm.training.physics.trainer import Trainer, TrainingSettings
from hybridmpm.training.physics.windows import Windows

_FINAL_RATE = 3e-5
_HELD_OUT_SEED = 1_000_000
_LOOKED_AT = HISTORY + 10
"""States of the held-out trajectory: a picture at the end is not to take longer than the training."""
_PROBE_SECONDS = 3.0
_MODEL = "model.onnx"


@dataclass(frozen=True, kw_only=True)
class Network:
    """A network of a sweep, ready to be served."""

    model: NeuralModel
    steps: int
    """Of training; 0 with random weights."""
    seconds: float
    """Spent on them."""


def untrained(point: Point, settings: Settings) -> Network:
    """Return the network with random weights: what it answers is nothing, how long it takes is exact."""
    spec = point.spec(settings.relaxations)
    # Scenario and length of a step are constants in it: points that differ in them take as long.
    data, like = _random(replace(spec, scenarios=SCENARIOS[:1], r_t=1), settings.seed)
    data = described(data, replace(like, spec=spec))
    return Network(model=NeuralModel(data, where=point.key, threads=settings.threads), steps=0, seconds=0.0)


@functools.cache
def _random(spec: NetworkSpec, seed: int) -> tuple[bytes, ModelInfo]:
    torch.manual_seed(seed)
    # Small, so that what happens counts as a disturbance and the network is run.
    unit = (1e-3,) * spec.dim
    none = (0.0,) * spec.dim
    scales = Normalization(
        velocity_mean=none, velocity_std=unit, acceleration_mean=none, acceleration_std=unit, noise_std=0.0
    )
    simulator = LearnedSimulator(spec, scales)
    parameters = sum(parameter.numel() for parameter in simulator.parameters())
    info = ModelInfo(spec=spec, scales=scales, parameters=parameters, training={})
    return to_onnx(simulator, info), info


def trained(point: Point, minutes: float, settings: Settings, folder: Path, device: torch.device) -> Network:
    """Train the network, going on from where an interrupted training stopped.

    Parameters
    ----------
    point : Point
    minutes : float
        From the start of training to its end; the learning rate decays over as many steps as fit.
    settings : Settings
    folder : Path
        Gets a folder with checkpoint, logs and the exported model.
    device : torch.device

    Raises
    ------
    ConfigError
        The loss is no longer finite.
    DataError, ExportError
        A file is damaged, or cannot be written.
    """
    mine = folder / f"{point.key}-{minutes:g}min"
    mine.mkdir(parents=True, exist_ok=True)
    file = mine / run.CHECKPOINT
    training = _trajectories(point.scenario, point.ratio, point.r_t, settings)
    if file.exists():
        trainer = checkpoint.load(file, device)
    else:
        trainer = _new(point, minutes, settings, training, device)
    about = {"command": f"hybridmpm bench sweep --points {point.key} --minutes-per-point {minutes:g}"}
    run.train(
        trainer,
        mine,
        training,
        [_held_out(point.scenario, point.ratio, point.r_t)],
        about=about,
        rhythm=run.Rhythm(rollout_seconds=float("inf")),
        on_step=lambda _trainer, _loss: None,
    )
    data, _ = export_checkpoint(file)
    (mine / _MODEL).write_bytes(data)
    model = NeuralModel(data, where=point.key, threads=settings.threads)
    return Network(model=model, steps=trainer.step_count, seconds=trainer.seconds)


def _new(
    point: Point, minutes: float, settings: Settings, training: Sequence[Trajectory], device: torch.device
) -> Trainer:
    """Begin a training of as many steps as fit into the time."""
    spec = point.spec(settings.relaxations)
    plan = TrainingSettings(
        steps=1,
        batch=settings.batch,
        unroll=settings.unroll,
        seed=settings.seed,
        final_rate=_FINAL_RATE,
    )
    scales = normalization(training, spec, plan.noise)
    windows = Windows(training, settings.unroll)
    # As many steps as lengths of unrolling are a round, with the mixture of the whole training.
    probe = Trainer(spec, scales, replace(plan, steps=settings.unroll), device)
    _round(probe, windows)
    began, rounds = time.perf_counter(), 0
    while time.perf_counter() - began < _PROBE_SECONDS:
        _round(probe, windows)
        rounds += 1
    each = (time.perf_counter() - began) / (rounds * settings.unroll)
    steps = max(1, round(60.0 * minutes / each))
    return Trainer(spec, scales, replace(plan, steps=steps), device)


def _round(probe: Trainer, windows: Windows) -> None:
    probe.step_count = 0
    for _ in range(probe.settings.steps):
        probe.step(windows)


@functools.lru_cache(maxsize=1)
def _trajectories(scenario: str, ratio: str, r_t: int, settings: Settings) -> tuple[Trajectory, ...]:
    """Simulate the training data; the points that share them follow each other."""
    recipe = _recipe(scenario, ratio, r_t, settings.frames)
    return tuple(simulate(recipe, seed) for seed in range(settings.trajectories))


def _held_out(scenario: str, ratio: str, r_t: int) -> Trajectory:
    return simulate(_recipe(scenario, ratio, r_t, _LOOKED_AT * r_t), _HELD_OUT_SEED)


def _recipe(scenario: str, ratio: str, r_t: int, frames: int) -> Recipe:
    return Recipe(scenario=scenario, frames=frames // r_t * r_t, stride=r_t, r_p=RATIOS[ratio])
