"""Reversed cases: a fluid led back along its own past, and the parts of such a case."""

from typing import Any

import numpy as np
import pytest

from hybridmpm import Box, ConfigError, MpmSolver, Scene, SketchError, control
from hybridmpm.control import Oracle, ReversedCase, follow, reversed_case, reversed_from_seed
from hybridmpm.control.laws import Retraced
from hybridmpm.control.reversal import SEGMENTS, arrow_of, oval_of, smoothed, step_cosines
from hybridmpm.control.sketch.sketch import depth_of_width, width_of_depth
from hybridmpm.scene import BallObstacle, Motion, RoundEmitter, Walls


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
    with pytest.raises(SketchError, match="all are in one place"):
        reversed_case(still, control_frame=20, frames=10, kind="arrow")


DT = 0.0025
WALLS = Walls(lower=(0.1, 0.1, 0.1), upper=(0.9, 0.9, 0.9))
GRAVITY = np.array([0.0, -9.81])


class Points:
    """Free points under gravity and force, which the law takes for a simulator."""

    def __init__(self, x: np.ndarray, u: np.ndarray) -> None:
        self.positions, self.velocities = x.astype(np.float32), u.astype(np.float32)

    def advance(self, force: np.ndarray) -> None:
        a = force + GRAVITY
        self.positions = (self.positions + DT * self.velocities + DT**2 / 2 * a).astype(np.float32)
        self.velocities = (self.velocities + DT * a).astype(np.float32)


def led(way: np.ndarray, u: np.ndarray, cap: float, hold: int = 0) -> tuple[Points, np.ndarray]:
    law = Retraced.along(way, frame_dt=DT, gravity=GRAVITY, cap=cap)
    points, forces = Points(way[0], u), []
    for index in range(len(way) - 1 + hold):
        forces.append(law.force(points, index))
        points.advance(forces[-1])
    return points, np.array(forces)


def arc(frames: int = 80) -> np.ndarray:
    turn = np.linspace(0, np.pi, frames + 1)
    return np.stack([0.5 + 0.2 * np.cos(turn), 0.4 + 0.2 * np.sin(turn)], axis=1)[:, None]


def test_a_point_that_is_on_its_way_stays_on_it_by_the_force_that_this_takes() -> None:
    way = arc()
    velocities = np.gradient(way, DT, axis=0)
    points, forces = led(way, velocities[0], cap=1e9)
    assert np.abs(points.positions - way[-1]).max() < 2e-4
    middle = slice(20, 60)
    needed = np.gradient(velocities, DT, axis=0)[:-1] - GRAVITY
    np.testing.assert_allclose(forces[middle], needed[middle], atol=0.03 * np.abs(needed).max())


def test_a_start_the_other_way_is_turned_round_below_the_cap() -> None:
    way = arc()
    cap = 30 * 9.81
    points, forces = led(way, -np.gradient(way, DT, axis=0)[0], cap)
    sizes = np.linalg.norm(forces, axis=2)
    assert sizes.max() <= cap
    assert sizes.max() == pytest.approx(cap, rel=1e-5)
    assert np.abs(points.positions - way[-1]).max() < 2e-4


def test_the_end_is_held() -> None:
    points, forces = led(arc(), np.gradient(arc(), DT, axis=0)[0], cap=1e9, hold=60)
    assert np.abs(points.positions - arc()[-1]).max() < 1e-4
    np.testing.assert_allclose(forces[-1], [-GRAVITY], atol=0.1)


def test_smoothing_draws_each_force_towards_the_next_by_the_papers_share() -> None:
    forces = np.array([[[1, 0]], [[1, 0]], [[-1, 0]], [[0, 2]], [[0, 0]], [[3, 0]]], dtype=np.float32)
    np.testing.assert_allclose(step_cosines(forces)[:, 0], [1, -1, 0, 0, 0])
    opposite, across = 0.1 * np.exp(2), 0.1
    expected = [
        [1, 0],
        [1 - 2 * opposite, 0],
        [-1 + across, 2 * across],
        [0, 2 - 2 * across],
        [3 * across, 0],
        [3, 0],
    ]
    np.testing.assert_allclose(smoothed(forces)[:, 0], expected, rtol=1e-6)
    steady = np.ones((5, 3, 2), np.float32)
    np.testing.assert_array_equal(smoothed(steady), steady)
    noise = np.random.default_rng(0).normal(size=(50, 20, 3)).astype(np.float32)
    assert step_cosines(smoothed(noise)).mean() > step_cosines(noise).mean() + 0.1


def test_an_oval_lies_at_two_standard_deviations_along_the_principal_axes() -> None:
    rng = np.random.default_rng(1)
    angle = 0.7
    turn = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
    x = [0.4, 0.6] + rng.normal(size=(200_000, 2)) * [0.08, 0.03] @ turn
    weight = np.full(len(x), 1 / len(x))
    oval = oval_of(x.astype(np.float32), weight, WALLS)
    np.testing.assert_allclose(oval.center, [0.4, 0.6], atol=1e-3)
    np.testing.assert_allclose(oval.axes, [0.16, 0.06], rtol=0.01)
    assert oval.angle == pytest.approx(angle, abs=0.01)
    assert oval.width is None


def test_an_arrow_goes_with_the_centre_of_mass_and_its_width_tells_the_depth() -> None:
    time = np.linspace(0, 1, 41)[:, None]
    way = np.hstack([0.2 + 0.5 * time, 0.3 + 0.4 * time**2, 0.2 + 0.6 * time])
    spread = np.random.default_rng(2).normal(size=(30, 3)) * 0.01
    weight = np.full(30, 1 / 30)
    motion = (way[:, None] + spread - spread.mean(axis=0)).astype(np.float32)
    arrow = arrow_of(motion, weight, WALLS)
    assert len(arrow.points) == SEGMENTS + 1
    np.testing.assert_allclose(arrow.points, way[:: 40 // SEGMENTS, :2], atol=1e-6)
    depths = [depth_of_width(width, 0.1, 0.9) for width in arrow.widths]
    np.testing.assert_allclose(depths, way[:: 40 // SEGMENTS, 2], atol=1e-6)
    assert oval_of(motion[-1], weight, WALLS).width == pytest.approx(arrow.widths[-1])
    assert [width_of_depth(depth, 0.1, 0.9) for depth in (0.0, 0.1, 0.5, 0.9, 1.0)] == [2, 2, 11, 20, 20]
