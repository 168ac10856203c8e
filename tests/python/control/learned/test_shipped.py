"""The learned plan in 3D that comes with the library, and where `auto` takes it."""

import json
import re
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner

from hybridmpm import MpmSolver, Scene, scenarios
from hybridmpm.cli import cli
from hybridmpm.control import (
    Arrow,
    Ellipse,
    Learned,
    Sketch,
    follow,
    prepare,
    resume,
)
from hybridmpm.control.methods.learned.network import TransportNetwork
from hybridmpm.control.methods.learned.serving import serving

ARROW = Arrow(np.array([[0.4, 0.3], [0.5, 0.5]]))
WIDE = Ellipse(np.array([0.5, 0.5]), np.array([0.2, 0.15]), 0.3)
TURN = np.linspace(0, 2 * np.pi, 50)
NARROW = Ellipse(np.array([0.5, 0.5]), np.array([0.06, 0.05]), 0.3)


def solver_of(scenario: str) -> MpmSolver:
    solver = MpmSolver(scenarios.get(scenario, 4))
    solver.advance(60)
    return solver


@pytest.fixture(scope="module")
def water() -> MpmSolver:
    return solver_of("water_3d")


@pytest.fixture(scope="module")
def sand() -> MpmSolver:
    return solver_of("sand_3d")


@pytest.mark.parametrize("dim", [2, 3])
def test_each_dimension_has_its_network(dim: int) -> None:
    scene = scenarios.get(f"sand_{dim}d", 0)
    assert serving(TransportNetwork, None, scene).name == f"transport_{dim}d"


@pytest.mark.parametrize(("own", "other"), [(2, 3), (3, 2)])
def test_the_network_of_the_other_dimension_is_refused(own: int, other: int) -> None:
    solver = MpmSolver(scenarios.get(f"water_{own}d", 3))
    guidance = prepare(solver, ARROW, method=Learned(f"transport_{other}d"))
    assert guidance.method == "analytic"
    reason = f"transport_{other}d cannot serve this scene: it is trained in {other}D only"
    assert guidance.reason == f"learned falls back to analytic: {reason}"


def test_auto_takes_the_learned_plan_where_it_won(water: MpmSolver, sand: MpmSolver) -> None:
    sketches: list[tuple[Sketch, str]] = [(ARROW, "arrows"), (WIDE, "wide ovals")]
    for solver, (sketch, kind) in product((water, sand), sketches):
        guidance = prepare(solver, sketch)
        assert guidance.method == "learned", guidance.reason
        assert guidance.reason.startswith(f"for {kind} in 3D the learned plan led back nearer than guidance")


@pytest.mark.parametrize("name", ["water_2d", "sand_2d", "water_sand_2d", "water_ramps_2d", "sand_ramps_2d"])
def test_auto_takes_the_learned_plan_in_2d(name: str) -> None:
    """So it does for ovals that cannot be filled, and for arrows that need not be bent round obstacles."""
    solver = MpmSolver(scenarios.get(name, 4))
    solver.advance(60)
    wide = Ellipse(np.array([0.5, 0.5]), np.array([0.34, 0.28]), 0.0)
    among = " among obstacles" if "ramps" in name else ""
    guidance = prepare(solver, wide)
    assert guidance.method == "learned", guidance.reason
    assert guidance.reason.startswith(f"for wide ovals in 2D{among} the learned plan led back nearer")
    bent = prepare(solver, ARROW)
    if among and bent.goal.bent:
        assert bent.reason.startswith("guidance from the actual state")
    else:
        assert "learned" in bent.reason


def _with_an_obstacle() -> Scene:
    scene = scenarios.get("water_3d", 4)
    ball = {"shape": "ball", "center": [0.8, 0.8, 0.8], "radius": 0.05}
    return Scene.parse({**scene.model_dump(), "obstacles": [ball]})


def test_auto_takes_guidance_elsewhere(water: MpmSolver, sand: MpmSolver) -> None:
    """Narrow ovals are filled; networks have seen no parts of a fluid, and in 3D no obstacles."""
    cases: list[tuple[MpmSolver, Sketch, dict[str, Any]]] = [
        (water, NARROW, {}),
        (water, WIDE, {"fill": "shrink"}),
        (sand, NARROW, {}),
        (water, ARROW, {"who": 0}),
        (MpmSolver(_with_an_obstacle()), ARROW, {}),
        (
            MpmSolver(scenarios.get("water_2d", 3)),
            Ellipse(np.array([0.5, 0.5]), np.array([0.15, 0.1]), 0.3),
            {},
        ),
    ]
    for solver, sketch, options in cases:
        guidance = prepare(solver, sketch, **options)
        assert guidance.method == "analytic"
        assert "falls back" not in guidance.reason


@pytest.mark.parametrize("sketch", [ARROW, WIDE])
def test_the_first_frames_lead_to_the_goal_and_repeat(water: MpmSolver, sketch: Sketch) -> None:
    """Twelve frames come nearer than without a force; a snapshot goes on to the same bits."""
    free, led, again = (water.copy() for _ in range(3))
    one, two = (follow(solver, sketch, "learned") for solver in (led, again))
    free.advance(12)
    for _ in range(6):
        next(one)
        next(two)
    state, data = again.snapshot(), two.snapshot()
    restored = MpmSolver(water.scene)
    restored.restore(state)
    three = resume(restored, data)
    for _ in range(6):
        next(one)
        next(three)
    np.testing.assert_array_equal(led.positions, restored.positions)
    goal = one.guidance.goal.path[-1]
    weight = one.guidance.goal.cloud.weight
    assert one.guidance.method == "learned"
    away = [float(np.linalg.norm(weight @ solver.positions - goal)) for solver in (led, free)]
    assert away[0] < away[1]


def test_the_command_ends_well_where_a_learned_plan_brings_the_middle_to_the_oval(tmp_path: Path) -> None:
    """The oval is not filled: less than 95 % of the mass lies in it."""
    points = WIDE.center + np.stack([np.cos(TURN), np.sin(TURN)], axis=1) * WIDE.axes
    file = tmp_path / "oval.json"
    file.write_text(json.dumps({"strokes": [{"points": points.tolist()}]}))
    words = ["control", "water_3d", "--seed", "4", "--start", "60", "--sketch", str(file)]
    done = CliRunner().invoke(cli, words, prog_name="hybridmpm")
    assert done.exit_code == 0, done.output
    assert "method learned: for wide ovals in 3D" in done.output
    share = re.search(r"reached ([0-9.]+) % of the mass in the goal", done.output)
    assert share is not None
    assert float(share[1]) < 95


def test_the_oval_as_drawn_is_that_of_the_front_view(water: MpmSolver) -> None:
    goal = prepare(water, WIDE).goal
    aside = goal.paths.places.copy()
    aside[:, 2] = 0.12
    inside, drawn = goal.inside(aside), goal.inside_drawn(aside)
    assert inside is not None
    assert drawn is not None
    assert inside.mean() < 0.1
    assert drawn.mean() > 0.99
