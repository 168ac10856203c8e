"""The first impact is where closed forms put it."""

import numpy as np
import pytest

from hybridmpm import Ball, Box, ConfigError, MpmSolver, Scene
from hybridmpm.planner.calibrating.impact import first_impact

REACH = 2.5
"""Cells at which two bodies, or a body and a wall, feel each other at most: their splines overlap."""


def impact(*bodies: Box | Ball, dim: int = 2, **scene: object) -> tuple[int, Scene]:
    built = Scene.parse(
        {"dim": dim, "bodies": [body.model_dump(exclude_none=True) for body in bodies], **scene}
    )
    return first_impact(MpmSolver(built), 400), built


@pytest.mark.parametrize("material", ["water", "sand"])
@pytest.mark.parametrize("height", [0.05, 0.2, 0.5])
@pytest.mark.parametrize("dim", [2, 3])
def test_a_drop_lands_after_the_root_of_2h_over_g(dim: int, height: float, material: str) -> None:
    low, high = (0.4,) * dim, (0.55,) * dim
    box = Box(
        material=material,
        lower=(low[0], 0.1 + height, *low[2:]),
        upper=(high[0], 0.25 + height, *high[2:]),
    )
    frame, scene = impact(box, dim=dim)
    landing = np.sqrt(2 * height / 9.81)
    early = REACH * scene.dx / (9.81 * landing)
    assert landing - early <= frame * scene.frame_dt <= landing + 1.5 * scene.frame_dt


def test_a_body_thrown_at_a_wall_lands_there() -> None:
    box = Box(material="water", lower=(0.4, 0.5), upper=(0.6, 0.6), velocity=(3.0, 1.0))
    frame, scene = impact(box)
    # 0.3 m at 3 m/s; the floor would take longer.
    assert 0.1 - REACH * scene.dx / 3.0 <= frame * scene.frame_dt <= 0.1 + 1.5 * scene.frame_dt


def test_bodies_that_meet_in_the_air() -> None:
    left = Ball(material="water", center=(0.3, 0.7), radius=0.05, velocity=(2.0, 1.0))
    right = Ball(material="water", center=(0.6, 0.7), radius=0.05, velocity=(-2.0, 1.0))
    frame, scene = impact(left, right)
    # 0.2 m apart at 4 m/s. Balls touch in a point, so the share of particles pushed takes a while to grow.
    assert 0.05 - REACH * scene.dx / 4.0 <= frame * scene.frame_dt <= 0.05 + 3 * scene.frame_dt


def test_what_stands_on_the_floor_has_landed() -> None:
    frame, _ = impact(Box(material="sand", lower=(0.4, 0.1), upper=(0.6, 0.2)))
    assert frame == 1


def test_without_an_impact_it_says_so() -> None:
    box = Box(material="water", lower=(0.4, 0.5), upper=(0.5, 0.6))
    solver = MpmSolver(Scene(name="still falling", dim=2, bodies=(box,)))
    with pytest.raises(ConfigError, match="nothing hits anything in the first 20 frames of still falling"):
        first_impact(solver, 20)
    assert solver.frame == 20
