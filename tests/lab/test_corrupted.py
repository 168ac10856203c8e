"""Networks that are spoilt on purpose: the hybrid ends as well as with free fall in the network's place."""

from functools import cache
from typing import Any

import numpy as np
import pytest

from hybridmpm import MpmSolver, metrics, scenarios
from hybridmpm.hybrid import HybridSimulator
from hybridmpm.physics import NeuralModel
from hybridmpm.physics.free_fall import FreeFall
from hybridmpm_lab.stability.corruptions import CORRUPTIONS, Corrupted

SEED, FRAMES = 1_000_000, 160


@cache
def reached() -> tuple[Any, float]:
    """Return the true grid mass, and the error of the hybrid with free fall in the network's place."""
    scene = scenarios.get("water_2d", SEED)
    truth = MpmSolver(scene, substeps="reference")
    fallen = HybridSimulator(scene, FreeFall(scene.frame_dt, r_p=1 / 8, r_t=4))
    truth.advance(FRAMES)
    fallen.advance(FRAMES)
    true = metrics.grid_mass(truth.positions, truth.mass, scene.resolution)
    return true, error_of(fallen, true)


def error_of(sim: HybridSimulator, true: Any) -> float:
    return float(metrics.grid_rmse(metrics.grid_mass(sim.positions, sim.mass, sim.scene.resolution), true))


@pytest.mark.parametrize("kind", CORRUPTIONS)
def test_a_spoilt_network_is_no_worse_than_free_fall(kind: str) -> None:
    scene = scenarios.get("water_2d", SEED)
    sim = HybridSimulator(scene, Corrupted(NeuralModel.load("fluids_2d"), CORRUPTIONS[kind], scene))
    sim.advance(FRAMES)
    true, bound = reached()
    assert error_of(sim, true) <= 1.05 * bound
    # Refused as a whole, not undone step by step.
    assert sim.step_counts.network <= 0.1 * FRAMES
    assert np.isfinite(sim.positions).all()
