"""Executors, which make trajectories in parallel: threads of this process, or tasks of a Ray cluster.

Both give the same bytes. Executors write no file; the caller does.
"""

import importlib
import socket
import threading
from collections.abc import Generator, Iterable
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait
from dataclasses import dataclass
from typing import Any, Protocol

from hybridmpm._support.arguments import whole
from hybridmpm._support.machine import usable_cores
from hybridmpm.data import hdf5
from hybridmpm.data.generation.simulate import simulate
from hybridmpm.data.recipe import Recipe
from hybridmpm.errors import ConfigError, FrameCancelledError, SimulationError

_CONNECT_SECONDS = 10.0
"""Time to wait for a cluster that does not answer [s]."""
GROUP = "trajectory"
"""Key of the only trajectory in a shard."""


@dataclass(frozen=True, kw_only=True)
class Outcome:
    """Result of a seed: its trajectory, or why there is none."""

    seed: int
    shard: bytes | None = None
    """HDF5 file with the trajectory; None if the simulation failed."""
    failure: str | None = None
    """Reason why the simulation failed; None if it did not."""


class Executor(Protocol):
    """Makes trajectories in parallel."""

    def run(self, recipe: Recipe, seeds: Iterable[int]) -> Generator[Outcome]:
        """Yield the outcome of each seed as soon as it is done; closing the generator stops the others."""


def produce(recipe: Recipe, seed: int, stop: threading.Event | None = None) -> Outcome:
    """Simulate one seed. A failed simulation is an outcome, too; one that a `CancelFlag` ends is none."""
    try:
        trajectory = simulate(recipe, seed, stop=(lambda: False) if stop is None else stop.is_set)
    except FrameCancelledError:
        raise
    except SimulationError as error:
        return Outcome(seed=seed, failure=str(error))
    return Outcome(seed=seed, shard=hdf5.file_bytes(trajectory, GROUP))


class Threads:
    """Threads of this process; they run at once, since the solver releases Python's lock.

    Parameters
    ----------
    threads : int in [1, 1024], optional
        Number of trajectories made at a time; if absent, the number of cores that the process may use.
    """

    def __init__(self, threads: int | None = None) -> None:
        self._threads = usable_cores() if threads is None else whole("threads", threads, 1, 1024)

    def run(self, recipe: Recipe, seeds: Iterable[int]) -> Generator[Outcome]:
        """Yield the outcome of each seed; closing the generator stops the others within a few frames."""
        stop = threading.Event()
        todo = iter(seeds)
        running: set[Future[Outcome]] = set()
        with ThreadPoolExecutor(self._threads) as pool:
            try:
                while True:
                    # One seed waits for each at work. With more, shards would pile up before a slow disk.
                    while len(running) < 2 * self._threads and (seed := next(todo, None)) is not None:
                        running.add(pool.submit(produce, recipe, seed, stop))
                    if not running:
                        return
                    done, running = wait(running, return_when=FIRST_COMPLETED)
                    for future in done:
                        yield future.result()
            finally:
                stop.set()
                pool.shutdown(cancel_futures=True)


class RayTasks:
    """Tasks of an existing Ray cluster, each on one core. Its machines need this version of hybridmpm.

    Parameters
    ----------
    address : str
        Address of the cluster; "auto" finds the cluster that this machine belongs to.

    Raises
    ------
    ConfigError
        Ray is not installed, or no cluster answers at the address.
    """

    def __init__(self, address: str = "auto") -> None:
        try:
            self._ray: Any = importlib.import_module("ray")
        except ImportError:
            raise ConfigError(
                "the executor ray needs Ray; install it with: pip install 'hybridmpm[ray]'"
            ) from None
        if not self._ray.is_initialized():
            try:
                _require_listener(address)
                self._ray.init(address=address, log_to_driver=False, configure_logging=False)
            except (OSError, ValueError) as error:
                raise ConfigError(
                    f"no Ray cluster answers at {address!r}: start one with `ray start --head`, or give its "
                    f"address ({error})"
                ) from None

    def run(self, recipe: Recipe, seeds: Iterable[int]) -> Generator[Outcome]:
        """Yield the outcome of each seed; closing the generator cancels the others."""
        task = self._ray.remote(num_cpus=1, max_retries=2)(produce)
        at_once = 2 * max(1, int(self._ray.cluster_resources().get("CPU", 1)))
        todo = iter(seeds)
        running: dict[Any, int] = {}
        try:
            while True:
                while len(running) < at_once and (seed := next(todo, None)) is not None:
                    running[task.remote(recipe, seed)] = seed
                if not running:
                    return
                (done,), _ = self._ray.wait(list(running), num_returns=1)
                yield self._outcome(done, running.pop(done))
        finally:
            for reference in running:
                self._ray.cancel(reference, force=True)

    def _outcome(self, reference: Any, seed: int) -> Outcome:
        try:
            outcome: Outcome = self._ray.get(reference)
        except self._ray.exceptions.RayError as error:
            return Outcome(seed=seed, failure=f"its Ray task died: {str(error).splitlines()[0]}")
        return outcome


def _require_listener(address: str) -> None:
    """Raise OSError where no process listens at host:port; Ray itself would retry for minutes."""
    host, colon, port = address.rpartition("://")[2].rpartition(":")
    if colon:
        socket.create_connection((host, int(port)), timeout=_CONNECT_SECONDS).close()
