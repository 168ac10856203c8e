"""Sketches that lead some of the particles: a body, a material, or those under a stroke."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner

from hybridmpm import BallSink, Box, ConfigError, MpmSolver, Scene
from hybridmpm.cli import cli
from hybridmpm.control import METHODS, Arrow, Ellipse, Oracle, follow, prepare, resume, reversed_from_seed

BODIES = [
    Box(lower=(0.15, 0.1), upper=(0.3, 0.25), material="water"),
    Box(lower=(0.6, 0.1), upper=(0.75, 0.25), material="sand"),
    Box(lower=(0.8, 0.1), upper=(0.88, 0.18), material="water"),
]
OVAL = Ellipse(np.array([0.4, 0.6]), np.array([0.1, 0.08]), 0.0)


def _solver(**more: Any) -> MpmSolver:
    settings = {name: more.pop(name) for name in ("r_p", "show_all") if name in more}
    return MpmSolver(Scene(dim=2, resolution=64, bodies=BODIES, **more), **settings)


@pytest.mark.parametrize("method", [name for name in METHODS if name != "none"])
def test_the_others_feel_no_force(method: str) -> None:
    led, free = _solver(), _solver()
    following = follow(led, OVAL, method, who=1, frames=20)
    result = following.run()
    free.advance(20)
    is_sand = led.materials == 6
    assert np.array_equal(following.guidance.goal.cloud.ids, led.ids[is_sand])
    assert result.positions.shape[1] == is_sand.sum() == len(result.ids)
    assert np.array_equal(result.positions[-1], led.positions[is_sand])
    # The water is far away, so its motion is that without the sketch.
    assert np.array_equal(led.positions[~is_sand], free.positions[~is_sand])
    assert not np.array_equal(led.positions[is_sand], free.positions[is_sand])


def test_goal_and_result_are_those_of_the_chosen() -> None:
    solver = _solver()
    following = follow(solver, OVAL, who="sand")
    assert following.guidance.goal.cloud.volume == pytest.approx(0.15**2, rel=0.05)
    assert following.run().reached.goal
    assert following.guidance.goal.inside(solver.positions[solver.materials == 5]).sum() == 0  # type: ignore[union-attr]


@pytest.mark.parametrize(
    ("who", "led"),
    [
        (0, [0]),
        (2, [2]),
        ("water", [0, 2]),
        (Ellipse(np.array([0.225, 0.175]), np.array([0.15, 0.15]), 0.3), [0]),
        (Arrow(np.array([[0.62, 0.12], [0.86, 0.14]])), None),
        ({"points": [(0.8, 0.12), (0.88, 0.12)], "kind": "arrow"}, None),
        ({"particle": 3}, [0]),
    ],
    ids=["body", "last body", "material", "oval", "line", "stroke", "particle"],
)
@pytest.mark.parametrize("settings", [{}, {"r_p": 1 / 4}, {"r_p": 1 / 4, "show_all": True}], ids=str)
def test_who_is_led(who: Any, led: list[int] | None, settings: dict[str, Any]) -> None:
    solver = _solver(**settings)
    cloud = prepare(solver, OVAL, who=who).goal.cloud
    assert cloud.partial
    if led is None:
        assert 0 < len(cloud.x) < solver.particle_count / 2
        assert cloud.x[:, 1].max() < 0.17
        return
    x = solver.positions
    inside = np.any([((x > BODIES[i].lower) & (x < BODIES[i].upper)).all(axis=1) for i in led], axis=0)
    assert np.array_equal(cloud.ids, solver.ids[inside])


def test_a_guidance_keeps_who_in_its_snapshot() -> None:
    solver = _solver()
    following = follow(solver, OVAL, who=1, frames=20)
    for _ in range(8):
        next(following)
    twin = _solver()
    twin.restore(solver.snapshot())
    rest = resume(twin, following.snapshot()).run()
    assert np.array_equal(rest.positions[-1], following.run().positions[-1])
    assert np.array_equal(twin.positions, solver.positions)


def test_recorded_forces_lead_the_chosen_again() -> None:
    solver = _solver(sinks=[BallSink(center=(0.5, 0.85), radius=0.02)])
    twin = solver.copy()
    result = follow(solver, OVAL, who=1, frames=15).run()
    twin.advance(15, (result.ids, result.force))
    assert np.array_equal(twin.positions, solver.positions)


@pytest.mark.parametrize(
    ("who", "message"),
    [
        (3, r"who must be .*\[0, 2\]"),
        ("sandy", "did you mean"),
        ("elastic", "chooses none"),
        (True, "index of a body"),
        (Ellipse(np.array([0.5, 0.8]), np.array([0.02, 0.02]), 0.0), "chooses none"),
        ({"particle": -1}, "particle must be"),
    ],
)
def test_a_wrong_choice_is_refused(who: Any, message: str) -> None:
    with pytest.raises(ConfigError, match=message):
        prepare(_solver(), OVAL, who=who)


def test_the_oracle_leads_all_or_none() -> None:
    case = reversed_from_seed("water_2d", 7, frames=10)
    with pytest.raises(ConfigError, match="without `who`"):
        prepare(
            case.simulator(),
            case.sketch,
            Oracle(case),
            frames=10,
            who=Ellipse(case.positions[0][0], np.array([0.05, 0.05]), 0.0),
        )


@pytest.mark.parametrize("form", ["1", "sand", "a file"])
def test_the_command_takes_who(form: str, tmp_path: Path) -> None:
    scene, sketch, over = (tmp_path / name for name in ("scene.json", "sketch.json", "over.json"))
    scene.write_text(_solver().scene.model_dump_json(exclude_none=True))
    sketch.write_text(json.dumps({"strokes": [{"points": [[0.67, 0.2], [0.67, 0.5]], "kind": "arrow"}]}))
    around = [[0.675 + 0.12 * np.cos(t), 0.175 + 0.12 * np.sin(t)] for t in np.linspace(0, 6.3, 40)]
    over.write_text(json.dumps({"strokes": [{"points": around, "kind": "ellipse"}]}))
    out = tmp_path / "run.npz"
    who = str(over) if form == "a file" else form
    files = ["control", str(scene), "--sketch", str(sketch), "--out", str(out)]
    run = CliRunner().invoke(cli, [*files, "--who", who, "--frames", "5"])
    assert run.exit_code in (0, 1), run.output
    with np.load(out) as arrays:
        assert arrays["positions"].shape[1] == _solver().particle_count
        assert len(arrays["force_ids"]) == (_solver().materials == 6).sum()
