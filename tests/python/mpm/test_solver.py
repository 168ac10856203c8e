"""`MpmSolver`: motion, cost, sleep and state. The laws of the method are tested in Rust, beside it."""

import threading
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from hybridmpm import (
    Ball,
    BallObstacle,
    Box,
    ConfigError,
    CostlyMaterialWarning,
    Elastic,
    Motion,
    MpmBatch,
    MpmSolver,
    Scene,
    Sleep,
    scenarios,
)
from hybridmpm.mpm import frame_cost


def state(solver: MpmSolver) -> list[np.ndarray]:
    return [solver.positions, solver.velocities, solver.affine, solver.volume_ratio]


def assert_same_bits(one: MpmSolver, other: MpmSolver) -> None:
    assert one.frame == other.frame
    for a, b in zip(state(one), state(other), strict=True):
        np.testing.assert_array_equal(a.view(np.uint32), b.view(np.uint32))


def test_shapes_and_types(drop: Scene, cube: Scene) -> None:
    for scene in (drop, cube):
        solver = MpmSolver(scene)
        n, d = solver.particle_count, solver.dim
        assert (d, solver.frame, solver.time) == (scene.dim, 0, 0.0)
        assert [array.shape for array in state(solver)] == [(n, d), (n, d), (n, d, d), (n,)]
        assert {array.dtype for array in state(solver)} == {np.dtype(np.float32)}
        assert solver.materials.dtype == np.uint8
        assert (solver.materials == 5).all()
        assert solver.mass.shape == (n,)
        assert solver.last_frame is None
        np.testing.assert_array_equal(solver.positions, scene.sample().x)


@pytest.mark.parametrize("substeps", ["cfl", "reference", 9])
def test_free_fall(drop: Scene, substeps: str | int) -> None:
    solver = MpmSolver(drop, substeps=substeps)  # type: ignore[arg-type]
    start = np.array(solver.diagnostics().centroid)
    solver.advance(40)
    t = 40 * drop.frame_dt
    assert solver.time == pytest.approx(t)
    moved = np.array(solver.diagnostics().centroid) - start
    # With the gravity of each substep applied before it moves (symplectic Euler), a fall is longer than
    # g t^2 / 2 by g t dt / 2, here at most 9.81 * 0.1 * 0.0005.
    np.testing.assert_allclose(moved, [0.5 * t, -9.81 * t**2 / 2], atol=5e-4)


def test_reference_substeps_follow_their_rule(drop: Scene) -> None:
    solver = MpmSolver(drop, substeps="reference")
    solver.advance()
    report = solver.last_frame
    assert report.substeps == int(0.0025 / (0.02 / 64)) + 1 == 9
    assert report.bound == "reference"
    assert report.smallest_dt == pytest.approx(0.0025 / 9)


def test_cfl_number_sets_the_substeps(splash: Scene) -> None:
    counts = []
    for cfl in (0.6, 0.2):
        solver = MpmSolver(splash, cfl=cfl)
        solver.advance()
        assert solver.last_frame.bound in {"sound", "speed"}
        counts.append(solver.last_frame.substeps)
    assert counts[0] < counts[1]


def test_frames_in_one_call_or_many(splash: Scene) -> None:
    once, often = MpmSolver(splash), MpmSolver(splash)
    once.advance(12)
    for frames in (1, 0, 5, 6):
        often.advance(frames)
    assert_same_bits(once, often)


def test_force_is_an_acceleration(drop: Scene) -> None:
    """An upward force of g on every particle holds the drop's vertical speed at zero."""
    solver = MpmSolver(drop)
    force = np.tile(np.array([2.0, 9.81]), (solver.particle_count, 1))
    solver.advance(20, force=force)
    t = 20 * drop.frame_dt
    np.testing.assert_allclose(solver.velocities.mean(axis=0), [0.5 + 2.0 * t, 0.0], atol=1e-3)


def test_force_does_not_outlive_its_call(drop: Scene) -> None:
    solver, free = MpmSolver(drop), MpmSolver(drop)
    solver.advance(1, np.zeros((solver.particle_count, 2)))
    free.advance(1)
    solver.advance(3)
    free.advance(3)
    assert_same_bits(solver, free)


@pytest.mark.parametrize("frames", [-1, 1_000_001, 1.5, "3", None])
def test_bad_frames(solver: MpmSolver, frames: object) -> None:
    for call in (solver.advance, solver.rollout):
        with pytest.raises(ConfigError, match=r"frames must be .*\[0, 1000000\]"):
            call(frames)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    "settings",
    [
        {"substeps": 0},
        {"substeps": -3},
        {"substeps": 20_001},
        {"substeps": 1.5},
        {"substeps": "fast"},
        {"cfl": 0.0},
        {"cfl": 1.1},
        {"cfl": float("nan")},
        {"threads": 0},
        {"threads": 1025},
    ],
)
def test_bad_settings(drop: Scene, settings: dict[str, object]) -> None:
    with pytest.raises(ConfigError, match=next(iter(settings))):
        MpmSolver(drop, **settings)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("material", "named"),
    [
        (Elastic(density=1.0), r"bodies\[1\]: elastic of 1 kg/m\^3 .* takes \d{3} substeps in each frame"),
        (Elastic(youngs_modulus=1e9), r"make it denser or softer, or take a coarser grid"),
    ],
)
def test_a_material_that_makes_frames_slow_is_warned_of(material: Elastic, named: str) -> None:
    water = Box(material="water", lower=(0.2, 0.2), upper=(0.3, 0.3))
    slow = Box(material=material, lower=(0.5, 0.2), upper=(0.6, 0.3))
    with pytest.warns(CostlyMaterialWarning, match=named) as caught:
        solver = MpmSolver(Scene(dim=2, bodies=(water, slow)))
    assert caught[0].filename == __file__
    solver.advance(1)
    assert solver.last_frame.substeps >= 200


