"""The cost that a scene is said to have is the one that it has."""

import pytest

from hybridmpm import Ball, BallObstacle, Box, Elastic, Motion, MpmSolver, Scene, scenarios
from hybridmpm.mpm import frame_cost


@pytest.mark.parametrize("name", scenarios.NAMES)
def test_scenarios_cost_what_was_estimated(name: str) -> None:
    scene = scenarios.get(name, 0)
    cost, solver = frame_cost(scene), MpmSolver(scene)
    solver.advance()
    assert solver.last_frame is not None
    # Particles lie on a lattice, and some bodies in obstacles.
    assert cost.particles == pytest.approx(solver.particle_count, rel=0.1)
    assert cost.substeps == pytest.approx(solver.last_frame.substeps, abs=1)
    assert cost.particle_substeps == cost.particles * cost.substeps


@pytest.mark.filterwarnings("ignore::hybridmpm.CostlyMaterialWarning")
@pytest.mark.parametrize(
    "change",
    [
        {"bodies": (Ball(material=Elastic(density=100.0), center=(0.5, 0.5), radius=0.05),)},
        {"bodies": (Ball(material="water", center=(0.5, 0.5), radius=0.05, velocity=(40.0, 20.0)),)},
        {"obstacles": (BallObstacle(center=(0.2, 0.2), radius=0.05, motion=Motion(velocity=(50.0, 0.0))),)},
    ],
    ids=["stiff", "fast particles", "fast obstacle"],
)
def test_what_makes_a_frame_dear_is_counted(change: dict[str, object]) -> None:
    plain = {"dim": 2, "bodies": (Box(material="water", lower=(0.45, 0.45), upper=(0.55, 0.55)),)}
    scene = Scene.model_validate(plain | change)
    solver = MpmSolver(scene)
    solver.advance()
    assert solver.last_frame is not None
    assert frame_cost(scene).substeps > frame_cost(Scene.model_validate(plain)).substeps
    # Particles fall, and their speeds are bounded from above while a substep is chosen.
    assert frame_cost(scene).substeps == pytest.approx(solver.last_frame.substeps, rel=0.1)
