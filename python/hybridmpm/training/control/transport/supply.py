"""Batches for the training of a transport network, made ahead of it by another process."""

import multiprocessing
import queue
import signal
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import Any, Self

import numpy as np
import numpy.typing as npt
import torch
from torch import Tensor

from hybridmpm.control.methods.learned.spec import TransportSpec
from hybridmpm.errors import DataError, SimulationError
from hybridmpm.training.control import pasts
from hybridmpm.training.control.pasts import Past
from hybridmpm.training.control.transport.windows import Batch, batch_of, drawn
from hybridmpm.training.settings import TransportSettings
from hybridmpm.training.sources import DataSet, Source

_AHEAD = 8
"""Largest number of batches that wait."""
_PATIENCE = 5.0
"""Time after which the training checks that the other process is alive [s]."""

Arrays = dict[str, npt.NDArray[np.float32]]


def batch_at(
    step: int, found: Sequence[Past], spec: TransportSpec, settings: TransportSettings
) -> tuple[Batch, Tensor]:
    """Return the batch of a training step, and the times (B,) of its samples in the flow.

    They depend on seed, step and pasts alone, so a training may be interrupted anywhere.
    """
    rng = np.random.default_rng([settings.seed, step])
    samples = [drawn(rng, found, shortest=spec.shortest, longest=spec.longest) for _ in range(settings.batch)]
    batch = batch_of(rng, samples, settings.particles, obstacles=spec.obstacles)
    time = rng.random(settings.batch) * (rng.random(settings.batch) < settings.flow)
    return batch, torch.from_numpy(time.astype(np.float32))


@dataclass(frozen=True)
class Stock:
    """Forward runs of sources, those of `Drawn` in a folder, from which batches are drawn."""

    root: Path
    sources: Sequence[Source]
    seeds: range
    spec: TransportSpec
    settings: TransportSettings

    def read(self) -> list[Past]:
        """Return the pasts of all sources.

        Raises
        ------
        DataError
            A file is damaged, or a source has none.
        """
        return [past for one in self.sources for past in pasts_of(self.root, one, self.seeds, "train")]


def pasts_of(root: Path, source: Source, seeds: range, split: str) -> list[Past]:
    """Return the pasts of a source: of seeds, or of a split of a data set; errors as `Stock.read`."""
    if isinstance(source, DataSet):
        return list(pasts.read_examples(source, split))
    return pasts.read(root, source, seeds)


class Supply:
    """Batches of successive steps, made by a process of their own while the training uses those before.

    Parameters
    ----------
    stock : Stock
    first : int
        Step of the first batch.
    """

    def __init__(self, stock: Stock, first: int) -> None:
        # A forked process would inherit the locks of torch's threads.
        context = multiprocessing.get_context("spawn")
        self._queue: Any = context.Queue(_AHEAD)
        self._process = context.Process(target=_make, args=(stock, first, self._queue), daemon=True)

    def __enter__(self) -> Self:
        self._process.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._process.terminate()
        self._process.join()

    def take(self) -> tuple[Batch, Tensor]:
        """Return the next batch, and the times (B,) of its samples in the flow.

        Raises
        ------
        DataError
            The runs cannot be read, or the process that makes batches has ended.
        """
        while True:
            try:
                made = self._queue.get(timeout=_PATIENCE)
            except queue.Empty:
                if self._process.is_alive():
                    continue
                code = self._process.exitcode
                raise DataError(
                    f"the process that makes batches ended with {code}: run the command again"
                ) from None
            if isinstance(made, str):
                raise DataError(made)
            tensors = {name: torch.from_numpy(array) for name, array in made.items()}
            time = tensors.pop("time")
            return Batch(**tensors), time


def _make(stock: Stock, first: int, batches: Any) -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the training ends this process after its last step
    try:
        found = stock.read()
        step = first
        while True:
            batch, time = batch_at(step, found, stock.spec, stock.settings)
            arrays: Arrays = {name: tensor.numpy() for name, tensor in vars(batch).items()}
            _put(batches, arrays | {"time": time.numpy()})
            step += 1
    except SimulationError as error:
        _put(batches, str(error))


def _put(batches: Any, made: Arrays | str) -> None:
    """Wait for room for a batch, unless the training has ended."""
    waiting = True
    while waiting:
        try:
            batches.put(made, timeout=_PATIENCE)
            waiting = False
        except queue.Full:
            training = multiprocessing.parent_process()
            if training is None or not training.is_alive():
                batches.cancel_join_thread()  # nobody reads what still waits, so the process would never end
                raise SystemExit from None
