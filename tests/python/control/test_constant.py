"""The constant force: right for a free body, corrected near walls, and exactly what is applied."""

from typing import Any

import numpy as np
import numpy.typing as npt
import pytest

from hybridmpm import Ball, Box, DomainError, MpmSolver, Scene
from hybridmpm.control import Arrow, ControlledTrajectory, Ellipse, Sketch, follow
from hybridmpm.control.methods.constant import MAX_ACCELERATION


def _drop(dim: int = 2) -> MpmSolver:
    """Return a small block of water in the middle of the box, moving."""
    middle, half = np.full(dim, 0.5), 0.06
    body = Box(
        lower=tuple(middle - half),
        upper=tuple(middle + half),
        material="water",
        velocity=(0.5, 1.0, 0.2)[:dim],
    )
    return MpmSolver(Scene(dim=dim, resolution=64 if dim == 2 else 32, bodies=[body]))


def _led(solver: MpmSolver, sketch: Sketch, frames: int, **settings: Any) -> ControlledTrajectory:
    """Lead a copy of a solver by the constant force."""
    return follow(solver.copy(), sketch, "constant", frames=frames, **settings).run()


def _arrow(displacement: tuple[float, float], widths: list[float] | None = None) -> Arrow:
    return Arrow(np.array([[0.5, 0.5], np.add([0.5, 0.5], displacement)]), widths)  # type: ignore[arg-type]


@pytest.mark.parametrize("dim", [2, 3])
def test_a_free_body_gets_the_closed_form_and_follows_the_arrow(dim: int) -> None:
    solver = _drop(dim)
    plan = _led(solver, _arrow((0.1, 0.05)), 60)
    seconds = 60 * solver.scene.frame_dt
    velocity, wanted = np.array([0.5, 1.0, 0.2])[:dim], np.array([0.1, 0.05, 0.0])[:dim]
    expected = 2 * (wanted - velocity * seconds) / seconds**2 - np.array(solver.scene.gravity)
    np.testing.assert_allclose(plan.target_displacement, wanted)
    np.testing.assert_allclose(plan.displacement, wanted, atol=2e-3)
    np.testing.assert_allclose(plan.force, expected, atol=0.5)


def test_the_first_trial_is_the_closed_form(monkeypatch: pytest.MonkeyPatch) -> None:
    """Without shooting, which would make up for a wrong first guess."""
    monkeypatch.setattr("hybridmpm.control.methods.constant.MAX_ROLLOUTS", 1)
    plan = _led(_drop(), _arrow((0.1, 0.05)), 60)
    np.testing.assert_allclose(
        plan.force, 2 * (np.array([0.1, 0.05]) - np.array([0.5, 1.0]) * 0.15) / 0.15**2 + [0, 9.81], rtol=1e-4
    )


def test_an_ellipse_asks_for_its_centre() -> None:
    solver = _drop()
    plan = _led(solver, Ellipse(np.array([0.6, 0.45]), np.array([0.1, 0.05]), 0.0), 60)
    centroid = np.array(solver.diagnostics().centroid)
    np.testing.assert_allclose(plan.target_displacement, [0.6, 0.45] - centroid, atol=1e-3)
    np.testing.assert_allclose(plan.centroids[-1], [0.6, 0.45], atol=3e-3)


def test_the_width_of_an_arrow_is_its_depth() -> None:
    plan = _led(_drop(3), _arrow((0.05, 0.0), [8.0, 12.5]), 60)
    assert plan.target_displacement[2] == pytest.approx(0.8 * 4.5 / 18)
    assert plan.displacement[2] == pytest.approx(0.2, abs=4e-3)


def test_shooting_beats_the_closed_form_where_a_wall_is_in_the_way() -> None:
    """A block on the floor, pushed along it: the floor carries what the formula does not know."""
    body = Box(lower=(0.1, 0.1), upper=(0.3, 0.25), material="water")
    solver = MpmSolver(Scene(dim=2, resolution=64, bodies=[body]))
    solver.advance(40)
    now = solver.diagnostics()
    wanted, seconds = np.array([0.15, 0.0]), 80 * solver.scene.frame_dt
    velocity = np.array(now.momentum) / now.mass
    formula = 2 * (wanted - velocity * seconds) / seconds**2 - np.array(solver.scene.gravity)
    twin = solver.copy()
    twin.advance(80, force=np.tile(formula.astype(np.float32), (twin.particle_count, 1)))
    naive = np.array(twin.diagnostics().centroid) - np.array(now.centroid)
    plan = _led(solver, Arrow(np.array([[0.2, 0.2], [0.35, 0.2]])), 80)
    assert np.linalg.norm(plan.displacement - wanted) <= np.linalg.norm(naive - wanted) + 1e-6
    assert np.linalg.norm(plan.displacement - wanted) < 0.03


def test_what_is_out_of_reach_is_limited_and_survives() -> None:
    plan = _led(_drop(), _arrow((0.45, 0.45)), 10)
    assert np.linalg.norm(plan.force) <= MAX_ACCELERATION * (1 + 1e-6)
    assert np.isfinite(plan.positions).all()


def test_the_search_can_be_given_up_between_frames() -> None:
    class GivenUpError(Exception):
        pass

    calls = 0

    def give_up() -> None:
        nonlocal calls
        calls += 1
        if calls == 4:
            raise GivenUpError

    solver = _drop()
    with pytest.raises(GivenUpError):
        _led(solver, _arrow((0.1, 0.0)), 20, on_frame=give_up)
    assert calls == 4
    assert solver.frame == 0


class _FailsAbove(MpmSolver):
    """A solver that loses a particle under any acceleration above a limit."""

    limit = 0.0

    def advance(self, frames: int = 1, force: npt.ArrayLike | None = None) -> None:
        if force is not None and np.abs(np.asarray(force)).max() > self.limit:
            raise DomainError("particle 3 left the box in frame 1")
        super().advance(frames, force)


def _fragile(limit: float) -> MpmSolver:
    solver = _FailsAbove(
        Scene(dim=2, resolution=32, bodies=[Ball(center=(0.5, 0.5), radius=0.1, material="water")])
    )
    solver.limit = limit
    return solver


def test_a_failing_trial_is_followed_by_a_weaker_one() -> None:
    plan = _led(_fragile(40.0), _arrow((0.3, 0.1)), 40)
    assert 0 < np.abs(plan.force).max() <= 40


def test_the_error_is_raised_when_every_trial_fails() -> None:
    with pytest.raises(DomainError, match="particle 3"):
        _led(_fragile(0.0), _arrow((0.3, 0.1)), 40)
