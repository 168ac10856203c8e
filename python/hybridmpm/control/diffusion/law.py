"""`Diffused`: the law whose force a Fluid ControlNet generates anew in each frame."""

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
import numpy.typing as npt

from hybridmpm.control.diffusion.network import network_of
from hybridmpm.control.diffusion.nodes import Nodes
from hybridmpm.control.diffusion.samplers import Solver
from hybridmpm.simulator import Simulator


@dataclass(frozen=True, eq=False)
class Diffused:
    """The force of a network on control nodes, spread over the particles.

    In each frame the network sees the nodes where they are, the sketch, and how much of the time is over. A
    sampler turns the same noise into the field of that frame. Once all frames are over, it goes on as in
    the last one.
    """

    name: ClassVar[str] = "diffused"
    network: str
    """Name of the network, or its file."""
    nodes: dict[str, Any]
    """Fields of `Nodes`."""
    picture: npt.NDArray[np.uint8]
    """The sketch as the network sees it (3, 64, 64)."""
    noise: npt.NDArray[np.float32]
    """What sampling begins with (K, D)."""
    frames: int
    """Number of frames of control."""
    steps: int
    """Evaluations of the network for each frame."""
    solver: Solver
    cap: float
    """Largest acceleration of a particle [m/s^2]; longer ones are shortened to it."""

    def force(self, simulator: Simulator, index: int) -> npt.NDArray[np.float32]:
        """Return (N, D)."""
        nodes = Nodes.recalled(self.nodes)
        field = network_of(self.network).field(
            nodes.gathered(simulator.positions).astype(np.float32),
            nodes.gathered(simulator.velocities).astype(np.float32),
            nodes.types,
            step=min(index, self.frames - 1) / self.frames,
            picture=self.picture,
            noise=self.noise,
            steps=self.steps,
            solver=self.solver,
        )
        force = nodes.spread(field)
        size = np.sqrt((force.astype(np.float64) ** 2).sum(axis=1, keepdims=True))
        return np.asarray(force * np.minimum(1.0, self.cap / np.maximum(size, 1e-12)), dtype=np.float32)
