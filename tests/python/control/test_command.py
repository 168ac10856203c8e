"""`hybridmpm control`: needs, files, and an exit status that says whether the goal was reached."""

import json
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner, Result

from hybridmpm import Box, MpmSolver, Scene
from hybridmpm.cli import cli
from hybridmpm.control import Ellipse, render_png

SCENE = Scene(dim=2, resolution=64, bodies=[Box(lower=(0.2, 0.2), upper=(0.35, 0.35), material="water")])


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    SCENE.save(tmp_path / "scene.yaml")
    arrow = {"points": [[0.3, 0.3], [0.5, 0.5]], "kind": "arrow"}
    (tmp_path / "arrow.json").write_text(json.dumps({"strokes": [arrow]}))
    oval = Ellipse(np.array([0.6, 0.6]), np.array([0.1, 0.075]), 0.4)
    (tmp_path / "oval.png").write_bytes(render_png(oval))
    return tmp_path


def _run(folder: Path, *arguments: str) -> Result:
    return CliRunner().invoke(cli, ["control", str(folder / "scene.yaml"), *arguments])


def test_a_sketch_is_followed_and_written(folder: Path) -> None:
    files = [folder / name for name in ("led.npz", "led.png")]
    out = [word for file in files for word in ("--out", str(file))]
    run = _run(folder, "--sketch", str(folder / "arrow.json"), "--start", "4", *out)
    assert run.exit_code == 0, run.output
    assert "method analytic: " in run.output
    assert "15 g allowed" in run.output
    assert "centre of mass" in run.output
    assert all(f"wrote {file}" in run.output for file in files)
    with np.load(files[0]) as data:
        led = dict(data)
    solver = MpmSolver(SCENE)
    solver.advance(int(led["first_frame"]))
    assert np.array_equal(solver.rollout(len(led["force"]), led["force"]), led["positions"])
    np.testing.assert_allclose(led["displacement"], [0.2, 0.2], atol=3e-3)


def test_a_goal_that_is_missed_gives_status_1(folder: Path) -> None:
    run = _run(folder, "--sketch", str(folder / "oval.png"), "--method", "none", "--frames", "5")
    assert run.exit_code == 1, run.output
    assert "0.0 % of the mass in the goal" in run.output
    assert "frames would do" in run.output


def test_an_oval_from_a_picture_is_filled(folder: Path) -> None:
    run = _run(folder, "--sketch", str(folder / "oval.png"), "--hold", "3")
    assert run.exit_code == 0, run.output


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ("{", "is not JSON"),
        ("[]", "must be an object"),
        ('{"strokes": []}', "stroke"),
        ('{"strokes": [{"points": [[0.3, 0.3], [0.301, 0.3]], "kind": "arrow"}]}', "must be at least"),
    ],
)
def test_a_bad_sketch_gives_one_line_and_status_2(folder: Path, content: str, message: str) -> None:
    (folder / "bad.json").write_text(content)
    run = _run(folder, "--sketch", str(folder / "bad.json"))
    assert run.exit_code == 2
    assert "bad.json" in run.output
    assert message in run.output
    assert len(run.output.strip().splitlines()) == 1


def test_a_scene_that_does_not_exist_is_named(folder: Path) -> None:
    run = CliRunner().invoke(cli, ["control", "lava", "--sketch", str(folder / "arrow.json")])
    assert run.exit_code == 2
    assert "water_2d" in run.output
    assert "'lava'" in run.output