def test_diagnostics_agree_with_the_arrays(splash: Scene) -> None:
    solver = MpmSolver(splash)
    solver.advance(10)
    totals, mass = solver.diagnostics(), solver.mass.astype(float)[:, None]
    x, v = solver.positions.astype(float), solver.velocities.astype(float)
    assert totals.mass == pytest.approx(mass.sum(), rel=1e-5)
    np.testing.assert_allclose(totals.momentum, (mass * v).sum(axis=0), rtol=1e-4, atol=1e-4)
    np.testing.assert_allclose(totals.centroid, (mass * x).sum(axis=0) / mass.sum(), rtol=1e-5)
    assert totals.potential_energy == pytest.approx(9.81 * float((mass[:, 0] * x[:, 1]).sum()), rel=1e-4)
    assert totals.max_speed == pytest.approx(np.linalg.norm(v, axis=1).max(), rel=1e-4)
    assert totals.min_volume_ratio == pytest.approx(solver.volume_ratio.min())
    assert totals.max_volume_ratio == pytest.approx(solver.volume_ratio.max())
    assert totals.kinetic_energy >= 0.5 * float((mass * v**2).sum()) * (1 - 1e-4)


def test_threads_share_a_solver(splash: Scene) -> None:
    shared, alone = MpmSolver(splash), MpmSolver(splash)
    workers = [threading.Thread(target=shared.advance, args=(5,)) for _ in range(4)]
    for worker in workers:
        worker.start()
    for worker in workers:
        worker.join()
    alone.advance(20)
    assert_same_bits(shared, alone)


HEAP = Scene(
    dim=2, resolution=32, bodies=(Box(material="sand", lower=(0.4, 0.1), upper=(0.59, 0.19)),), frames=10
)


def test_a_heap_sleeps_and_a_force_wakes_it() -> None:
    solver = MpmSolver(HEAP, sleep=Sleep(speed=0.05, frames=5))
    solver.advance(200)
    assert solver.asleep.all()
    before = solver.positions
    solver.advance(10)
    np.testing.assert_array_equal(solver.positions, before)
    solver.advance(2, force=np.full(before.shape, 3.0, dtype=np.float32))
    assert not solver.asleep.any()
    assert np.abs(solver.positions - before).max() > 0


def test_files_and_batches_keep_who_sleeps(tmp_path: Path) -> None:
    sleep = Sleep(speed=0.05, frames=5)
    solver = MpmSolver(HEAP, sleep=sleep)
    solver.advance(58)
    solver.save(tmp_path / "state")
    again = MpmSolver.load(tmp_path / "state", threads=2)
    (member,) = batch = MpmBatch([HEAP], sleep=sleep)
    batch.advance(98)
    for twin in (solver, again):
        twin.advance(40)
    assert solver.asleep.any()
    np.testing.assert_array_equal(again.asleep, solver.asleep)
    assert again.snapshot() == solver.snapshot() == member.snapshot()


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"speed": 0.0}, r"speed.*must be in \(0, 1000\] m/s, got 0"),
        ({"frames": 0}, r"frames.*must be in \[1,"),
    ],
)
def test_bad_settings_of_sleep(settings: dict[str, Any], message: str) -> None:
    with pytest.raises(ConfigError, match=message):
        Sleep(**settings)


def test_a_switch_is_no_sleep() -> None:
    with pytest.raises(ConfigError, match=r"sleep must be Sleep\(\.\.\.\), or None .*, got True"):
        MpmSolver(HEAP, sleep=True)  # type: ignore[arg-type]


@pytest.mark.parametrize("name", scenarios.NAMES)
def test_scenarios_cost_what_was_estimated(name: str) -> None:
    scene = scenarios.get(name, 0)
    cost, solver = frame_cost(scene), MpmSolver(scene)
    solver.advance()
    # Particles lie on a lattice, and some bodies in obstacles.
    assert cost.particles == pytest.approx(solver.particle_count, rel=0.1)
    assert cost.substeps == pytest.approx(solver.last_frame.substeps, abs=1)
    assert cost.particle_substeps == cost.particles * cost.substeps


@pytest.mark.filterwarnings("ignore::hybridmpm.CostlyMaterialWarning")
@pytest.mark.parametrize(
    "change",
    [
        {"bodies": (Ball(material=Elastic(density=100.0), center=(0.5, 0.5), radius=0.05),)},
        {"bodies": (Ball(material="water", center=(0.5, 0.5), radius=0.05, velocity=(40.0, 20.0)),)},
        {"obstacles": (BallObstacle(center=(0.2, 0.2), radius=0.05, motion=Motion(velocity=(50.0, 0.0))),)},
    ],
    ids=["stiff", "fast particles", "fast obstacle"],
)
def test_what_makes_a_frame_dear_is_counted(change: dict[str, object]) -> None:
    plain = {"dim": 2, "bodies": (Box(material="water", lower=(0.45, 0.45), upper=(0.55, 0.55)),)}
    scene = Scene.model_validate(plain | change)
    solver = MpmSolver(scene)
    solver.advance()
    assert frame_cost(scene).substeps > frame_cost(Scene.model_validate(plain)).substeps
    # Particles fall, and their speeds are bounded from above while a substep is chosen.
    assert frame_cost(scene).substeps == pytest.approx(solver.last_frame.substeps, rel=0.1)
