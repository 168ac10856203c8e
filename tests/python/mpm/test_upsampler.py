"""Upsampling from the coarse particles of a solver to all particles of the scene."""

import dataclasses
from pathlib import Path

import numpy as np
import pytest

from hybridmpm import (
    Box,
    BoxSink,
    ConfigError,
    MpmSolver,
    RectangularEmitter,
    Scene,
    SnapshotError,
    metrics,
    scenarios,
)
from hybridmpm.coarse import Upsampler
from hybridmpm.coarse.splines import Stencils
from hybridmpm.scene import BallObstacle, BoxObstacle, Motion
from hybridmpm.snapshots import read_state, write_state


def upsampled(scene: Scene, r_p: float = 1 / 16, threads: int = 1) -> MpmSolver:
    return MpmSolver(scene, r_p=r_p, show_all=True, threads=threads)


def bits(array: np.ndarray) -> bytes:
    return array.tobytes()


def falling(dim: int) -> Scene:
    body = Box(
        material="water",
        lower=(0.2, 0.12, 0.2)[:dim],
        upper=(0.4, 0.3, 0.35)[:dim],
        velocity=(1.5, -1.0, 0.5)[:dim],
    )
    return Scene(dim=dim, resolution=64 if dim == 2 else 32, bodies=(body,))


def test_without_upsampling_coarse_particles_are_shown() -> None:
    solver = MpmSolver(falling(2), r_p=1 / 8)
    np.testing.assert_array_equal(solver.positions, solver.coarse_positions)


@pytest.mark.parametrize("dim", [2, 3])
def test_bodies_fall_freely_as_a_whole(dim: int) -> None:
    """Also at frames between two updates; only particles that the jitter made too dense separate."""
    body = Box(material="sand", lower=(0.3, 0.7, 0.3)[:dim], upper=(0.45, 0.8, 0.45)[:dim])
    scene = Scene(dim=dim, resolution=64 if dim == 2 else 32, bodies=(body,))
    solver, start = upsampled(scene, 1 / 16), scene.sample().x
    for frames in (3, 4, 15):
        solver.advance(frames)
        fallen = start.copy()
        fallen[:, 1] -= 0.5 * 9.81 * solver.time**2
        apart = np.abs(solver.positions - fallen)
        # The gravity of a substep acts before it moves: g t dt / 2 more for a step dt, at most a frame.
        assert np.median(apart) < 0.5 * 9.81 * solver.time * scene.frame_dt + 1e-4
        assert apart.max() < 0.25 / scene.resolution
        np.testing.assert_allclose(solver.velocities[:, 1], -9.81 * solver.time, atol=2e-3)


@pytest.mark.parametrize("name", ["water_2d", "sand_2d"])
def test_shown_particles_follow_coarse_ones(name: str) -> None:
    solver = upsampled(getattr(scenarios, name)(2))
    for _ in range(4):
        solver.advance(50)
        coarse = solver.coarse_positions.mean(axis=0, dtype=float)
        assert np.linalg.norm(solver.positions.mean(axis=0, dtype=float) - coarse) < 0.01
        mass = solver.mass[:, None].astype(float)
        momentum = (mass * solver.velocities).sum(axis=0)
        totals = solver.diagnostics()
        scale = np.sqrt(2 * totals.kinetic_energy * totals.mass)
        assert np.abs(momentum - totals.momentum).max() < 0.05 * scale


def test_upsampling_comes_closer_to_the_truth() -> None:
    scene = scenarios.water_2d(0)
    truth, coarse = MpmSolver(scene, substeps="reference"), MpmSolver(scene, r_p=1 / 16)
    shown = upsampled(scene)
    errors = []
    for solver in (truth, coarse, shown):
        solver.advance(150)
        mass = metrics.grid_mass(solver.positions, solver.mass, scene.resolution)
        errors.append(mass / mass.sum())
    of_coarse, of_shown = (np.linalg.norm(errors[0] - other) for other in errors[1:])
    assert of_shown < 0.7 * of_coarse


@pytest.mark.parametrize("scenario", ["water_2d", "sand_2d"])
def test_density_stays_bounded(scenario: str) -> None:
    scene = getattr(scenarios, scenario)(0)
    solver = upsampled(scene, 1 / 32)
    volume = np.full(len(solver.mass), scene.spacing**2 * scene.resolution**2, dtype=np.float32)
    for _ in range(6):
        solver.advance(60)
        x = solver.positions
        density = metrics.grid_mass(x, volume, scene.resolution).astype(float)
        assert np.percentile(Stencils.at(x, scene.resolution).gather(density), 99) < 1.35


