"""A solver that changes coarse level keeps a budget, moves nothing by it, and goes on from snapshots."""

import itertools
from pathlib import Path

import numpy as np
import pytest

from hybridmpm import AutoSolver, BoxSink, CoarseWarning, Scene, scenarios
from hybridmpm.errors import ConfigError, SnapshotError
from hybridmpm.planner import Estimate, auto
from hybridmpm.planner.auto import WINDOW, Controller
from hybridmpm.planner.candidates import Candidate, candidates

EXPECTED = (0.1, 0.2, 0.4, 0.8)


def run(controller: Controller, factor: float, frames: int) -> list[int]:
    """Let frames take `factor` times what is expected of them; return the coarse level after each."""
    return [controller.enter(factor * EXPECTED[controller.index]) for _ in range(frames)]


def test_frames_within_the_budget_keep_the_level() -> None:
    assert set(run(Controller(EXPECTED, 0.5, 2), 1.0, 20 * WINDOW)) == {2}


def test_a_slow_machine_gets_the_best_level_that_keeps_within() -> None:
    controller = Controller(EXPECTED, 0.5, 3)
    assert run(controller, 2.0, WINDOW)[-2:] == [3, 1]
    assert run(Controller(EXPECTED, 0.5, 2), 100.0, WINDOW)[-1] == 0
    assert set(run(Controller(EXPECTED, 0.5, 0), 100.0, 10 * WINDOW)) == {0}


def test_a_quick_machine_climbs_step_by_step() -> None:
    levels = run(Controller(EXPECTED, 0.5, 0), 0.25, 12 * WINDOW)
    assert levels == sorted(levels)
    assert levels[-1] == 3
    assert set(levels) == {0, 1, 2, 3}


def test_an_attempt_that_fails_is_repeated_ever_more_rarely() -> None:
    controller, tried = Controller(EXPECTED, 0.5, 1), []
    for frame in range(3000):
        # The next coarse level is expected to fit, and does not.
        before = controller.index
        if controller.enter(0.2 if before == 1 else 0.6) > before:
            tried.append(frame)
    assert len(tried) >= 4
    waits = np.diff(tried)
    assert (waits[1:] > 1.5 * waits[:-1]).all()


@pytest.mark.parametrize("busy", [60, 700, 5000])
@pytest.mark.parametrize("spike", [1.0, 5.0, 40.0])
def test_the_level_is_found_again_when_the_machine_is_quiet(busy: int, spike: float) -> None:
    controller, random = Controller(EXPECTED, 0.5, 2), np.random.default_rng(7)
    levels = []
    for frame in range(busy + 1600):
        # Other programs come in bursts: a frame in six waits for them, in nine of ten stretches of 50.
        is_busy = frame < busy and frame // 50 % 10 != 9 and random.random() < 1 / 6
        levels.append(controller.enter(EXPECTED[controller.index] + spike * is_busy))
    assert min(levels[:busy]) < 2
    quiet = levels[busy:]
    assert quiet[-1] == 2
    # At worst the longest wait, and then a step of 40 frames each.
    assert quiet.index(2) <= 1024 + 3 * 2 * WINDOW + WINDOW
    # Level 3 never fits, so nothing is tried again and again.
    assert max(quiet) == 2


def test_an_attempt_that_lasts_ends_the_waiting() -> None:
    controller = Controller(EXPECTED, 0.5, 1)
    for _ in range(1500):
        controller.enter(0.2 if controller.index == 1 else 0.6)
    slow = [controller.enter(0.2 if controller.index == 1 else 0.3) for _ in range(2000)]
    assert slow[-1] == 2
    # One burst of others costs no more than a few windows now.
    assert run(controller, 3.0, WINDOW)[-1] < 2
    assert run(controller, 0.75, 5 * WINDOW)[-1] == 2


def test_single_slow_frames_change_nothing() -> None:
    controller = Controller(EXPECTED, 0.5, 2)
    for frame in range(20 * WINDOW):
        assert controller.enter(50.0 if frame % WINDOW == 0 else 0.4) == 2


class Clock:
    """A clock that lets each frame take so many seconds."""

    def __init__(self) -> None:
        self.frame_seconds, self._now, self._calls = 0.0, 0.0, 0

    def __call__(self) -> float:
        self._calls += 1
        if self._calls % 2 == 0:
            self._now += self.frame_seconds
        return self._now


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Clock:
    monkeypatch.setenv("HYBRIDMPM_CALIBRATION", str(tmp_path / "none.json"))
    return Clock()


