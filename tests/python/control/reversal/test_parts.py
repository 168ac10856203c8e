"""The parts of a reversed case on cases with known answers: law, smoothing, sketches."""

import numpy as np
import pytest

from hybridmpm.control.laws import Retraced
from hybridmpm.control.reversal import SEGMENTS, arrow_of, oval_of, smoothed, step_cosines
from hybridmpm.control.sketch.sketch import depth_of_width, width_of_depth
from hybridmpm.scene import Walls

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
    assert arrow.widths is not None
    depths = [depth_of_width(width, 0.1, 0.9) for width in arrow.widths]
    np.testing.assert_allclose(depths, way[:: 40 // SEGMENTS, 2], atol=1e-6)
    assert oval_of(motion[-1], weight, WALLS).width == pytest.approx(arrow.widths[-1])
    assert [width_of_depth(depth, 0.1, 0.9) for depth in (0.0, 0.1, 0.5, 0.9, 1.0)] == [2, 2, 11, 20, 20]
