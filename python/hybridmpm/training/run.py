"""A training run in a folder, with checkpoints, logs and rollouts; it can be interrupted and resumed."""

import csv
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from hybridmpm.data.trajectory import Trajectory
from hybridmpm.errors import ConfigError
from hybridmpm.physics.spec import HISTORY
from hybridmpm.training import checkpoint
from hybridmpm.training.physics import rollouts
from hybridmpm.training.physics.trainer import Trainer
from hybridmpm.training.physics.windows import Windows

CHECKPOINT = "checkpoint.pt"
LOSSES, ROLLOUTS = "losses.csv", "rollouts.csv"

_LOGGED_STEPS = 100
"""Number of steps whose mean loss is a row of the log."""


@dataclass(frozen=True, kw_only=True)
class Rhythm:
    """How often a run writes to its folder. The training does not depend on it."""

    checkpoint_seconds: float = 120.0
    """Time from one checkpoint to the next [s]."""
    rollout_seconds: float = 240.0
    """Time from one rollout on held-out trajectories to the next [s]."""


def train(
    trainer: Trainer,
    folder: Path,
    training: Sequence[Trajectory],
    held_out: Sequence[Trajectory],
    *,
    about: Mapping[str, str],
    rhythm: Rhythm,
    on_step: Callable[[Trainer, float], object],
    until: int | None = None,
) -> None:
    """Train to the last step of the settings, with a checkpoint at the end and on any exception.

    Parameters
    ----------
    trainer : Trainer
    folder : Path
        Folder for `checkpoint.pt`, `losses.csv`, `rollouts.csv` and `rollout.png`.
    training : sequence of Trajectory
        Trajectories to train on.
    held_out : sequence of Trajectory
        Trajectories for rollouts.
    about : mapping
        Texts about the training, which are stored in the checkpoint.
    rhythm : Rhythm
    on_step : callable
        Called after each step with the trainer and the loss.
    until : int, optional
        Step after which to stop before the last step of the settings.

    Raises
    ------
    ConfigError
        The loss is not finite; the last checkpoint, written before, stays.
    DataError
        `Windows` refuses the trajectories.
    ExportError
        A file cannot be written.
    """
    windows = Windows(training, trainer.settings.unroll)
    began = time.monotonic() - trainer.seconds
    saved = shown = time.monotonic()
    losses: list[float] = []
    last = min(trainer.settings.steps, until or trainer.settings.steps)
    healthy = True
    try:
        while trainer.step_count < last:
            latest = trainer.step(windows)
            losses.append(latest)
            now = time.monotonic()
            trainer.seconds = now - began
            if len(losses) == _LOGGED_STEPS:
                _log_losses(folder, trainer, losses)
                losses.clear()
            if now - saved > rhythm.checkpoint_seconds:
                checkpoint.save(folder / CHECKPOINT, trainer, dict(about))
                saved = now
            if now - shown > rhythm.rollout_seconds:
                log_rollouts(trainer, folder, held_out)
                began += time.monotonic() - now
                shown = time.monotonic()
            on_step(trainer, latest)
    except FloatingPointError as error:
        healthy = False
        raise ConfigError(str(error)) from None
    finally:
        if healthy:
            checkpoint.save(folder / CHECKPOINT, trainer, dict(about))
    log_rollouts(trainer, folder, held_out)


def log_rollouts(trainer: Trainer, folder: Path, held_out: Sequence[Trajectory]) -> None:
    """Roll out on held-out trajectories; add their errors to `rollouts.csv`, and draw `rollout.png`."""
    paths = [rollouts.rollout(trainer.simulator, trajectory) for trajectory in held_out]
    for trajectory, path in zip(held_out, paths, strict=True):
        errors = rollouts.errors(path, trajectory)[HISTORY:]
        at = {f"step_{step}": errors[step - 1] for step in (10, 25, 50) if step <= len(errors)}
        row = {
            "trained_steps": trainer.step_count,
            "scene": trajectory.scene.name if trajectory.scene else "",
            **at,
        }
        _append(folder / ROLLOUTS, row | {"mean": errors.mean()})
    rollouts.write_picture(folder / "rollout.png", held_out, paths)


def _log_losses(folder: Path, trainer: Trainer, losses: Sequence[float]) -> None:
    rate = trainer.settings.rate_at(trainer.step_count)
    row = {"step": trainer.step_count, "seconds": trainer.seconds, "loss": float(np.mean(losses))}
    unroll = trainer.settings.unroll_at(trainer.step_count - 1)
    _append(folder / LOSSES, row | {"learning_rate": rate, "unroll": unroll})


def _append(path: Path, row: Mapping[str, object]) -> None:
    fresh = not path.exists()
    with path.open("a", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, list(row))
        if fresh:
            writer.writeheader()
        writer.writerow(
            {key: f"{item:.6g}" if isinstance(item, float) else item for key, item in row.items()}
        )
