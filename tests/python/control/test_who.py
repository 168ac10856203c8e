"""Sketches that lead some of the particles, and control beside all else that acts on them."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner
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
from hybridmpm.cli import cli
from hybridmpm.control import (
    METHODS,
    Arrow,
    Ellipse,
    Oracle,
    Sketch,
    follow,
    prepare,
    resume,
    reversed_from_seed,
)

BODIES = [
    Box(lower=(0.15, 0.1), upper=(0.3, 0.25), material="water"),
    Box(lower=(0.58, 0.1), upper=(0.73, 0.25), material="sand"),
    Box(lower=(0.8, 0.1), upper=(0.88, 0.18), material="water"),
]
OVAL = Ellipse(np.array([0.4, 0.6]), np.array([0.1, 0.08]), 0.0)


def _solver(**more: Any) -> MpmSolver:
    settings = {name: more.pop(name) for name in ("r_p", "show_all") if name in more}
    return MpmSolver(Scene(dim=2, resolution=64, bodies=BODIES, **more), **settings)


@pytest.mark.parametrize("method", [name for name in METHODS if name != "none"])
def test_the_others_feel_no_force(method: str) -> None:
    led, free = _solver(), _solver()
    following = follow(led, OVAL, method, who=1, frames=20)
    result = following.run()
    free.advance(20)
    is_sand = led.materials == 6
    assert np.array_equal(following.guidance.goal.cloud.ids, led.ids[is_sand])
    assert result.positions.shape[1] == is_sand.sum() == len(result.ids)
    assert np.array_equal(result.positions[-1], led.positions[is_sand])
    # The water is far away, so its motion is that without the sketch.
    assert np.array_equal(led.positions[~is_sand], free.positions[~is_sand])
    assert not np.array_equal(led.positions[is_sand], free.positions[is_sand])


def test_goal_and_result_are_those_of_the_chosen() -> None:
    solver = _solver()
    following = follow(solver, OVAL, who="sand")
    assert following.guidance.goal.cloud.volume == pytest.approx(0.15**2, rel=0.05)
    assert following.run().reached.goal
    assert following.guidance.goal.inside(solver.positions[solver.materials == 5]).sum() == 0  # type: ignore[union-attr]


@pytest.mark.parametrize(
    ("who", "led"),
    [
        (0, [0]),
        (2, [2]),
        ("water", [0, 2]),
        (Ellipse(np.array([0.225, 0.175]), np.array([0.15, 0.15]), 0.3), [0]),
        (Arrow(np.array([[0.62, 0.12], [0.86, 0.14]])), None),
        ({"points": [(0.8, 0.12), (0.88, 0.12)], "kind": "arrow"}, None),
        ({"particle": 3}, [0]),
    ],
    ids=["body", "last body", "material", "oval", "line", "stroke", "particle"],
)
@pytest.mark.parametrize("settings", [{}, {"r_p": 1 / 4}, {"r_p": 1 / 4, "show_all": True}], ids=str)
def test_who_is_led(who: Any, led: list[int] | None, settings: dict[str, Any]) -> None:
    solver = _solver(**settings)
    cloud = prepare(solver, OVAL, who=who).goal.cloud
    assert cloud.partial
    if led is None:
        assert 0 < len(cloud.x) < solver.particle_count / 2
        assert cloud.x[:, 1].max() < 0.17
        return
    x = solver.positions
    inside = np.any([((x > BODIES[i].lower) & (x < BODIES[i].upper)).all(axis=1) for i in led], axis=0)
    assert np.array_equal(cloud.ids, solver.ids[inside])


def test_a_guidance_keeps_who_in_its_snapshot() -> None:
    solver = _solver()
    following = follow(solver, OVAL, who=1, frames=20)
    for _ in range(8):
        next(following)
    twin = _solver()
    twin.restore(solver.snapshot())
    rest = resume(twin, following.snapshot()).run()
    assert np.array_equal(rest.positions[-1], following.run().positions[-1])
    assert np.array_equal(twin.positions, solver.positions)


def test_recorded_forces_lead_the_chosen_again() -> None:
    solver = _solver(sinks=[BallSink(center=(0.5, 0.85), radius=0.02)])
    twin = solver.copy()
    result = follow(solver, OVAL, who=1, frames=15).run()
    twin.advance(15, (result.ids, result.force))
    assert np.array_equal(twin.positions, solver.positions)


@pytest.mark.parametrize(
    ("who", "message"),
    [
        (3, r"who must be .*\[0, 2\]"),
        ("sandy", "did you mean"),
        ("elastic", "chooses none"),
        (True, "index of a body"),
        (Ellipse(np.array([0.5, 0.8]), np.array([0.02, 0.02]), 0.0), "chooses none"),
        ({"particle": -1}, "particle must be"),
    ],
)
def test_a_wrong_choice_is_refused(who: Any, message: str) -> None:
    with pytest.raises(ConfigError, match=message):
        prepare(_solver(), OVAL, who=who)


def test_the_oracle_leads_all_or_none() -> None:
    case = reversed_from_seed("water_2d", 7, frames=10)
    with pytest.raises(ConfigError, match="without `who`"):
        prepare(
            case.simulator(),
            case.sketch,
            Oracle(case),
            frames=10,
            who=Ellipse(case.positions[0][0], np.array([0.05, 0.05]), 0.0),
        )


@pytest.mark.parametrize("form", ["1", "sand", "a file"])
def test_the_command_takes_who(form: str, tmp_path: Path) -> None:
    scene, sketch, over = (tmp_path / name for name in ("scene.json", "sketch.json", "over.json"))
    scene.write_text(_solver().scene.model_dump_json(exclude_none=True))
    sketch.write_text(json.dumps({"strokes": [{"points": [[0.67, 0.2], [0.67, 0.5]], "kind": "arrow"}]}))
    around = [[0.675 + 0.12 * np.cos(t), 0.175 + 0.12 * np.sin(t)] for t in np.linspace(0, 6.3, 40)]
    over.write_text(json.dumps({"strokes": [{"points": around, "kind": "ellipse"}]}))
    out = tmp_path / "run.npz"
    who = str(over) if form == "a file" else form
    files = ["control", str(scene), "--sketch", str(sketch), "--out", str(out)]
    run = CliRunner().invoke(cli, [*files, "--who", who, "--frames", "5"])
    assert run.exit_code in (0, 1), run.output
    with np.load(out) as arrays:
        assert arrays["positions"].shape[1] == _solver().particle_count
        assert len(arrays["force_ids"]) == (_solver().materials == 6).sum()


GOAL = Ellipse(np.array([0.6, 0.6]), np.array([0.1, 0.075]), 0.4)
ARROW = Arrow(np.array([[0.3, 0.3], [0.5, 0.3], [0.5, 0.5]]))
SCENE = Scene(dim=2, resolution=64, bodies=[Box(lower=(0.2, 0.2), upper=(0.35, 0.35), material="water")])


@pytest.mark.parametrize("method", ["analytic", "constant", "none"])
@pytest.mark.parametrize("sketch", [GOAL, ARROW], ids=["oval", "arrow"])
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


def test_damaged_snapshots_and_foreign_laws_are_refused() -> None:
    solver = MpmSolver(SCENE)
    data = prepare(solver, GOAL).snapshot()
    for bad in (b"", data[:-9], data[:100] + b"x" + data[101:]):
        with pytest.raises(SnapshotError):
            resume(solver, bad)
    own = prepare(solver, GOAL, method=_Still())
    with pytest.raises(SnapshotError, match="a law of your own"):
        own.snapshot()


def test_a_guidance_is_for_its_frames() -> None:
    solver = MpmSolver(SCENE)
    solver.advance(5)
    data = prepare(solver, GOAL, frames=20).snapshot()
    solver.advance(21)
    with pytest.raises(ConfigError, match="frames 5 to 25, and the simulator is at frame 26"):
        resume(solver, data)


def test_a_second_sketch_takes_over_from_where_the_first_is() -> None:
    solver = MpmSolver(SCENE)
    first = follow(solver, GOAL, frames=60)
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
    guidance = prepare(solver, GOAL)
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
    result = follow(solver, GOAL, frames=60).run()
    gone = np.isnan(result.positions[-1]).all(axis=1)
    assert 0 < gone.sum() < len(gone)
    assert len(gone) - gone.sum() == solver.particle_count
    assert np.isfinite(result.centroids).all()


def test_an_empty_scene_is_refused() -> None:
    emitter = RoundEmitter(center=(0.5, 0.85), radius=0.03, velocity=(0.0, -1.0), material="water")
    solver = MpmSolver(Scene(dim=2, resolution=64, bodies=[], emitters=[emitter]))
    with pytest.raises(ConfigError, match="no particles at present"):
        follow(solver, GOAL)


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