@pytest.mark.parametrize("scenario", ["water_2d", "sand_3d"])
def test_a_change_moves_no_particle_far(scenario: str, clock: Clock) -> None:
    scene = scenarios.get(scenario, 2_000_000)
    solver = AutoSolver(scene, budget_ms=0.4, clock=clock)
    levels, states = [solver.level_name], [solver.positions]
    assert solver.plan.name == levels[0]
    for frame in range(150):
        clock.frame_seconds = 2e-3 if 40 <= frame < 60 else 1e-5
        solver.advance(1)
        levels.append(solver.level_name)
        states.append(solver.positions)
    assert solver.frame == 150
    assert solver.particle_count == len(scene.sample().x)
    order = [solver.level_names.index(name) for name in levels]
    down = min(order[40:80])
    assert down < order[40]
    assert down < order[-1]  # and up again
    steps = [np.linalg.norm(b - a, axis=1).max() for a, b in itertools.pairwise(states)]
    changed = [change.frame for change in solver.changes]
    assert len(changed) >= 3
    for frame in changed:
        assert steps[frame] <= steps[frame - 1] + scene.dx
    for change in solver.changes:
        assert levels[change.frame - 1] == change.before
        assert levels[change.frame] == change.after


def test_state_and_level_go_on(clock: Clock) -> None:
    solver = AutoSolver(scenarios.water_2d(2_000_000), budget_ms=0.4, clock=clock)
    clock.frame_seconds = 1e-3
    solver.advance(40)
    assert solver.changes
    kept, copied = solver.snapshot(), solver.copy()
    clock.frame_seconds = 3e-4
    solver.advance(10, (0.0, 1.0))
    copied.advance(10, (0.0, 1.0))
    np.testing.assert_array_equal(copied.positions, solver.positions)
    other = AutoSolver(scenarios.water_2d(2_000_000), budget_ms=0.4, clock=clock)
    other.restore(kept)
    assert other.changes == solver.changes
    other.advance(10, (0.0, 1.0))
    np.testing.assert_array_equal(other.positions, solver.positions)
    assert other.diagnostics().mass == pytest.approx(float(solver.mass.sum()), rel=1e-4)
    solver.reset()
    assert (solver.frame, solver.changes, solver.level_name) == (0, (), solver.plan.name)
    with pytest.raises(SnapshotError):
        solver.restore(b"nothing")
    with pytest.raises(ConfigError, match="depends on a clock"):
        solver.save("nowhere.hmpm")


def test_particles_must_neither_come_nor_go(clock: Clock) -> None:
    scene = scenarios.water_2d(2_000_000)
    sink = BoxSink(lower=(0.1, 0.1), upper=(0.2, 0.2))
    with pytest.raises(ConfigError, match="no emitters, sinks and moving obstacles"):
        AutoSolver(scene.model_copy(update={"sinks": (sink,)}), budget_ms=1.0, clock=clock)


def test_a_warning_of_a_level_is_told_once(clock: Clock) -> None:
    scene: Scene = scenarios.water_ramps_2d(2_000_000)
    with pytest.warns(CoarseWarning) as told:
        solver = AutoSolver(scene, budget_ms=0.05, clock=clock)
    assert any("thick" in str(one.message) for one in told)
    clock.frame_seconds = 1e-5
    solver.advance(70)  # here any warning is an error
    assert solver.changes


def test_a_network_takes_part_where_it_pays(clock: Clock, monkeypatch: pytest.MonkeyPatch) -> None:
    scene, few = scenarios.water_2d(2_000_000), "coarse 1/64"
    expected = {few: (0.9, 0.1), "hybrid fluids_2d": (0.5, 0.3), "neural fluids_2d all shown": (0.6, 0.35)}
    known = candidates("water_2d")

    def prospects(_scene: Scene, **_: object) -> list[tuple[Estimate, Candidate]]:
        return [
            (Estimate(name=name, error=error, error_se=None, error_bound=error, ms_per_frame=ms), known[name])
            for name, (error, ms) in expected.items()
        ]

    monkeypatch.setattr(auto, "estimates", prospects)
    clock.frame_seconds = 3e-4
    assert AutoSolver(scene, budget_ms=0.4).level_names == (few,)
    assert AutoSolver(scene, budget_ms=0.4, learned=True).level_names == (few, "hybrid fluids_2d")
    solver = AutoSolver(scene, budget_ms=0.4, learned=True, clock=clock)
    assert solver.level_name == "hybrid fluids_2d"
    solver.advance(30)
    first = solver.log
    assert first
    clock.frame_seconds = 2e-3
    solver.advance(30)
    assert (solver.level_name, solver.mode, solver.r_t) == (few, "mpm", 1)
    assert solver.log[: len(first)] == first
    clock.frame_seconds = 1e-5
    solver.advance(90)
    assert solver.level_name == "hybrid fluids_2d"
    # Decisions are told by frames since the start, not since the change.
    back = next(change.frame for change in solver.changes if change.after == solver.level_name)
    assert solver.log[-1].noticed >= back
    twin = AutoSolver(scene, budget_ms=0.4, learned=True, clock=clock)
    twin.restore(solver.snapshot())
    assert twin.log == solver.log
    np.testing.assert_array_equal(twin.positions, solver.positions)
