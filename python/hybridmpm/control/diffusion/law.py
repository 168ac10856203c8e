"""`Diffused`: the law whose force a Fluid ControlNet generates anew in each frame."""

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
import numpy.typing as npt

from hybridmpm._support.networks import cached
from hybridmpm.control.diffusion.network import ControlNetwork
from hybridmpm.control.diffusion.nodes import Nodes
from hybridmpm.control.diffusion.samplers import Solver
from hybridmpm.control.goal.cloud import Floats
from hybridmpm.control.goal.moments import fitted_in_view
from hybridmpm.control.goal.paths import SHORTEST_FRAMES
from hybridmpm.simulator import Simulator


@dataclass(frozen=True, eq=False)
class Diffused:
    """The force of a network on control nodes, spread over the particles.

    In each frame the network sees the nodes where they are, the sketch, and how much of the time is over. A
    sampler turns the same noise into the field of that frame. The ends to which this field leads free bodies
    are fitted to what the sketch says, and the force is the one to the fitted ends. Once all frames are over,
    it goes on as in the last one.
    """

    name: ClassVar[str] = "diffused"
    network: str
    """Name of the network, or its file."""
    nodes: dict[str, Any]
    """Fields of `Nodes`."""
    picture: npt.NDArray[np.uint8]
    """Picture of the sketch for the network (3, 64, 64)."""
    noise: npt.NDArray[np.float32]
    """Noise at the start of sampling (K, D)."""
    frames: int
    """Number of frames of control."""
    steps: int
    """Evaluations of the network for each frame."""
    solver: Solver
    cap: float
    """Largest acceleration of a particle [m/s^2]; longer ones are shortened to it."""
    mean: Floats
    """Goal of the centre of mass (D,) [m]."""
    covariance: Floats | None
    """Covariance (2, 2) of the end in the front view [m^2]; None for an arrow."""

    def force(self, simulator: Simulator, index: int) -> npt.NDArray[np.float32]:
        """Return (N, D)."""
        nodes, network = Nodes.from_dict(self.nodes), cached(ControlNetwork, self.network)
        x, v = nodes.gathered(simulator.positions), nodes.gathered(simulator.velocities)
        step = min(index, self.frames - 1) / self.frames
        field = network.field(
            x.astype(np.float32),
            v.astype(np.float32),
            nodes.types,
            step=step,
            picture=self.picture,
            noise=self.noise,
            steps=self.steps,
            solver=self.solver,
        )
        # A free body under the least force 6 d / t^2 - 4 v / t - g goes the way d, and comes to rest there.
        left = simulator.scene.frame_dt * max(network.frames * (1 - step), SHORTEST_FRAMES)
        way = (field + 4 * v / left + np.array(simulator.scene.gravity)) * left**2 / 6
        mass = np.bincount(nodes.group, simulator.mass, len(nodes.types))
        fitted = fitted_in_view(x + way, mass / mass.sum(), self.mean, self.covariance)
        force = nodes.spread((field + 6 * (fitted - x - way) / left**2).astype(np.float32))
        size = np.sqrt((force.astype(np.float64) ** 2).sum(axis=1, keepdims=True))
        return np.asarray(force * np.minimum(1.0, self.cap / np.maximum(size, 1e-12)), dtype=np.float32)
