"""Other solvers that ours is measured beside: Taichi, its fork quadrants, and Warp.

Each runs in a process of its own: Taichi and its fork cannot share one, and their threads stay apart.
"""

import importlib
import importlib.util
import os
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from multiprocessing import get_context
from multiprocessing.managers import BaseManager
from typing import Any

import numpy as np
import numpy.typing as npt

from hybridmpm.errors import ConfigError
from hybridmpm.scene import Scene

SOLVERS = ("taichi", "quadrants", "warp")
"""Packages in which a plain MLS-MPM solver is written; quadrants is Taichi's maintained fork."""
DEVICES = ("cpu", "cuda")
"""Devices on which the solvers of others run."""
_MODULES = {"taichi": "taichi_mpm", "quadrants": "taichi_mpm", "warp": "warp_mpm"}

State = tuple[npt.NDArray[np.float32], ...]


def require_installed(package: str) -> None:
    """Raise a `ConfigError` unless the package of a baseline is installed; does not import it."""
    try:
        found = importlib.util.find_spec(package) is not None
    except ValueError:  # a module that is blocked
        found = False
    if not found:
        raise ConfigError(f"the baseline {package} is not installed: pip install --editable lab")


class Baseline:
    """A package of `SOLVERS` on one of `DEVICES`, and its solvers of a scene by the way in which they run."""

    def __init__(self, package: str, device: str = "cpu") -> None:
        if package == "quadrants":
            # The fork has the same names; this is how programs written for Taichi run on it.
            os.environ.setdefault("ENABLE_QUADRANTS_HEADER_PRINT", "False")
            sys.modules["taichi"] = importlib.import_module("quadrants")
        self._module = importlib.import_module(f"hybridmpm_lab.speed.baselines.{_MODULES[package]}")
        self._device = device
        self._solvers: dict[str, Any] = {}
        self._state: State

    def start(self, scene: Scene, substeps: int, state: State | None = None) -> tuple[str, dict[str, int]]:
        """Make a solver of a scene for each way, with equal substeps a frame.

        `state` is the one that `restore` returns to: positions, velocities, affine matrices and volume
        ratios; that of the scene's bodies if absent. Returns name and version of the package, and the threads
        of the CPU of each way, none on a GPU.
        """
        x = scene.sample()
        still = np.zeros((*x.x.shape, scene.dim), np.float32)
        self._state = state or (x.x, x.v, still, np.ones(len(x.x), np.float32))
        self._solvers.clear()
        self._module.start(self._device)
        ways = self._module.WAYS[self._device]
        for way in ways:
            self._solvers[way] = self._module.Solver(scene, substeps=substeps, device=self._device, way=way)
            self.restore(way)
        return self._module.NAME, ways

    def restore(self, way: str, frames: int = 0) -> None:
        """Return a solver to the state some frames after that of `start`."""
        self._solvers[way].load(*self._state)
        self._solvers[way].advance(frames)

    def advance(self, way: str, frames: int) -> float:
        """Advance a solver, and return the time that it took [s]."""
        start = time.perf_counter()
        self._solvers[way].advance(frames)
        return time.perf_counter() - start

    def positions(self, way: str) -> Any:
        """Return the positions (N, D) of a solver [m]."""
        return self._solvers[way].positions


class _Processes(BaseManager):
    """Starts a process whose objects are called from here."""

    Baseline: Callable[[str, str], Baseline]


_Processes.register("Baseline", Baseline)


@contextmanager
def baseline_process(package: str, device: str = "cpu") -> Iterator[Baseline]:
    """Yield a `Baseline` in a process of its own, which ends with the block; errors there are raised here."""
    with _Processes(ctx=get_context("spawn")) as process:
        yield process.Baseline(package, device)