def test_no_particle_is_outside_or_in_an_obstacle_at_any_frame() -> None:
    swinging = Motion(velocity=(0.8, 0.0), period=0.2)
    obstacles = (
        BallObstacle(center=(0.5, 0.25), radius=0.08),
        BoxObstacle(lower=(0.7, 0.1), upper=(0.78, 0.3), motion=swinging),
    )
    body = Box(material="water", lower=(0.3, 0.4), upper=(0.7, 0.6), velocity=(0.5, -2.0))
    solver = upsampled(Scene(dim=2, resolution=128, bodies=(body,), obstacles=obstacles))
    solids = [obstacle.to_native() for obstacle in obstacles]
    for _ in range(90):
        solver.advance(2 if solver.frame % 8 else 1)
        x = solver.positions
        assert x.min() >= np.float32(0.1)
        assert x.max() <= np.float32(0.9)
        for solid in solids:
            assert solid.signed_distance(x, solver.time).min() > -1e-4, solver.frame


@pytest.mark.parametrize("dim", [2, 3])
def test_bits_depend_neither_on_threads_nor_on_reads_nor_on_calls(dim: int) -> None:
    scene = falling(dim)
    alone = upsampled(scene, 1 / 8)
    alone.advance(42)
    for threads in (2, 4):
        other = upsampled(scene, 1 / 8, threads)
        for frames in (1, 5, 7, 2, 13, 14):
            other.advance(frames)
            other.velocities  # noqa: B018 - to look must change nothing
        assert bits(other.positions) == bits(alone.positions)
        assert bits(other.velocities) == bits(alone.velocities)
    path = upsampled(scene, 1 / 8).rollout(42)
    assert bits(path[-1]) == bits(alone.positions)


def test_files_without_upsampling_are_read(tmp_path: Path) -> None:
    solver = MpmSolver(falling(2), r_p=1 / 8)
    solver.advance(5)
    file = tmp_path / "state.hmpm"
    solver.save(file)
    saved = read_state(file)
    settings = {name: value for name, value in saved.settings.items() if name != "show_all"}
    write_state(file, dataclasses.replace(saved, settings=settings))
    again = MpmSolver.load(file)
    np.testing.assert_array_equal(again.positions, solver.positions)


def test_foreign_and_damaged_states_are_refused_and_change_nothing() -> None:
    solver = upsampled(falling(2), 1 / 8)
    solver.advance(10)
    state, before = solver.snapshot(), solver.positions
    other = falling(2).model_copy(update={"resolution": 48})
    damaged = bytearray(state)
    damaged[-100] ^= 1
    for wrong in (state[:12], state[:200], state[:-20], bytes(damaged), upsampled(other, 1 / 8).snapshot()):
        with pytest.raises(SnapshotError):
            solver.restore(wrong)
        assert bits(solver.positions) == bits(before)
        assert solver.frame == 10


def test_a_force_on_all_particles_alike_is_one_on_the_coarse_ones() -> None:
    one, other = upsampled(falling(2), 1 / 8), upsampled(falling(2), 1 / 8)
    one.advance(10, (4.0, 1.0))
    other.advance(10, np.tile(np.float32([4.0, 1.0]), (other.particle_count, 1)))
    np.testing.assert_allclose(one.coarse_positions, other.coarse_positions, atol=1e-5)


def test_a_force_acts_on_the_matter_that_it_is_given_for() -> None:
    left = Box(material="water", lower=(0.2, 0.5), upper=(0.3, 0.6))
    right = Box(material="water", lower=(0.6, 0.5), upper=(0.7, 0.6))
    scene = Scene(dim=2, resolution=64, bodies=(left, right), gravity=(0.0, 0.0))
    solver = upsampled(scene, 1 / 8)
    first = solver.positions[:, 0] < 0.5
    force = np.zeros((solver.particle_count, 2), dtype=np.float32)
    force[first, 1] = 8.0
    solver.advance(20, force)
    v = solver.velocities
    np.testing.assert_allclose(v[first, 1], 8.0 * solver.time, rtol=0.02)
    assert np.abs(v[~first]).max() < 1e-4
    # A function and a pair of ids and rows are asked for the whole scene, too.
    twin = solver.copy()
    solver.advance(
        6, lambda one: np.where(one.positions[:, :1] < 0.5, np.float32([0, 5]), np.float32([0, 0]))
    )
    twin.advance(6, (np.flatnonzero(first), np.tile(np.float32([0, 5]), (first.sum(), 1))))
    np.testing.assert_allclose(twin.positions, solver.positions, atol=1e-6)


