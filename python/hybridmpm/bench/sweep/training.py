"""Networks of a sweep: trained for some minutes, or with random weights for their latency alone."""

import functools
import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import torch

from hybridmpm import SOLVER_VERSION
from hybridmpm.bench.accuracy.conventions import RATIOS
from hybridmpm.bench.sweep.family import SCENARIOS, Point, SweepSettings
from hybridmpm.data import Recipe, Trajectory, simulate
from hybridmpm.physics.model import NeuralModel
from hybridmpm.physics.model_info import ModelInfo
from hybridmpm.physics.spec import HISTORY, NetworkSpec, Normalization
from hybridmpm.training import checkpoint, run
from hybridmpm.training.export import described, export_checkpoint, to_onnx
from hybridmpm.training.physics.network.simulator import LearnedSimulator
from hybridmpm.training.physics.rollouts import log_rollouts
from hybridmpm.training.physics.scales import normalization
from hybridmpm.training.physics.trainer import Trainer, TrainingSettings
from hybridmpm.training.physics.windows import Windows

_FINAL_RATE = 3e-5
_HELD_OUT_SEED = 1_000_000
_HELD_OUT_STATES = HISTORY + 10
"""States of the held-out trajectory: few, so that the picture at the end is quick."""
_PROBE_SECONDS = 3.0
"""Time in which the length of a training step is measured."""
_MODEL = "model.onnx"


@dataclass(frozen=True, kw_only=True)
class Network:
    """A network of a sweep, ready to be served."""

    model: NeuralModel
    """The network as it is served."""
    steps: int
    """Number of training steps; 0 with random weights."""
    seconds: float
    """Time of the training steps [s]."""


def untrained(point: Point, settings: SweepSettings) -> Network:
    """Return the network with random weights: its answers mean nothing, but its latency is exact."""
    spec = point.spec(settings.relaxations)
    # Scenario and r_t are constants in the network: points that differ in them alone take the same time.
    data, like = _random(replace(spec, scenarios=SCENARIOS[:1], r_t=1), settings.seed)
    data = described(data, replace(like, spec=spec))
    return Network(model=NeuralModel(data, where=point.key, threads=settings.threads), steps=0, seconds=0.0)


@functools.cache
def _random(spec: NetworkSpec, seed: int) -> tuple[bytes, ModelInfo]:
    torch.manual_seed(seed)
    # Small scales, so that all motion counts as a disturbance and the network is run.
    unit = (1e-3,) * spec.dim
    none = (0.0,) * spec.dim
    scales = Normalization(
        velocity_mean=none, velocity_std=unit, acceleration_mean=none, acceleration_std=unit, noise_std=0.0
    )
    simulator = LearnedSimulator(spec, scales)
    parameters = sum(parameter.numel() for parameter in simulator.parameters())
    info = ModelInfo(spec=spec, scales=scales, parameters=parameters, training={})
    return to_onnx(simulator, info), info


def trained(
    point: Point, minutes: float, settings: SweepSettings, folder: Path, device: torch.device
) -> Network:
    """Train the network, going on from where an interrupted training stopped.

    Parameters
    ----------
    point : Point
    minutes : float
        Time of the training; the learning rate decays over as many steps as fit into it.
    settings : SweepSettings
    folder : Path
        Folder for the folder of this training, with checkpoint, logs and the exported model.
    device : torch.device
        Device of the training.

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
    versions = str(SOLVER_VERSION)
    if file.exists():
        trainer = Trainer.load(file, device)
        versions = checkpoint.with_this_solver(checkpoint.read(file)["about"])
    else:
        trainer = _new(point, minutes, settings, training, device)
    about = {
        "command": f"hybridmpm bench sweep --points {point.key} --minutes-per-point {minutes:g}",
        "solver_versions": versions,
    }
    windows = Windows(training, trainer.settings.unroll, step_dt=trainer.spec.step_dt)
    held_out = [_held_out(point.scenario, point.ratio, point.r_t)]
    run.train(
        trainer,
        mine,
        step=functools.partial(trainer.step, windows),
        validate=functools.partial(log_rollouts, trainer, mine, held_out),
        about=about,
        rhythm=run.Rhythm(validation_seconds=float("inf")),
        on_step=lambda _loss: None,
    )
    data, _ = export_checkpoint(file)
    (mine / _MODEL).write_bytes(data)
    model = NeuralModel(data, where=point.key, threads=settings.threads)
    return Network(model=model, steps=trainer.step_count, seconds=trainer.seconds)


def _new(
    point: Point,
    minutes: float,
    settings: SweepSettings,
    training: Sequence[Trajectory],
    device: torch.device,
) -> Trainer:
    """Return a training of as many steps as fit into the time."""
    spec = point.spec(settings.relaxations)
    plan = TrainingSettings(
        steps=1,
        batch=settings.batch,
        unroll=settings.unroll,
        seed=settings.seed,
        final_rate=_FINAL_RATE,
    )
    scales = normalization(training, spec, plan.noise)
    windows = Windows(training, settings.unroll, step_dt=spec.step_dt)
    # A round has as many steps as there are lengths of unrolling: the mixture of the whole training.
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
def _trajectories(scenario: str, ratio: str, r_t: int, settings: SweepSettings) -> tuple[Trajectory, ...]:
    """Simulate the training data of one point, kept for the next, which often has the same."""
    recipe = _recipe(scenario, ratio, r_t, settings.frames)
    return tuple(simulate(recipe, seed) for seed in range(settings.trajectories))


def _held_out(scenario: str, ratio: str, r_t: int) -> Trajectory:
    return simulate(_recipe(scenario, ratio, r_t, _HELD_OUT_STATES * r_t), _HELD_OUT_SEED)


def _recipe(scenario: str, ratio: str, r_t: int, frames: int) -> Recipe:
    return Recipe(scenario=scenario, frames=frames // r_t * r_t, stride=r_t, r_p=RATIOS[ratio])
