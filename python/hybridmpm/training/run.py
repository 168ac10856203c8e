"""A training run in a folder, with checkpoints, logs and validation; it can be interrupted and resumed."""

import json
import signal
import threading
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from hybridmpm.errors import ConfigError
from hybridmpm.training import checkpoint
from hybridmpm.training.trainable import Trainable

CHECKPOINT = "checkpoint.pt"
LOSSES = "losses.jsonl"
VALIDATION = "validation.jsonl"

_LOGGED_STEPS = 100
"""Number of steps whose mean loss is a row of the log."""


def train(
    trainer: Trainable[Any],
    folder: Path,
    *,
    step: Callable[[], float],
    validate: Callable[[], object],
    about: Mapping[str, str],
    on_step: Callable[[float], object],
    until: int | None = None,
    checkpoint_seconds: float = 120.0,
    validation_seconds: float = 240.0,
) -> None:
    """Train to the last step, with a checkpoint at the end and on any exception.

    The first Ctrl-C or SIGTERM ends the training after its step, the second one at once.

    Parameters
    ----------
    trainer : Trainable
    folder : Path
        Folder for `checkpoint.pt` and `losses.jsonl`.
    step : callable
        Takes one training step of the trainer, and returns the loss before it. It raises FloatingPointError
        where the loss is not finite.
    validate : callable
        Called now and then, and at the end, to hold the network against data that it is not trained on. Its
        time does not count as training.
    about : mapping
        Texts about the training, which are stored in the checkpoint.
    on_step : callable
        Called after each step with the loss.
    until : int, optional
        Step after which to stop before the last step.
    checkpoint_seconds, validation_seconds : float
        Time from one checkpoint and from one validation to the next [s]; the training does not depend on it.

    Raises
    ------
    ConfigError
        The loss is not finite; the last checkpoint, written before, stays.
    KeyboardInterrupt
        The training was ended, and its checkpoint is written.
    ExportError
        A file cannot be written.
    """
    began = time.monotonic() - trainer.seconds
    saved = shown = time.monotonic()
    losses: list[float] = []
    last = min(trainer.last_step, until or trainer.last_step)
    healthy = True
    with _interrupts() as interrupted:
        try:
            while trainer.step_count < last and not interrupted():
                latest = step()
                losses.append(latest)
                now = time.monotonic()
                trainer.seconds = now - began
                if len(losses) == _LOGGED_STEPS:
                    _log_losses(folder, trainer, losses)
                    losses.clear()
                if now - saved > checkpoint_seconds:
                    checkpoint.save(folder / CHECKPOINT, trainer, about)
                    saved = now
                if now - shown > validation_seconds:
                    validate()
                    began += time.monotonic() - now
                    shown = time.monotonic()
                on_step(latest)
        except FloatingPointError as error:
            healthy = False
            raise ConfigError(str(error)) from None
        except KeyboardInterrupt:
            healthy = False  # the second one, which broke off a step
            raise
        finally:
            if healthy:
                checkpoint.save(folder / CHECKPOINT, trainer, about)
        if interrupted():
            raise KeyboardInterrupt
    validate()


@contextmanager
def _interrupts() -> Iterator[Callable[[], bool]]:
    """Within the block, note the first SIGINT or SIGTERM; a second one raises KeyboardInterrupt.

    A step that is broken off would leave some weights changed, and others not.
    """
    noted: list[int] = []
    kinds = (signal.SIGINT, signal.SIGTERM)
    if threading.current_thread() is not threading.main_thread():  # others cannot have handlers
        yield lambda: False
        return

    def note(kind: int, _frame: object) -> None:
        if noted:
            raise KeyboardInterrupt
        noted.append(kind)

    before = {kind: signal.signal(kind, note) for kind in kinds}
    try:
        yield lambda: bool(noted)
    finally:
        for kind, handler in before.items():
            signal.signal(kind, handler)


def log_row(path: Path, row: Mapping[str, object]) -> None:
    """Add a row to a file of JSON lines, with six digits of each number."""
    plain = {key: float(f"{item:.6g}") if isinstance(item, float) else item for key, item in row.items()}
    with path.open("a", encoding="utf-8") as file:
        file.write(json.dumps(plain) + "\n")


def _log_losses(folder: Path, trainer: Trainable[Any], losses: Sequence[float]) -> None:
    row = {"step": trainer.step_count, "seconds": trainer.seconds, "loss": float(np.mean(losses))}
    log_row(folder / LOSSES, row | dict(trainer.pace()))
