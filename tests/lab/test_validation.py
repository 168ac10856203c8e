"""The solver against experiments and closed forms, with the tolerances of the page."""

from collections.abc import Callable
from functools import cache

import numpy as np
import pytest

from hybridmpm import ConfigError, MpmSolver, _core
from hybridmpm.scene import Box, Sand, Scene, Walls
from hybridmpm_lab.validation import (
    CASES,
    cantilever,
    colliding_discs,
    column_collapse,
    dam_break,
    drum,
    floating,
    hanging,
    hopper,
    poured_heap,
    rebound,
    rigid_bodies,
    rolling,
    rotation,
    round_columns,
    sliding_block,
    stability_limit,
    torricelli,
    viscous_flow,
)
from hybridmpm_lab.validation.case import Check, Result

SHORTER: dict[str, Callable[[], Result]] = {
    "dam_break": lambda: dam_break.run((210, 420)),
    "column_collapse": lambda: column_collapse.run((0.5, 4.0), beads=(4.0,)),
    "round_columns": lambda: round_columns.run((1.0,), resolution=64),
    "poured_heap": lambda: poured_heap.run((64,), seeds=1),
    "rebound": lambda: rebound.run((64,)),
    "drum": lambda: drum.run((24.0,)),
    "hanging": lambda: hanging.run((64,)),
    "cantilever": lambda: cantilever.run((64,)),
    "rolling": lambda: rolling.run(seeds=1),
    "floating": lambda: floating.run((64,), (300.0,)),
    "torricelli": lambda: torricelli.run((2,), (None, 24)),
    "hopper": lambda: hopper.run((6, 12)),
    "sliding_block": lambda: sliding_block.run((32,)),
    "rotation": lambda: rotation.run(disc_seconds=1.0, ball_seconds=1.0),
    "colliding_discs": lambda: colliding_discs.run((32, 64)),
    "viscous_flow": lambda: viscous_flow.run((64,), 3.0),
    "rigid_bodies": lambda: rigid_bodies.run((500.0,), (6.0, 2.5, 3.0), (("block", 0.4),)),
}
"""Cases without their finest grids or longest runs, to save time; the command runs them in full."""

LONGER: dict[str, Callable[[], Result]] = {
    "column_collapse": column_collapse.run,
    "rotation": rotation.run,
    "stability_limit": stability_limit.run,
    "drum": lambda: drum.run((16.0, 32.0)),
}
"""Cases at full length whose short form leaves much out, or that the default tests sample."""


SLOW = (
    "column_collapse", "drum", "floating", "hopper", "poured_heap", "rigid_bodies", "rotation",
    "round_columns", "torricelli",
)  # fmt: skip
"""Cases whose short form takes three seconds or more."""


def _marks(name: str) -> list[pytest.MarkDecorator]:
    return [pytest.mark.long] if name in SLOW else []


@cache
def checks(name: str) -> tuple[Check, ...]:
    return tuple(SHORTER.get(name, CASES[name])().checks)


@pytest.mark.parametrize("name", [pytest.param(k, marks=_marks(k)) for k in CASES if k != "stability_limit"])
def test_case(name: str) -> None:
    assert any(check.verdict == "pass" for check in checks(name))
    assert [check.quantity for check in checks(name) if check.verdict == "FAIL"] == []


@pytest.mark.long
@pytest.mark.parametrize("name", list(LONGER))
def test_longer_case(name: str) -> None:
    assert [check for check in LONGER[name]().checks if check.verdict == "FAIL"] == []


def test_a_layer_of_sand_is_braked_by_the_sine_of_its_friction_angle() -> None:
    """Eight cells deep on a rough floor, away from the ends; the lowest cells take a little less."""
    angle = 30.0
    floor, dx = 0.03125, 1 / 128
    sand = Sand(friction_angle=column_collapse.angle_for_sand(angle))
    body = Box(material=sand, lower=(0.05, floor), upper=(0.75, floor + 8 * dx), velocity=(1.0, 0.0))
    walls = Walls(lower=(floor, floor), upper=(1 - floor, 1 - floor), contact="sticky")
    solver = MpmSolver(Scene(dim=2, resolution=128, walls=walls, bodies=(body,)))
    middle = np.abs(solver.positions[:, 0] - 0.4) < 0.1
    solver.advance(8)
    before = solver.velocities[middle, 0].mean()
    solver.advance(24)
    braking = (before - solver.velocities[middle, 0].mean()) / (24 * 2.5e-3)
    assert braking / 9.81 == pytest.approx(np.sin(np.radians(angle)), rel=0.08)


@pytest.mark.parametrize("dim", [2, 3])
@pytest.mark.parametrize("material", stability_limit.MATERIALS)
@pytest.mark.parametrize("stress", stability_limit.STRESSES)
def test_the_default_step_is_far_below_the_limit(material: str, stress: str, dim: int) -> None:
    margin = 1.0 if stress == "alone, deformed" else stability_limit.MARGIN
    for factor in (1.0, margin):
        level = factor * stability_limit.MATERIALS[material].default_cfl
        assert stability_limit.outcome(material, dim, stress, level) == "survived"


def test_a_limit_is_the_last_level_before_the_first_failure() -> None:
    assert stability_limit._limit("water", 2, "alone", (0.4, 1.2)) == 0.4
    assert stability_limit._limit("water", 2, "alone", (1.2,)) == 0.0


def test_the_signal_speed_is_that_of_the_core() -> None:
    water = _core.Material.water(density=1000.0, bulk_modulus=8000.0)
    assert [water.signal_speed(dim) for dim in (2, 3)] == pytest.approx([4.0, np.sqrt(24.0)])
    with pytest.raises(ConfigError, match="dim must be 2 or 3, got 4"):
        water.signal_speed(4)
