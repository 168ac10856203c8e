"""Program of a process that simulates for a benchmark: another build of this library, or a solver of others.

`process.Worker` starts it and talks to it. Each solver of others has a process of its own, because Taichi and
its fork cannot share one. Another build of this library runs this very file with its own package: of
`hybridmpm` only names may be used here that all builds have.
"""

import importlib
import sys
import time
import traceback
from multiprocessing.connection import Connection
from typing import Any


class Build:
    """`MpmSolver` of the package that this process imports, by name of the simulation."""

    def __init__(self) -> None:
        self._solvers: dict[str, Any] = {}
        self._states: dict[str, bytes] = {}

    def make(self, name: str, scene: dict[str, Any], threads: int) -> None:
        """Make a simulation at the ground truth's substeps."""
        hybridmpm = importlib.import_module("hybridmpm")
        self._solvers[name] = hybridmpm.MpmSolver(
            hybridmpm.Scene.model_validate(scene), substeps="reference", threads=threads
        )

    def run_up(self, name: str, frames: int) -> None:
        """Advance, and take the state as the one that `restore` goes back to."""
        self._solvers[name].advance(frames)
        self._states[name] = self._solvers[name].snapshot()

    def restore(self, name: str) -> None:
        """Go back to the state of `run_up`."""
        self._solvers[name].restore(self._states[name])

    def advance(self, name: str, frames: int) -> float:
        """Advance, and return how long that took [s]."""
        began = time.perf_counter()
        self._solvers[name].advance(frames)
        return time.perf_counter() - began


class Peer:
    """Solver of others, from a module of this folder."""

    def __init__(self, package: str) -> None:
        loading = importlib.import_module("hybridmpm_lab.speed.baselines.loading")
        self._module = loading.peer_module(package, known=loading.SOLVERS)
        self._solvers: dict[str, Any] = {}
        self._state: tuple[Any, ...] = ()

    def name(self) -> str:
        """Return name and version of the package."""
        return str(self._module.NAME)

    def settings(self) -> dict[str, int]:
        """Return the ways in which the solver can run, and the threads of each."""
        return dict(self._module.SETTINGS)

    def start(self) -> None:
        """Start afresh; simulations made before are gone."""
        self._solvers.clear()
        self._module.start()

    def make(self, name: str, scene: dict[str, Any], substeps: int) -> None:
        """Make a simulation whose name is one of `settings`."""
        read = importlib.import_module("hybridmpm").Scene.model_validate
        self._solvers[name] = self._module.Solver(read(scene), substeps=substeps, setting=name)

    def take(self, *state: Any) -> None:
        """Take the state that `restore` puts into a simulation; see `load` of the solver."""
        self._state = state

    def restore(self, name: str) -> None:
        """Put the state into a simulation."""
        self._solvers[name].load(*self._state)

    def advance(self, name: str, frames: int) -> float:
        """Advance, and return how long that took [s]."""
        began = time.perf_counter()
        self._solvers[name].advance(frames)
        return time.perf_counter() - began

    def positions(self, name: str) -> Any:
        """Return positions (N, D) [m]."""
        return self._solvers[name].positions


def serve(link: Connection, package: str) -> None:
    """Answer calls until the other end is closed: with (True, result), or with (False, traceback)."""
    served: Build | Peer | None = None
    while True:
        try:
            method, arguments = link.recv()
        except EOFError:
            return
        try:
            if served is None:
                served = Build() if package == "hybridmpm" else Peer(package)
            answer = True, getattr(served, method)(*arguments)
        except Exception:  # noqa: BLE001 - told to the other end, whatever it is
            answer = False, traceback.format_exc()
        link.send(answer)


if __name__ == "__main__":
    serve(Connection(int(sys.argv[1])), sys.argv[2])
