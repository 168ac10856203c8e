"""Control meets the rest: snapshots, hybrids, particles that come and go, regions that sleep."""

import numpy as np
import pytest
from tests.python.control.test_follow import _Still

from hybridmpm import (
    BallSink,
    Box,
    ConfigError,
    HybridSimulator,
    MpmSolver,
    RoundEmitter,
    Scene,
    Sleep,
    SnapshotError,
)
from hybridmpm.control import Arrow, Ellipse, Sketch, follow, prepare, resume
from hybridmpm.control.guidance import Guidance

OVAL = Ellipse(np.array([0.6, 0.6]), np.array([0.1, 0.075]), 0.4)
ARROW = Arrow(np.array([[0.3, 0.3], [0.5, 0.3], [0.5, 0.5]]))
SCENE = Scene(dim=2, resolution=64, bodies=[Box(lower=(0.2, 0.2), upper=(0.35, 0.35), material="water")])


@pytest.mark.parametrize("method", ["analytic", "constant", "none"])
@pytest.mark.parametrize("sketch", [OVAL, ARROW], ids=["oval", "arrow"])
def test_snapshots_amid_a_sketch_go_on_to_the_same_bits(method: str, sketch: Sketch) -> None:
    solver = MpmSolver(SCENE)
    following = follow(solver, sketch, method, frames=40, hold=5)
    for _ in range(13):
        next(following)
    state, plan = solver.snapshot(), following.snapshot()
    whole = following.run()
    other = MpmSolver(SCENE)
    other.restore(state)
    rest = resume(other, plan).run()
    assert (rest.frames, rest.first_frame) == (32, 13)
    assert np.array_equal(rest.positions, whole.positions[13:])
    assert rest.reached.inside == whole.reached.inside
    assert rest.reached.miss == pytest.approx(whole.reached.miss)


def test_a_snapshot_holds_all_that_was_decided() -> None:
    guidance = prepare(MpmSolver(SCENE), OVAL, hold=3)
    again = Guidance.restored(guidance.snapshot(), SCENE)
    assert again.needs() == guidance.needs()
    assert (again.method, again.reason, again.frames, again.hold) == (
        guidance.method,
        guidance.reason,
        guidance.frames,
        guidance.hold,
    )
    assert again.snapshot() == guidance.snapshot()


def test_damaged_snapshots_and_foreign_laws_are_refused() -> None:
    solver = MpmSolver(SCENE)
    data = prepare(solver, OVAL).snapshot()
    for bad in (b"", data[:-9], data[:100] + b"x" + data[101:]):
        with pytest.raises(SnapshotError):
            resume(solver, bad)
    own = prepare(solver, OVAL, method=_Still())
    with pytest.raises(SnapshotError, match="a law of your own"):
        own.snapshot()


def test_a_guidance_is_for_its_frames() -> None:
    solver = MpmSolver(SCENE)
    solver.advance(5)
    data = prepare(solver, OVAL, frames=20).snapshot()
    solver.advance(21)
    with pytest.raises(ConfigError, match="frames 5 to 25, and the simulator is at frame 26"):
        resume(solver, data)


def test_a_second_sketch_takes_over_from_where_the_first_is() -> None:
    solver = MpmSolver(SCENE)
    first = follow(solver, OVAL, frames=60)
    for _ in range(30):
        next(first)
    second = follow(solver, Arrow(np.array([[0.3, 0.3], [0.3, 0.45]])), hold=10)
    start = second.guidance.goal.path[0]
    np.testing.assert_allclose(start, solver.positions.mean(axis=0), atol=1e-5)
    reached = second.run().reached
    assert reached.miss < 5e-3
    assert list(first) == []
    assert first.ending == "superseded"


def test_a_hybrid_follows_by_mpm_and_says_why() -> None:
    scene = Scene(dim=2, bodies=[Box(lower=(0.3, 0.4), upper=(0.5, 0.6), material="water")])
    hybrid = HybridSimulator(scene, "zero")
    hybrid.advance(30)
    log = len(hybrid.log)
    result = follow(hybrid, Arrow(np.array([[0.4, 0.3], [0.5, 0.5]])), frames=40).run()
    assert result.reached.miss < 5e-3
    led = hybrid.log[log:]
    assert [decision.mode for decision in led[:1]] == ["mpm"]
    assert "force" in led[0].reason
    hybrid.advance(200)
    assert hybrid.frame == 270


