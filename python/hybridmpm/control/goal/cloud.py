"""`Cloud`: the particles of a simulator at the instant of a sketch."""

from dataclasses import dataclass
from typing import Self

import numpy as np
import numpy.typing as npt

from hybridmpm.control.goal.who import Who, chosen
from hybridmpm.errors import ConfigError
from hybridmpm.scene.particle_types import GOOP
from hybridmpm.simulator import Simulator

Floats = npt.NDArray[np.float64]

EARTH = 9.81
"""One g [m/s^2], whatever the gravity of the scene."""


@dataclass(frozen=True, eq=False)
class Cloud:
    """N particles at one instant, in D dimensions."""

    ids: npt.NDArray[np.uint64]
    """Numbers (N,) of the particles."""
    x: Floats
    """Positions (N, D) [m]."""
    v: Floats
    """Velocities (N, D) [m/s]."""
    weight: Floats
    """Mass of each particle over that of all (N,) [-]."""
    types: npt.NDArray[np.uint8]
    """DeepMind's particle types (N,): 5 water, 6 sand, 7 elastic, 8 viscous liquid."""
    volume: float
    """Volume of all particles at rest, in 2D their area [m^D]."""
    gravity: Floats
    """Gravity of the scene (D,) [m/s^2]."""
    frame: int
    """Frame of the simulator."""
    frame_dt: float
    """Length of a frame [s]."""
    partial: bool
    """Whether there are other particles, too, on which no force acts."""

    @classmethod
    def of(cls, simulator: Simulator, who: Who | npt.NDArray[np.uint64] | None = None) -> Self:
        """Return the present particles of a simulator, or those of them that `who` chooses.

        Raises
        ------
        ConfigError
            There are none.
        """
        if simulator.particle_count == 0:
            raise ConfigError(
                "the scene holds no particles at present: draw the sketch when there are some to move"
            )
        scene = simulator.scene
        rows = slice(None) if who is None else chosen(simulator, who)
        mass = simulator.mass[rows].astype(np.float64)
        if not len(mass):
            raise ConfigError("none of the particles that are to be led is there any more")
        return cls(
            ids=simulator.ids[rows],
            x=simulator.positions[rows].astype(np.float64),
            v=simulator.velocities[rows].astype(np.float64),
            weight=mass / mass.sum(),
            types=simulator.materials[rows],
            volume=len(mass) * simulator.particle_spacing**scene.dim,
            gravity=np.array(scene.gravity),
            frame=simulator.frame,
            frame_dt=scene.frame_dt,
            partial=len(mass) < simulator.particle_count,
        )

    @property
    def dim(self) -> int:
        """Dimension D."""
        return len(self.gravity)

    @property
    def elastic(self) -> float:
        """Share of the mass that is elastic [-]."""
        return float(self.weight @ (self.types == GOOP))

    @property
    def centroid(self) -> Floats:
        """Centre of mass (D,) [m]."""
        return np.asarray(self.weight @ self.x)

    @property
    def mean_velocity(self) -> Floats:
        """Velocity of the centre of mass (D,) [m/s]."""
        return np.asarray(self.weight @ self.v)
