"""Several goals in turn: planned as one motion, each reached as a single one, edited while they run."""

import copy
import re
from typing import Any

import numpy as np
import pytest

from hybridmpm import Box, BoxObstacle, ConfigError, MpmSolver, Scene, SketchError
from hybridmpm.control import (
    Arrow,
    Ellipse,
    Following,
    Keyframe,
    Sequence,
    Shape,
    follow,
    prepare,
    prepare_keyframes,
    resume,
)

SQUARE = np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])


def solver_of(**more: Any) -> MpmSolver:
    body = Box(lower=(0.2, 0.2), upper=(0.35, 0.35), material="water")
    return MpmSolver(Scene(dim=2, resolution=64, bodies=[body], **more))


def square(x: float, y: float) -> Shape:
    return Shape((0.08 * SQUARE + [x, y],))


def oval(x: float, y: float) -> Ellipse:
    return Ellipse((x, y), (0.12, 0.065), 0.2)


THREE: list[Any] = [(oval(0.35, 0.5), 80), (square(0.6, 0.6), 80), (oval(0.6, 0.3), 80)]


def test_goals_in_turn_are_each_reached_as_a_single_one() -> None:
    following = follow(solver_of(), THREE)
    assert isinstance(following.guidance, Sequence)
    velocities = [leg.velocity for leg in following.guidance.legs]
    assert [velocity is None for velocity in velocities] == [False, False, True]
    assert velocities[0][0] > 0.2  # type: ignore[index]
    result = following.run()
    assert result.ending == "done"
    assert result.frames == 240
    assert len(result.passed) == 3
    for (goal, frames), passed in zip(THREE, result.passed, strict=True):
        alone = follow(solver_of(), goal, frames=frames).run().reached
        assert passed.inside > alone.inside - 0.02, goal
        assert passed.miss < 0.003
    # It passes the first goals with the velocity of the plan, and rests at the last.
    speed = np.linalg.norm(np.diff(result.centroids, axis=0), axis=1) / 0.0025
    for at, velocity in zip((80, 160), velocities, strict=False):
        assert speed[at - 1 : at + 1].mean() == pytest.approx(np.linalg.norm(velocity), rel=0.15)  # type: ignore[arg-type]
    assert speed[-1] < 0.3 * speed[78:80].mean()
    held = follow(solver_of(), [Keyframe(goal, frames, hold=20) for goal, frames in THREE])
    assert all(leg.velocity is None for leg in held.guidance.legs)  # type: ignore[union-attr]
    stopped = held.run()
    assert stopped.frames == 300
    assert sum(one.rms for one in result.passed) < sum(one.rms for one in stopped.passed)


def test_each_keyframe_has_its_needs_before_anything_moves() -> None:
    solver = solver_of()
    digest = solver.digest()
    sequence = prepare_keyframes(solver, [(oval(0.35, 0.5), None), (square(0.6, 0.6), 30)])
    assert solver.digest() == digest
    first, second = (leg.needs for leg in sequence.legs)
    assert first.frames == prepare(solver, oval(0.35, 0.5)).frames
    assert first.reachable
    assert [one.reason for one in second.obstructions] == ["time"]
    assert re.search(r"30 frames take .* \d+ frames would do", str(second))
    assert sequence.total_frames == first.frames + 30
    assert repr(sequence) == f"Sequence(ellipse at {first.frames}, shape at {first.frames + 30})"


def test_each_keyframe_chooses_who_moves() -> None:
    bodies = [
        Box(lower=(0.2, 0.11), upper=(0.3, 0.21), material="water"),
        Box(lower=(0.6, 0.11), upper=(0.7, 0.21), material="sand"),
    ]
    solver = MpmSolver(Scene(dim=2, resolution=64, bodies=bodies))
    goals = [
        Keyframe(oval(0.3, 0.5), 80, who="water"),
        Keyframe(Arrow([(0.65, 0.16), (0.65, 0.4)]), 80, who=1),
    ]
    following = follow(solver, goals)
    legs = following.guidance.legs  # type: ignore[union-attr]
    assert legs[0].velocity is None  # Others are led next.
    result = following.run()
    is_sand = solver.materials == 6
    assert len(result.ids) == solver.particle_count
    assert np.array_equal(legs[1].led, solver.ids[is_sand])
    assert not result.force[:80, is_sand].any()
    assert not result.force[80:, ~is_sand].any()
    assert result.passed[0].inside > 0.95
    assert result.passed[1].miss < 0.01


