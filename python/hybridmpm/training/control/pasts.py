"""Pasts: forward runs, from whose ends control is learned as the way back."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Self

import numpy as np
import numpy.typing as npt

from hybridmpm import scenarios
from hybridmpm.control.methods.learned.features import State
from hybridmpm.mpm import MpmSolver
from hybridmpm.scene import Scene
from hybridmpm.scene.particle_types import SAND
from hybridmpm.training.control import scene_files

STRIDE = 10
"""Frames from one state to the next."""
STATES = 21
"""States of a past, the first at frame 0."""
_COLUMNS = ("x", "v", "mass", "sand")
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
    """Whether each particle is sand (N,)."""

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
        """Return a state, for the features of a transport network."""
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
    """Make the missing pasts of a scenario in a folder of it; see `scene_files.prepare`."""
    scene_files.prepare(root, scenario, seeds, _columns, on_progress)


def read(root: Path, scenario: str, seeds: Sequence[int]) -> list[Past]:
    """Return the pasts of some seeds, without those that could not be simulated.

    Raises
    ------
    DataError
        A file is damaged, or there is none at all.
    """
    return [
        Past(scene=scenarios.get(scenario, seed), **columns)
        for seed, columns in scene_files.read(root, scenario, seeds, _COLUMNS)
    ]


def _columns(scenario: str, seed: int) -> scene_files.Columns:
    past = Past.simulated(scenarios.get(scenario, seed))
    return {name: getattr(past, name) for name in _COLUMNS}
