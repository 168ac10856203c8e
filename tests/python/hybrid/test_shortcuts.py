"""Free fall and rest, which the hybrid answers without its network."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from hybridmpm import Box, BoxObstacle, MpmSolver, Scene
from hybridmpm.hybrid import HybridSimulator, StepCounts

Make = Callable[..., Any]


def test_free_fall_is_answered_without_the_network(fall: Scene, fake: Make) -> None:
    network = fake("nan", r_t=2)
    sim = HybridSimulator(fall, network)
    sim.advance(60)
    assert network.calls == []
    assert (sim.mode, sim.step_counts) == ("neural", StepCounts(free_fall=50))
    mpm = MpmSolver(fall)
    mpm.advance(60)
    assert np.abs(sim.positions - mpm.positions).max() < 1e-4
    assert np.abs(sim.velocities - mpm.velocities).max() < 0.01


def test_what_touches_anything_does_not_fall_freely(fake: Make) -> None:
    """A wall, an obstacle and another body that comes near end the free fall of all."""
    falling = Box(material="water", lower=(0.4, 0.5), upper=(0.5, 0.6))
    below = Box(material="water", lower=(0.4, 0.25), upper=(0.5, 0.35), velocity=(0.0, 2.0))
    ramp = BoxObstacle(lower=(0.3, 0.25), upper=(0.6, 0.3))
    for more in ({"obstacles": (ramp,)}, {"bodies": (falling, below)}):
        scene = Scene(dim=2, resolution=64, **{"bodies": (falling,), **more})
        network = fake("fall", r_t=2)
        sim = HybridSimulator(scene, network, guards=())
        first = next(frame for frame in range(1, 120) if sim.advance(1) is None and network.calls)
        apart = MpmSolver(scene).rollout(first)
        fell = np.diff(apart[:, :, 1].astype(np.float64), n=2, axis=0) / scene.frame_dt**2
        # The network is asked before MPM feels the contact, or soon after.
        felt = int(np.argmax(np.abs(fell + 9.81).max(axis=1) > 5.0)) + 1
        assert abs(first - felt) <= 12
        assert sim.step_counts.free_fall > 15


def test_a_scene_at_rest_stays_as_it_is_without_network_and_mpm(pool: Scene, fake: Make) -> None:
    network = fake("nan", r_t=2)
    sim = HybridSimulator(pool, network)
    sim.advance(600)
    assert sim.mode == "neural"
    asked, at_rest, before = len(network.calls), sim.step_counts.rest, sim.positions
    sim.advance(100)
    np.testing.assert_array_equal(sim.positions, before)
    assert not sim.velocities.any()
    assert (len(network.calls), sim.step_counts.rest) == (asked, at_rest + 100)
    truth = MpmSolver(pool)
    truth.advance(700)
    assert np.abs(sim.positions.mean(axis=0) - truth.positions.mean(axis=0)).max() < 2e-3
    # A push wakes it.
    sim.advance(10, (3.0, 0.0))
    assert (sim.mode, sim.log[-1].reason) == ("mpm", "force")
    assert sim.velocities[:, 0].mean() > 0.01


@pytest.mark.parametrize("kind", ["fall", "random weak", "held"])
def test_frames_are_counted_once_whatever_is_undone(splash: Scene, fake: Make, kind: str) -> None:
    sim = HybridSimulator(splash, fake(kind, r_p=0.5, r_t=2))
    for frame in range(1, 150):
        sim.advance(1)
        assert sum(vars(sim.step_counts).values()) == pytest.approx(frame * (1 - sim.mpm_share), abs=1e-9)


def test_a_thrown_body_does_not_rest_at_its_highest_point(fake: Make) -> None:
    up = Box(material="water", lower=(0.4, 0.4), upper=(0.5, 0.5), velocity=(0.0, 0.3))
    sim = HybridSimulator(Scene(dim=2, resolution=64, bodies=(up,)), fake("nan", r_t=1))
    sim.advance(30)
    assert sim.step_counts == StepCounts(free_fall=25)
    assert sim.velocities[:, 1].max() < -0.4


def test_it_can_be_switched_off(fall: Scene, fake: Make) -> None:
    network = fake("fall", r_t=2)
    sim = HybridSimulator(fall, network, shortcuts=False)
    sim.advance(60)
    assert len(network.calls) == 25
    assert sim.step_counts == StepCounts(network=50)


def test_a_cosine_that_is_asked_for_is_a_guard(fall: Scene, fake: Make) -> None:
    assert HybridSimulator(fall, fake("fall")).r_c is None
    assert HybridSimulator(fall, fake("fall"), r_c=0.3).r_c == 0.3
    assert HybridSimulator(fall, fake("fall"), guards=["cosine"]).r_c == 0.8
