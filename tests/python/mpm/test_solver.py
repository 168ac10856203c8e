"""`MpmSolver`: motion, state and its copies. The laws of the method are tested in Rust, beside it."""

import re
import threading

import numpy as np
import pytest

from hybridmpm import (
    Box,
    ConfigError,
    CostlyMaterialWarning,
    Elastic,
    ForceError,
    MpmSolver,
    Scene,
    SnapshotError,
)


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
    assert report is not None
    assert report.substeps == int(0.0025 / (0.02 / 64)) + 1 == 9
    assert report.bound == "reference"
    assert report.smallest_dt == pytest.approx(0.0025 / 9)


def test_cfl_number_sets_the_substeps(splash: Scene) -> None:
    counts = []
    for cfl in (0.6, 0.2):
        solver = MpmSolver(splash, cfl=cfl)
        solver.advance()
        assert solver.last_frame is not None
        assert solver.last_frame.bound in {"sound", "speed"}
        counts.append(solver.last_frame.substeps)
    assert counts[0] < counts[1]


def test_frames_in_one_call_or_many(splash: Scene) -> None:
    once, often = MpmSolver(splash), MpmSolver(splash)
    once.advance(12)
    for frames in (1, 0, 5, 6):
        often.advance(frames)
    assert_same_bits(once, often)


def test_rollout_is_what_advance_does(splash: Scene) -> None:
    rolled, advanced = MpmSolver(splash), MpmSolver(splash)
    rolled.advance(2)
    path = rolled.rollout(5)
    assert path.shape == (6, rolled.particle_count, 2)
    assert path.dtype == np.float32
    advanced.advance(2)
    for row in path:
        np.testing.assert_array_equal(row, advanced.positions)
        advanced.advance()
    assert rolled.frame == 7


@pytest.mark.parametrize("scene", ["splash", "cube"])
def test_threads_do_not_change_a_bit(scene: str, request: pytest.FixtureRequest) -> None:
    one = MpmSolver(request.getfixturevalue(scene), threads=1)
    two = MpmSolver(request.getfixturevalue(scene), threads=2)
    one.advance(30)
    two.advance(30)
    assert_same_bits(one, two)


def test_force_is_an_acceleration(drop: Scene) -> None:
    """An upward force of g on every particle holds the drop's vertical speed at zero."""
    solver = MpmSolver(drop)
    force = np.tile(np.array([2.0, 9.81]), (solver.particle_count, 1))
    solver.advance(20, force=force)
    t = 20 * drop.frame_dt
    np.testing.assert_allclose(solver.velocities.mean(axis=0), [0.5 + 2.0 * t, 0.0], atol=1e-3)


def test_force_held_or_given_per_frame(splash: Scene) -> None:
    held, given, mixed = MpmSolver(splash), MpmSolver(splash), MpmSolver(splash)
    force = np.random.default_rng(0).normal(0, 5, (held.particle_count, 2)).astype(np.float32)
    held.advance(4, force)
    given.advance(4, np.repeat(force[None], 4, axis=0))
    assert_same_bits(held, given)
    per_frame = np.stack([force, -force, 2 * force, 0 * force])
    given.reset()
    given.advance(4, per_frame)
    for row in per_frame:
        mixed.advance(1, row.tolist())
    assert_same_bits(given, mixed)


def test_force_does_not_outlive_its_call(drop: Scene) -> None:
    solver, free = MpmSolver(drop), MpmSolver(drop)
    solver.advance(1, np.zeros((solver.particle_count, 2)))
    free.advance(1)
    solver.advance(3)
    free.advance(3)
    assert_same_bits(solver, free)


@pytest.mark.parametrize("shape", [(3, 2), (5, 2, 2), (), (1, 1, 1, 1), (2, 2, 3)])
def test_force_of_a_wrong_shape(solver: MpmSolver, shape: tuple[int, ...]) -> None:
    before = solver.positions
    with pytest.raises(ForceError, match=rf"force must have shape .*got shape {re.escape(str(shape))}"):
        solver.advance(2, np.zeros(shape))
    assert solver.frame == 0
    np.testing.assert_array_equal(solver.positions, before)


@pytest.mark.parametrize("value", [float("nan"), float("inf"), 1e300])
def test_force_must_be_finite(solver: MpmSolver, value: float) -> None:
    force = np.zeros((solver.particle_count, 2))
    force[3, 1] = value
    with pytest.raises(ConfigError, match="force must be finite"):
        solver.advance(1, force)
    with pytest.raises(ConfigError, match="force must be numbers"):
        solver.advance(1, "up")


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


def test_a_failed_frame_leaves_the_frame_before(splash: Scene) -> None:
    solver, twin = MpmSolver(splash), MpmSolver(splash)
    solver.advance(3)
    twin.advance(3)
    force = np.zeros((solver.particle_count, 2))
    force[0] = 1e30
    with pytest.raises(Exception, match="lower the velocities"):
        solver.advance(2, force)
    assert_same_bits(solver, twin)
    solver.advance(2)
    twin.advance(2)
    assert_same_bits(solver, twin)


def test_going_on_from_a_snapshot_gives_the_same_bits(splash: Scene) -> None:
    solver, other = MpmSolver(splash), MpmSolver(splash, threads=2)
    solver.advance(10)
    saved = solver.snapshot()
    solver.advance(10)
    other.restore(saved)
    assert other.frame == 10
    other.advance(10)
    assert_same_bits(solver, other)
    solver.restore(saved)
    solver.advance(10)
    assert_same_bits(solver, other)


def test_snapshots_that_are_refused(solver: MpmSolver, drop: Scene) -> None:
    solver.advance(2)
    good = solver.snapshot()
    before = solver.positions
    damaged = bytearray(good)
    damaged[len(good) // 2] ^= 1
    for data in (b"", b"not a snapshot", good[:-1], bytes(damaged), MpmSolver(drop).snapshot()):
        with pytest.raises(SnapshotError):
            solver.restore(data)
        np.testing.assert_array_equal(solver.positions, before)
    solver.restore(good)


def test_copy_is_independent(solver: MpmSolver) -> None:
    solver.advance(5)
    twin = solver.copy()
    assert_same_bits(solver, twin)
    twin.advance(5)
    assert solver.frame == 5
    solver.advance(5)
    assert_same_bits(solver, twin)
    twin.reset()
    assert (twin.frame, solver.frame) == (0, 10)


def test_reset_starts_anew(splash: Scene, solver: MpmSolver) -> None:
    solver.advance(15)
    solver.reset()
    assert_same_bits(solver, MpmSolver(splash))
    assert solver.time == 0


@pytest.mark.parametrize(
    ("material", "named"),
    [
        (
            Elastic(density=1.0),
            r"bodies\[1\]: elastic of 1 kg/m\^3 .* takes \d{3} substeps in each frame",
        ),
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
    assert solver.last_frame is not None
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
