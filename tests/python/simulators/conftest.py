"""The three simulators on one scene, with networks that need no training."""

from collections.abc import Callable
from typing import Any

import pytest

from hybridmpm import Box, HybridSimulator, MpmSolver, NeuralPhysics, Scene, Simulator
from hybridmpm.physics.free_fall import FreeFall

R_T = 4
MAKERS: dict[str, Callable[..., Simulator]] = {
    "mpm": MpmSolver,
    "neural": lambda scene: NeuralPhysics(scene, network(scene)),
    # Audits would refuse free fall near the floor.
    "hybrid": lambda scene: HybridSimulator(
        scene, network(scene), window=2, guards=("non-finite", "outside", "density", "energy")
    ),
}


def network(scene: Scene) -> FreeFall:
    """Return free fall with all particles, four frames a step."""
    return FreeFall(scene.frame_dt, r_t=R_T)


@pytest.fixture(scope="session")
def falling_block() -> Scene:
    """Return a block of water that falls for 30 frames and then hits the floor: 256 particles."""
    block = Box(material="water", lower=(0.3, 0.16), upper=(0.425, 0.285), velocity=(1.0, -0.5), seed=5)
    return Scene(name="falling block", dim=2, resolution=64, bodies=(block,))


@pytest.fixture(params=list(MAKERS))
def make(request: pytest.FixtureRequest, falling_block: Scene) -> Callable[[], Any]:
    """Return a function that makes a simulator of `falling_block`, of each kind in turn."""
    return lambda: MAKERS[request.param](falling_block)
