"""Pasts: forward runs, from whose ends control is learned as the way back."""

from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import Self

import numpy as np
import numpy.typing as npt

from hybridmpm import MpmSolver, scenarios
from hybridmpm._support.files import replacing
from hybridmpm._support.machine import usable_cores
from hybridmpm.control.methods.learned.features import State
from hybridmpm.errors import DataError, SimulationError
from hybridmpm.scene import Scene
from hybridmpm.scene.particle_types import SAND

STRIDE = 10
"""Frames from one state to the next."""
STATES = 21
"""States of a past, the first at frame 0."""
_STEPS = 65535
"""Steps into which the side of the world box is divided, to store positions in two bytes."""


@dataclass(frozen=True, eq=False)
class Past:
    """A forward run of N particles in D dimensions."""

    x: npt.NDArray[np.uint16]
    """Positions (`STATES`, N, D) over the side of the world box, times 65535."""
    v: npt.NDArray[np.float16]
    """Velocities (`STATES`, N, D) [m/s]."""
    scene: Scene
    mass: npt.NDArray[np.float32]
    """(N,) [kg]."""
    sand: npt.NDArray[np.bool_]
    """Which particles are sand (N,)."""

    @property
    def seconds(self) -> float:
        """Time from one state to the next [s]."""
        return STRIDE * self.scene.frame_dt

    @classmethod
    def simulated(cls, scene: Scene) -> Self:
        """Run a scene.

        Raises
        ------
        SimulationError
            A frame failed.
        """
        solver = MpmSolver(scene)
        x, v = [solver.positions], [solver.velocities]
        for _ in range(STATES - 1):
            solver.advance(STRIDE)
            x.append(solver.positions)
            v.append(solver.velocities)
        return cls(
            x=np.round(np.clip(np.stack(x), 0.0, 1.0) * _STEPS).astype(np.uint16),
            v=np.stack(v).astype(np.float16),
            scene=scene,
            mass=solver.mass,
            sand=solver.materials == SAND,
        )

    def positions(self, index: int) -> npt.NDArray[np.float64]:
        """Return positions (N, D) of a state [m]."""
        return np.asarray(self.x[index] / _STEPS)

    def state(self, index: int) -> State:
        """Return a state as a transport network is told of it."""
        mass = self.mass.astype(np.float64)
        walls = self.scene.walls
        return State(
            x=self.positions(index),
            v=self.v[index].astype(np.float64),
            sand=self.sand,
            weight=mass / mass.sum(),
            particle_volume=self.scene.spacing**self.scene.dim,
            lower=np.array(walls.lower),
            upper=np.array(walls.upper),
            gravity=np.array(self.scene.gravity),
        )


def prepare(
    root: Path,
    scenario: str,
    seeds: Sequence[int],
    on_progress: Callable[[int], object] = lambda _count: None,
) -> None:
    """Make the missing pasts of a scenario; an interrupted call can be repeated.

    A scene that fails to simulate leaves no past.

    Parameters
    ----------
    root : Path
        Folder with a folder for each scenario.
    scenario : str
    seeds : sequence of int
    on_progress : callable
        Called with the number of pasts done since its last call.

    Raises
    ------
    ExportError
        A file cannot be written.
    """
    folder = root / scenario
    folder.mkdir(parents=True, exist_ok=True)
    todo = [seed for seed in seeds if not _file(folder, seed).exists()]
    with ThreadPoolExecutor(usable_cores()) as pool:
        for _ in pool.map(lambda seed: _make(folder, scenario, seed), todo):
            on_progress(1)


def missing(root: Path, scenario: str, seeds: Sequence[int]) -> int:
    """Return the number of pasts that `prepare` would make."""
    return sum(not _file(root / scenario, seed).exists() for seed in seeds)


def read(root: Path, scenario: str, seeds: Sequence[int]) -> list[Past]:
    """Return the pasts of some seeds, without those that could not be simulated.

    Raises
    ------
    DataError
        A file is damaged, or there is none at all.
    """
    found = [_read(_file(root / scenario, seed), scenario, seed) for seed in seeds]
    pasts = [past for past in found if past is not None]
    if not pasts:
        raise DataError(f"{root / scenario} holds no past of the {len(seeds)} seeds: delete the folder")
    return pasts


def _file(folder: Path, seed: int) -> Path:
    return folder / f"{seed:07d}.npz"


def _make(folder: Path, scenario: str, seed: int) -> None:
    try:
        past = Past.simulated(scenarios.get(scenario, seed))
        columns = {"x": past.x, "v": past.v, "mass": past.mass, "sand": past.sand}
    except SimulationError:
        columns = {}
    with replacing(_file(folder, seed)) as part:
        np.savez(part, **columns)  # type: ignore[arg-type]


def _read(path: Path, scenario: str, seed: int) -> Past | None:
    try:
        with np.load(path, allow_pickle=False) as file:
            if not file.files:
                return None
            columns = {name: file[name] for name in ("x", "v", "mass", "sand")}
    except (OSError, ValueError, KeyError) as error:
        raise DataError(f"{path} is damaged ({error}): delete it, and it is made anew") from None
    return Past(scene=scenarios.get(scenario, seed), **columns)