@pytest.mark.parametrize("dim", [2, 3])
def test_particles_come_and_go_in_each_frame(dim: int) -> None:
    jet = RectangularEmitter(
        material="water",
        lower=(0.3, 0.6, 0.4)[:dim],
        upper=(0.3, 0.7, 0.5)[:dim],
        velocity=(2.0, 0.0, 0.0)[:dim],
    )
    drain = BoxSink(lower=(0.1, 0.1, 0.1)[:dim], upper=(0.9, 0.35, 0.9)[:dim])
    scene = Scene(dim=dim, resolution=64 if dim == 2 else 32, bodies=(), emitters=(jet,), sinks=(drain,))
    solver = upsampled(scene, 1 / 8)
    counts, last = [], -1
    for _ in range(120):
        solver.advance(1)
        ids, x = solver.ids, solver.positions
        assert len(ids) == len(x) == solver.particle_count == len(solver.velocities) == len(solver.materials)
        assert (np.diff(ids.astype(np.int64)) > 0).all()
        assert solver.emitters == ("running",)
        last = max(last, int(ids[-1]) if len(ids) else -1)
        counts.append(len(ids))
    assert np.count_nonzero(np.diff(counts)) > 30
    assert last + 1 > counts[-1]
    assert solver.positions[:, 1].min() >= np.float32(0.35)
    # Both see the same flow, in layers of different thickness.
    coarse = solver.diagnostics()
    assert solver.mass.sum() == pytest.approx(coarse.mass, rel=0.1)
    assert np.linalg.norm(solver.positions.mean(axis=0) - coarse.centroid) < 0.03
    state, again = solver.snapshot(), upsampled(scene, 1 / 8, threads=2)
    again.restore(state)
    for one in (solver, again):
        one.advance(9)
    assert bits(again.positions) == bits(solver.positions)
    np.testing.assert_array_equal(again.ids, solver.ids)


def test_upsampling_all_particles_or_prescribed_motion_is_refused() -> None:
    with pytest.raises(ConfigError, match="show_all=True needs r_p below 1"):
        MpmSolver(falling(2), show_all=True)
    with pytest.raises(ConfigError, match="show_all must be True or False"):
        MpmSolver(falling(2), r_p=0.5, show_all=1)  # type: ignore[arg-type]
    solver = upsampled(falling(2), 1 / 8)
    with pytest.raises(ConfigError, match="prescribe is for solvers without show_all"):
        solver.prescribe(solver.positions, solver.velocities, 3)


class Mover:
    """Coarse particles without affine matrices, moved by the test."""

    affine = None

    def __init__(self, solver: MpmSolver) -> None:
        self.frame, self.ids, self.mass = 0, solver.ids, solver.mass
        self.positions, self.velocities = solver.positions, solver.velocities


def test_coarse_particles_of_any_simulator_are_upsampled() -> None:
    scene = falling(2)
    solver = MpmSolver(scene, r_p=1 / 8)
    coarse = Mover(solver)
    upsampler = Upsampler(scene, coarse, solver._solver)
    start = upsampler.positions
    for _ in range(6):
        coarse.frame += 1
        coarse.positions = coarse.positions + np.float32([0.002, 0.001])
        coarse.velocities = np.full_like(coarse.positions, 0.7)
        upsampler.update()
    moved = np.median(upsampler.positions - start, axis=0)
    np.testing.assert_allclose(moved, [0.012, 0.006], atol=2e-5)
    np.testing.assert_allclose(upsampler.velocities, 0.7, rtol=1e-5)


def test_shown_particles_do_not_drift_from_coarse_ones() -> None:
    body = Box(material="water", lower=(0.4, 0.2), upper=(0.6, 0.4))
    solver = MpmSolver(Scene(dim=2, bodies=(body,)), coarse="1/16")
    solver.advance(1600)
    coarse, shown = (x[:, 1].mean() - 0.1 for x in (solver.coarse_positions, solver.positions))
    # The water is 5 cm deep, so both means are about 2.5 cm. Without the correction of the drift, shown
    # particles end 6.8 mm above coarse ones.
    assert abs(shown - coarse) < 0.004
