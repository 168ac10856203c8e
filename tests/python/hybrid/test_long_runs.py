"""Long runs: the hybrid stays sound whatever the network does, and does not thrash."""

from typing import TYPE_CHECKING

import numpy as np
import pytest

from hybridmpm import Scene, scenarios
from hybridmpm.hybrid import HybridSimulator
from hybridmpm.physics import NeuralModel, default_model
from hybridmpm.physics.free_fall import FreeFall
from hybridmpm.physics.stepper import Stepper

if TYPE_CHECKING:
    from collections.abc import Callable

WINDOW = 10
R_T = 2


def energy(sim: HybridSimulator) -> float:
    totals = sim.diagnostics()
    return totals.kinetic_energy + totals.potential_energy


def run(scene: Scene, network: Stepper, frames: int) -> HybridSimulator:
    """Advance, and check after each hundred frames that the state is sound."""
    sim = HybridSimulator(scene, network, wait=WINDOW)
    most = energy(sim)
    lowest = np.array(scene.walls.lower) - scene.dx
    highest = np.array(scene.walls.upper) + scene.dx
    for _ in range(frames // 100):
        sim.advance(100)
        x = sim.positions
        assert np.isfinite(x).all()
        assert ((x >= lowest) & (x <= highest)).all()
        assert energy(sim) <= most
    # MPM has a scene for as many steps at least after each alarm, and there is one switch each way.
    noticed = np.array([decision.noticed for decision in sim.log])
    for start in range(0, frames, 50):
        inside = np.count_nonzero((noticed >= start) & (noticed < start + 100))
        assert inside <= 2 * (100 // (WINDOW * network.r_t) + 1)
    return sim


@pytest.mark.parametrize("scenario", scenarios.NAMES)
def test_a_short_run(scenario: str) -> None:
    scene = scenarios.get(scenario, 1_100_003)
    sim = run(scene, FreeFall(scene.frame_dt, r_p=0.25, r_t=R_T), 400)
    assert sim.log[0].mode == "neural"


@pytest.mark.long
@pytest.mark.timeout(1800)
@pytest.mark.parametrize("kind", ["zero", "shipped"])
@pytest.mark.parametrize("scenario", scenarios.NAMES)
def test_ten_thousand_frames(scenario: str, kind: str) -> None:
    scene = scenarios.get(scenario, 1_100_001)
    networks: dict[str, Callable[[], Stepper]] = {
        "zero": lambda: FreeFall(scene.frame_dt, r_p=1 / 1.75, r_t=R_T),
        "shipped": lambda: NeuralModel.load(default_model(scenario)),
    }
    run(scene, networks[kind](), 10_000)
