"""Pasts: forward runs, from whose ends control is learned as the way back."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any, Self

import numpy as np
import numpy.typing as npt

from hybridmpm import data
from hybridmpm.coarse.merging import spacing_at
from hybridmpm.control import Sketch
from hybridmpm.control.goal.room import Room
from hybridmpm.control.methods.learned.features import State, distances
from hybridmpm.errors import DataError
from hybridmpm.mpm import MpmSolver
from hybridmpm.scene import Scene
from hybridmpm.scene.particle_types import KINEMATIC, SAND
from hybridmpm.training.control import scene_files
from hybridmpm.training.sources import DataSet, Drawn, check_particles, scene_of

STRIDE = 10
"""Frames from one state to the next."""
STATES = 21
"""States of a past, the first at frame 0."""
_COLUMNS = ("x", "v", "mass", "sand")
_STEPS = 65535
"""Steps into which the side of the world box is divided, to store positions in two bytes."""


@dataclass(frozen=True, eq=False)
class Past:
    """F states of a forward run of N particles in D dimensions: `STATES`, or two of an example of control."""

    x: npt.NDArray[np.uint16]
    """Positions (F, N, D) over the side of the world box, times 65535."""
    v: npt.NDArray[np.float16]
    """Velocities (F, N, D) [m/s]."""
    scene: Scene
    mass: npt.NDArray[np.float32]
    """(N,) [kg]."""
    sand: npt.NDArray[np.bool_]
    """Whether each particle is sand (N,)."""

    stride: int = STRIDE
    """Frames from one state to the next."""
    r_p: float = 1.0
    """Number of particles over that of the scene."""
    sketch: Sketch | None = None
    """Sketch of an example of control; None for a run, on which any may be drawn."""

    @property
    def seconds(self) -> float:
        """Time from one state to the next [s]."""
        return self.stride * self.scene.frame_dt

    def ways(self) -> npt.NDArray[np.float64]:
        """Return the distance of the centre of mass between any two states (F, F) [m]."""
        share = self.mass.astype(np.float64) / self.mass.sum(dtype=np.float64)
        middle = np.einsum("n,fnd->fd", share, self.x / _STEPS)
        return np.asarray(np.linalg.norm(middle[:, None] - middle, axis=2))

    @classmethod
    def simulated(cls, scene: Scene) -> Self:
        """Run a scene.

        Raises
        ------
        SimulationError
            A frame failed.
        DataError
            There are too few particles.
        """
        solver = MpmSolver(scene)
        check_particles(scene, solver.particle_count)
        x, v = [solver.positions], [solver.velocities]
        for _ in range(STATES - 1):
            solver.advance(STRIDE)
            x.append(solver.positions)
            v.append(solver.velocities)
        return cls(
            x=_stored(np.stack(x)),
            v=np.stack(v).astype(np.float16),
            scene=scene,
            mass=solver.mass,
            sand=solver.materials == SAND,
        )

    @classmethod
    def of_example(cls, trajectory: data.Trajectory, stride: int, r_p: float) -> Self:
        """Return the two states of a trajectory that is an example of control, the end of it first.

        Raises
        ------
        DataError
            It is none, or has no scene.
        """
        control, moving = trajectory.control, trajectory.types != KINEMATIC
        if control is None or trajectory.mass is None:
            raise DataError(
                f"{trajectory.place.file}: {trajectory.place.position} is no example of control; make a "
                "data set of such by hybridmpm dataset generate --control"
            )
        start, v = trajectory.positions[0, moving], control.velocity[moving]
        v = v if control.start == "live" else -v
        return cls(
            x=_stored(np.stack([control.target[moving], start])),
            v=np.stack([np.zeros_like(v), v]).astype(np.float16),
            scene=scene_of(trajectory),
            mass=trajectory.mass[moving],
            sand=trajectory.types[moving] == SAND,
            stride=stride,
            r_p=r_p,
            sketch=control.sketch,
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
            particle_volume=spacing_at(self.scene, self.r_p) ** self.scene.dim,
            lower=np.array(walls.lower),
            upper=np.array(walls.upper),
            gravity=np.array(self.scene.gravity),
            distance=self._distance,
        )

    @cached_property
    def _distance(self) -> npt.NDArray[np.float64] | None:
        return distances(Room(self.scene, 0.0))


def prepare(
    root: Path,
    source: Drawn,
    seeds: Sequence[int],
    on_progress: Callable[[int], object] = lambda _count: None,
) -> None:
    """Make the missing pasts of a source in a folder of it; see `scene_files.prepare`."""
    scene_files.prepare(root, source, seeds, _columns, on_progress)


def read(root: Path, source: Drawn, seeds: Sequence[int]) -> list[Past]:
    """Return the pasts of some seeds, without those that could not be simulated.

    Raises
    ------
    DataError
        A file is damaged, or there is none at all.
    """
    found: list[tuple[int, dict[str, Any]]] = scene_files.read(root, source, seeds, _COLUMNS)
    return [Past(scene=source.scene(seed), **columns) for seed, columns in found]


def read_examples(source: DataSet, split: str) -> Iterator[Past]:
    """Yield the examples of control in a data set; errors as `DataSet.read` and `Past.of_example`."""
    about = data.metadata.read(source.folder)
    r_p = float(about.get("hybridmpm", {}).get("r_p", 1.0))
    for trajectory in source.read(split):
        yield Past.of_example(trajectory, len(trajectory.positions) - 1, r_p)


def _stored(x: npt.NDArray[np.float32]) -> npt.NDArray[np.uint16]:
    return np.asarray(np.round(np.clip(x, 0.0, 1.0) * _STEPS).astype(np.uint16))


def _columns(scene: Scene, _seed: int) -> scene_files.Columns:
    past = Past.simulated(scene)
    return {name: getattr(past, name) for name in _COLUMNS}