@pytest.mark.parametrize("stop", [40, 90, 130])
def test_a_sequence_goes_on_from_snapshots_and_copies(stop: int) -> None:
    solver = solver_of()
    following = follow(solver, THREE)
    for _ in range(stop):
        next(following)
    kept, plan = solver.snapshot(), following.snapshot()
    twin = copy.deepcopy(following)
    other, sequence = solver.copy(), following.guidance.copied()
    following.run()
    resumed = solver_of()
    resumed.restore(kept)
    assert resume(resumed, plan).run().frames == 240 - stop
    twin.run()
    other.advance(240 - stop, sequence)
    digests = {one.digest() for one in (solver, resumed, twin.simulator, other)}
    assert len(digests) == 1


def test_a_keyframe_is_edited_while_it_runs_without_a_jump() -> None:
    following = follow(solver_of(), THREE)
    for _ in range(50):
        next(following)
    left = following.left
    assert [one.frames for one in left] == [30, 80, 80]
    left[0] = Keyframe(oval(0.5, 0.62), 70)
    following.edit([left[0], left[2]])
    assert following.frames_done == 50
    result = following.run()
    assert result.frames == 50 + 70 + 80
    assert [round(one.miss, 2) for one in result.passed] == [0, 0]
    assert result.passed[0].inside > 0.95
    # Velocities go on from the present ones: no change is that of a jump.
    velocity = np.diff(result.centroids, axis=0) / 0.0025
    change = np.linalg.norm(np.diff(velocity, axis=0), axis=1)
    assert change[48:52].max() < 1.5 * change[:48].max()
    assert following.left == []
    with pytest.raises(ConfigError, match="the keyframes are over"):
        following.edit(left)
    with pytest.raises(ConfigError, match="only keyframes can be edited"):
        follow(solver_of(), oval(0.35, 0.5)).edit(left)


def test_among_obstacles_goals_are_passed_at_rest() -> None:
    obstacle = BoxObstacle(lower=(0.45, 0.1), upper=(0.5, 0.3))
    sequence = prepare_keyframes(solver_of(obstacles=[obstacle]), THREE[:2])
    assert [leg.velocity for leg in sequence.legs] == [None, None]


@pytest.mark.parametrize(
    ("keyframes", "error", "message"),
    [
        ([], ConfigError, "there must be 1 to 32 keyframes, got 0"),
        ("two", ConfigError, "keyframes must be a list of goals and frames, got str"),
        ([oval(0.5, 0.5)], ConfigError, "keyframes[0] must be a Keyframe or a goal and its frames"),
        ([*THREE, (oval(0.5, 0.5), 0)], ConfigError, "frames must be"),
        ([*THREE, ("oval", 50)], ConfigError, "keyframes[3]: sketch must be an Arrow"),
        ([(oval(3.0, 0.5), 50)], SketchError, "keyframes[0]: center must be"),
        ([Keyframe(oval(0.5, 0.5), 50, who="sand")], ConfigError, "keyframes[0]: who: 'sand' chooses none"),
    ],
)
def test_what_are_no_keyframes_is_refused(keyframes: Any, error: type[Exception], message: str) -> None:
    with pytest.raises(error, match=re.escape(message)):
        follow(solver_of(), keyframes)


def test_options_of_a_keyframe_are_given_with_it() -> None:
    with pytest.raises(ConfigError, match="hold belongs to each keyframe"):
        follow(solver_of(), THREE, hold=5)
    with pytest.raises(ConfigError, match=r"the keyframes take 240 frames, at most 100 are allowed"):
        prepare_keyframes(solver_of(), THREE, most=100)
    assert isinstance(follow(solver_of(), THREE, cap=8.0), Following)
