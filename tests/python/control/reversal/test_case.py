"""Reversed cases: a fluid led back along its own past, and the method that knows the way."""

from typing import Any

import numpy as np
import pytest

from hybridmpm import Box, ConfigError, MpmSolver, Scene, SketchError, control
from hybridmpm.control import Oracle, ReversedCase, follow, reversed_case, reversed_from_seed
from hybridmpm.scene import BallObstacle, Motion, RoundEmitter


def scene(dim: int = 2, material: str = "water", **more: Any) -> Scene:
    body = Box(
        lower=(0.2, 0.15, 0.4)[:dim],
        upper=(0.35, 0.3, 0.55)[:dim],
        material=material,
        velocity=(1.0, 0.5, -0.4)[:dim],
    )
    return Scene(dim=dim, resolution=64 if dim == 2 else 32, bodies=[body], **more)


@pytest.fixture(scope="module", params=[(2, "water"), (2, "sand"), (3, "water"), (3, "sand")], ids=str)
def case(request: pytest.FixtureRequest) -> ReversedCase:
    """Return a block that hits the floor and spreads, led back from there."""
    return reversed_case(scene(*request.param), control_frame=70, frames=60, kind="arrow")


def test_the_truth_is_the_past_and_the_forces_lead_to_its_start(case: ReversedCase) -> None:
    forward = MpmSolver(case.scene, substeps="reference")
    path = forward.rollout(70)
    assert np.array_equal(case.truth, path[10:][::-1])
    assert np.array_equal(case.velocities, forward.velocities)
    assert np.array_equal(case.simulator().rollout(60, case.forces), case.positions)
    assert case.error(case.truth[0]) > 0.8
    assert case.error(case.positions[-1]) < 0.15
    assert case.error(case.target) == 0
    assert 0 < case.rms < case.peak <= case.cap == 30


def test_the_oracle_gives_the_forces_of_its_case_and_goes_on_from_a_snapshot(case: ReversedCase) -> None:
    following = follow(case.simulator(), case.sketch, Oracle(case), frames=case.frames, cap=case.cap, hold=5)
    for _ in range(20):
        next(following)
    twin, kept = following.simulator.copy(), following.snapshot()
    result = following.run()
    assert np.array_equal(result.positions[: case.frames + 1], case.positions)
    assert np.array_equal(result.force[: case.frames], case.forces)
    # What is held stays where it is, or ends its motion there.
    assert case.error(result.positions[-1]) < 0.3
    rest = control.resume(twin, kept).run()
    assert np.array_equal(rest.positions, result.positions[20:])


def test_a_reversed_start_has_the_negative_velocities_and_needs_less_force() -> None:
    live, back = (
        reversed_case(scene(), control_frame=60, frames=40, start=start) for start in ("live", "reversed")
    )
    assert np.array_equal(live.velocities, -back.velocities)
    assert np.array_equal(live.truth, back.truth)
    assert back.rms < live.rms
    assert back.error(back.positions[-1]) < 0.15
    result = follow(back.simulator(), back.sketch, Oracle(back), frames=40, cap=30).run()
    assert np.array_equal(result.force, back.forces)


def test_a_lower_cap_leaves_more_of_the_error() -> None:
    errors = [
        one.error(one.positions[-1])
        for one in (reversed_case(scene(), control_frame=60, frames=40, cap=cap) for cap in (30, 8, 2))
    ]
    assert errors == sorted(errors)
    assert errors[2] > 0.5


def test_the_oracle_refuses_what_is_not_its_case() -> None:
    case = reversed_case(scene(), control_frame=20, frames=10)
    with pytest.raises(ConfigError, match=r"for frames = 10, got 12"):
        follow(case.simulator(), case.sketch, Oracle(case), frames=12)
    ahead = case.simulator()
    ahead.advance(1)
    other_way = reversed_case(scene(), control_frame=20, frames=10, start="reversed").simulator()
    assert np.array_equal(other_way.positions, case.simulator().positions)
    for other in (ahead, other_way, MpmSolver(scene(dim=2, material="sand"), r_p=0.5)):
        with pytest.raises(ConfigError, match=r"follow with case\.simulator\(\)"):
            follow(other, case.sketch, Oracle(case), frames=10)


def test_a_seed_gives_the_case_and_a_choice_does_not_change_the_rest_of_it() -> None:
    drawn = [reversed_from_seed("sand_2d", seed, frames=40, r_p=0.05) for seed in range(12)]
    assert {one.start for one in drawn} == {"live", "reversed"}
    assert {one.kind for one in drawn} == {"oval", "arrow"}
    assert all(40 <= one.control_frame <= 80 for one in drawn)
    assert len({one.control_frame for one in drawn}) > 2
    again = reversed_from_seed("sand_2d", 3, frames=40, r_p=0.05, start="live", kind="oval")
    assert again.control_frame == drawn[3].control_frame
    assert np.array_equal(again.truth, drawn[3].truth)
    assert (again.start, again.kind, again.seed) == ("live", "oval", 3)


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"control_frame": 9}, "control_frame must be at least frames = 10, .*, got 9"),
        ({"control_frame": 1.5}, "control_frame must be a whole number"),
        ({"frames": 1}, r"frames must be in \[2, 10000\], got 1"),
        ({"start": "backwards"}, 'start must be "live" or "reversed", got \'backwards\''),
        ({"kind": "ellipse"}, 'kind must be "oval" or "arrow", got \'ellipse\''),
        ({"cap": 0}, r"cap must be a number in \(0, 1000\], got 0"),
    ],
)
def test_wrong_settings_are_refused(settings: dict[str, Any], message: str) -> None:
    with pytest.raises(ConfigError, match=message):
        reversed_case(scene(), **{"control_frame": 20, "frames": 10, **settings})


def test_what_does_not_run_backwards_is_refused() -> None:
    spout = RoundEmitter(center=(0.3, 0.7), radius=0.05, velocity=(0.0, -1.0), material="water")
    paddle = BallObstacle(center=(0.7, 0.3), radius=0.08, motion=Motion(velocity=(0.1, 0.0)))
    with pytest.raises(ConfigError, match="emitters or sinks does not run backwards"):
        reversed_case(scene(emitters=[spout]), control_frame=20, frames=10)
    with pytest.raises(ConfigError, match="obstacles that move does not run backwards"):
        reversed_case(scene(obstacles=[paddle]), control_frame=20, frames=10)
    still = Scene(dim=2, gravity=(0, 0), bodies=[Box(lower=(0.4, 0.4), upper=(0.5, 0.5), material="sand")])
    with pytest.raises(SketchError, match="the stroke is 0 long"):
        reversed_case(still, control_frame=20, frames=10, kind="arrow")
