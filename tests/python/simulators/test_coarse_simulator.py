"""Networks and the hybrid show all particles of the scene, as MPM does."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from tests.python.hybrid.scripted import Scripted

import hybridmpm
from hybridmpm import (
    Box,
    ConfigError,
    ForceError,
    HybridSimulator,
    MpmSolver,
    NeuralPhysics,
    Scene,
    Simulator,
    SnapshotError,
)
from hybridmpm.physics.free_fall import FreeFall
from hybridmpm.recording import record

Maker = Callable[..., Any]
R_P = 1 / 8
MAKERS: dict[str, Maker] = {
    "mpm": lambda scene, show_all=True: MpmSolver(scene, r_p=R_P, show_all=show_all),
    "neural": lambda scene, show_all=True: NeuralPhysics(scene, network(scene), show_all=show_all),
    "hybrid": lambda scene, show_all=True: HybridSimulator(
        scene, network(scene), window=2, guards=["cosine"], show_all=show_all
    ),
}


def network(scene: Scene) -> FreeFall:
    """Return free fall, three frames a step: updates, every four frames, fall within its steps."""
    return FreeFall(scene.frame_dt, r_p=R_P, r_t=3)


class Swelling(FreeFall):
    """Free fall of particles that move apart, as no matter does."""

    def step(self, history: Any, *rest: Any) -> Any:
        x = super().step(history, *rest)
        return np.asarray(x + 0.04 * (x - x.mean(axis=0)), dtype=np.float32)


@pytest.fixture(scope="module")
def scene() -> Scene:
    """Return a block of water that hits the floor after some 30 frames: 1024 particles."""
    block = Box(material="water", lower=(0.3, 0.16), upper=(0.55, 0.41), velocity=(1.0, -0.5), seed=5)
    return Scene(name="falling block", dim=2, resolution=64, bodies=(block,))


@pytest.fixture(params=list(MAKERS))
def make(request: pytest.FixtureRequest) -> Maker:
    return MAKERS[request.param]


def state(simulator: Simulator) -> tuple[bytes, ...]:
    return simulator.positions.tobytes(), simulator.velocities.tobytes(), simulator.snapshot()


def test_all_particles_of_the_scene_are_shown(scene: Scene, make: Maker) -> None:
    simulator, sample = make(scene), scene.sample()
    n = len(sample.x)
    np.testing.assert_array_equal(simulator.positions, sample.x)
    np.testing.assert_array_equal(simulator.mass, sample.mass)
    simulator.advance(26)
    assert simulator.particle_count == len(simulator.positions) == len(simulator.velocities) == n
    assert simulator.ids.tolist() == list(range(n))
    assert simulator.materials.tolist() == [5] * n
    assert simulator.particle_spacing == scene.spacing
    assert simulator.mass.sum() == pytest.approx(simulator.diagnostics().mass, rel=1e-6)
    coarse = make(scene, show_all=False)
    coarse.advance(26)
    assert len(coarse.positions) == round(R_P * n)
    # Upsampling does not change the coarse particles.
    np.testing.assert_array_equal(simulator.coarse_positions, coarse.positions)
    assert np.abs(simulator.positions.mean(0) - coarse.positions.mean(0)).max() < 0.001
    recording = record(simulator, 8, every=4)
    assert recording.positions.shape == (3, n, 2)


def test_the_many_move_with_the_few_between_carries(scene: Scene, make: Maker) -> None:
    simulator = make(scene)
    simulator.advance(16)
    for _ in range(8):
        before, coarse = simulator.positions, simulator.coarse_positions
        simulator.advance(1)
        moved = (simulator.positions - before).mean(0)
        np.testing.assert_allclose(moved, (simulator.coarse_positions - coarse).mean(0), atol=3e-5)


def test_looking_changes_nothing(scene: Scene, make: Maker) -> None:
    watched, alone = make(scene), make(scene)
    for _ in range(50):
        watched.advance(1)
        assert np.isfinite(watched.positions).all()
    alone.advance(50)
    assert state(watched) == state(alone)


def test_copies_snapshots_and_files_go_on_with_the_same_bits(
    scene: Scene, make: Maker, tmp_path: Path
) -> None:
    simulator = make(scene)
    # Within a step of the network and between two updates.
    simulator.advance(22)
    copied, restored = simulator.copy(), make(scene)
    restored.restore(simulator.snapshot())
    simulator.save(tmp_path / "state.hmpm")
    loaded = hybridmpm.load(tmp_path / "state.hmpm", threads=2)
    kept = state(simulator)
    for twin in (copied, restored, loaded):
        assert state(twin) == kept
        twin.advance(33)
    assert state(simulator) == kept
    simulator.advance(33)
    assert state(copied) == state(restored) == state(loaded) == state(simulator)
    simulator.reset()
    assert state(simulator) == state(make(scene))


def test_a_force_on_some_moves_those(scene: Scene, make: Maker) -> None:
    pushed, plain = make(scene), make(scene)
    left = np.flatnonzero(pushed.positions[:, 0] < 0.42).astype(np.uint64)
    push = np.tile(np.float32([-20.0, 0.0]), (len(left), 1))
    for simulator in (pushed, plain):
        simulator.advance(18)
    # Two whole steps of the network, and a third.
    pushed.advance(6, (left, push))
    pushed.advance(3)
    plain.advance(9)
    change = pushed.velocities - plain.velocities
    # All of the momentum arrives, on either path.
    assert change.sum(0)[0] == pytest.approx(len(left) * -20.0 * 6 * 0.0025, rel=0.05)
    coarse = np.zeros((len(pushed.coarse_positions), 2))
    with pytest.raises(ForceError, match=r"must have shape \(2,\), \(1024, 2\) or"):
        pushed.advance(2, coarse)


def test_what_is_undone_is_undone_for_all(scene: Scene) -> None:
    """A run that turns to MPM at the right frames has the same bits as one that goes back to them."""
    swelling = Swelling(scene.frame_dt, r_p=R_P, r_t=3)
    simulator = HybridSimulator(scene, swelling, window=2, guards=["energy"], shortcuts=False)
    simulator.advance(40)
    # Carries of every fourth frame lie between.
    assert any(decision.frame // 4 < decision.noticed // 4 for decision in simulator.log)
    again = HybridSimulator(scene, swelling, window=2, guards=[Scripted(simulator.log)], shortcuts=False)
    again.advance(40)
    np.testing.assert_array_equal(again.positions, simulator.positions)
    np.testing.assert_array_equal(again.velocities, simulator.velocities)


def test_a_snapshot_of_the_few_alone_is_refused(scene: Scene, make: Maker) -> None:
    simulator, coarse = make(scene), make(scene, show_all=False)
    for one, other, saved in ((simulator, coarse, False), (coarse, simulator, True)):
        one.advance(3)
        before = one.snapshot()
        with pytest.raises(
            SnapshotError, match=f"taken with show_all={saved}, and this simulator has show_all="
        ):
            one.restore(other.snapshot())
        assert one.snapshot() == before


def test_with_all_particles_there_is_nothing_to_carry(scene: Scene) -> None:
    every = FreeFall(scene.frame_dt, r_t=3)
    for simulator in (NeuralPhysics(scene, every), HybridSimulator(scene, every)):
        np.testing.assert_array_equal(simulator.positions, simulator.coarse_positions)
        simulator.advance(2)
    for cls in (NeuralPhysics, HybridSimulator):
        with pytest.raises(ConfigError, match="show_all must be True or False, got 1"):
            cls(scene, every, show_all=1)  # type: ignore[arg-type]