def test_a_hybrid_returns_to_its_network_a_few_steps_after_a_sketch() -> None:
    # After the sketch the block falls freely, which is what the network "zero" knows.
    scene = Scene(dim=2, bodies=[Box(lower=(0.3, 0.4), upper=(0.45, 0.55), material="water")])
    hybrid = HybridSimulator(scene, "zero", wait=3)
    hybrid.advance(30)
    assert hybrid.mode == "neural"
    follow(hybrid, Arrow(np.array([[0.4, 0.3], [0.5, 0.5]])), frames=60).run()
    assert hybrid.mode == "mpm"
    hybrid.advance(80)
    assert hybrid.mode == "neural"
    assert [(decision.mode, decision.reason) for decision in hybrid.log[-2:]] == [
        ("mpm", "force"),
        ("neural", "calm"),
    ]
    assert hybrid.log[-2].frame == 30
    assert hybrid.log[-1].frame == 90 + 3 * hybrid.r_t


def test_particles_that_come_later_are_left_alone() -> None:
    emitter = RoundEmitter(center=(0.7, 0.85), radius=0.03, velocity=(0.0, -1.0), material="water")
    body = Box(lower=(0.2, 0.2), upper=(0.35, 0.35), material="water")
    solver = MpmSolver(Scene(dim=2, resolution=64, bodies=[body], emitters=[emitter], gravity=(0.0, 0.0)))
    solver.advance(10)
    before = solver.particle_count
    following = follow(solver, Ellipse(np.array([0.35, 0.6]), np.array([0.12, 0.1]), 0.0), frames=60)
    result = following.run()
    assert solver.particle_count > before
    assert result.positions.shape == (61, before, 2)
    assert result.force.shape == (60, before, 2)
    assert np.array_equal(result.positions[-1], solver.positions[:before])
    guidance = prepare(solver, OVAL)
    solver.advance(20)
    steered = guidance(solver)
    assert isinstance(steered, tuple)
    assert np.array_equal(steered[0], guidance.goal.cloud.ids)
    assert len(steered[0]) < solver.particle_count
    later = solver.velocities[before:]
    np.testing.assert_allclose(np.median(later, axis=0), [0.0, -1.0], atol=0.05)


def test_particles_that_leave_are_missing_from_the_result() -> None:
    body = Box(lower=(0.2, 0.2), upper=(0.35, 0.35), material="water")
    sink = BallSink(center=(0.5, 0.5), radius=0.06)
    solver = MpmSolver(Scene(dim=2, resolution=64, bodies=[body], sinks=[sink]))
    result = follow(solver, OVAL, frames=60).run()
    gone = np.isnan(result.positions[-1]).all(axis=1)
    assert 0 < gone.sum() < len(gone)
    assert len(gone) - gone.sum() == solver.particle_count
    assert np.isfinite(result.centroids).all()


def test_an_empty_scene_is_refused() -> None:
    emitter = RoundEmitter(center=(0.5, 0.85), radius=0.03, velocity=(0.0, -1.0), material="water")
    solver = MpmSolver(Scene(dim=2, resolution=64, bodies=[], emitters=[emitter]))
    with pytest.raises(ConfigError, match="no particles at present"):
        follow(solver, OVAL)


def test_a_sketch_wakes_what_sleeps() -> None:
    pool = Scene(dim=2, resolution=64, bodies=[Box(lower=(0.1, 0.1), upper=(0.9, 0.15), material="sand")])
    solver = MpmSolver(pool, sleep=Sleep())
    solver.advance(200)
    assert solver.asleep.mean() > 0.9
    reached = (
        follow(solver, Ellipse(np.array([0.5, 0.5]), np.array([0.13, 0.11]), 0.0), cap=20.0).run().reached
    )
    assert not solver.asleep.any()
    assert reached.inside is not None
    assert reached.inside > 0.97
