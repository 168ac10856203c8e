"""`hybridmpm control`: needs, files, and an exit status that says whether the goal was reached."""

import json
import re
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner, Result
from PIL import Image

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


def _run(folder: Path, *arguments: str, scene: str = "scene.yaml") -> Result:
    return CliRunner().invoke(cli, ["control", str(folder / scene), *arguments])


def test_a_sketch_is_followed_and_written(folder: Path) -> None:
    files = [folder / name for name in ("led.npz", "led.png")]
    out = [word for file in files for word in ("--out", str(file))]
    run = _run(folder, "--sketch", str(folder / "arrow.json"), "--start", "4", *out)
    assert run.exit_code == 0, run.output
    assert "method learned: for arrows in 2D" in run.output
    assert "15 g allowed" in run.output
    assert "centre of mass" in run.output
    assert all(f"wrote {file}" in run.output for file in files)
    with np.load(files[0]) as data:
        led = dict(data)
    assert led["first_frame"] == 4
    assert len(led["positions"]) == len(led["frames"]) == 4 + len(led["force"]) + 1
    assert set(led["simulated_by"]) == {"mpm"}
    solver = MpmSolver(SCENE)
    assert np.array_equal(solver.rollout(4), led["positions"][:5])
    assert np.array_equal(solver.rollout(len(led["force"]), led["force"]), led["positions"][4:])
    np.testing.assert_allclose(led["displacement"], [0.2, 0.2], atol=3e-3)


def test_the_hybrid_runs_is_led_and_goes_on_by_its_own_rules(folder: Path) -> None:
    """A block in free fall, which the network "zero" knows; a sketch from frame 30 on; free fall again."""
    files = [folder / name for name in ("run.npz", "run.gif")]
    out = [word for file in files for word in ("--out", str(file))]
    run = _run(
        folder,
        *("--sketch", str(folder / "oval.png"), "--solver", "hybrid", "--model", "zero", "--start", "30"),
        *("--frames", "60", "--after", "70", "--width", "100", *out),
    )
    assert run.exit_code == 0, run.output
    lines = [line for line in run.output.splitlines() if line.startswith("frames ")]
    assert lines[:3] == [
        "frames 1 to 10: MPM, from whose states free fall begins",
        "frames 11 to 30: free fall, warm-up",
        "frames 31 to 90: MPM, led by the sketch",
    ]
    # Two windows of accelerations, and one of calm; the reason is the log's.
    waiting, again = (re.fullmatch(r"frames (\d+) to (\d+): (.*)", line) for line in lines[3:5])
    assert waiting[3] == "MPM, as since frame 30"
    assert again[3].startswith("free fall, calm ")
    assert 90 < int(again[1]) <= 155
    with np.load(files[0]) as data:
        whole = dict(data)
    assert whole["positions"].shape[0] == 161
    assert whole["simulated_by"].tolist()[:30] == ["mpm"] * 10 + ["neural"] * 20
    assert set(whole["simulated_by"][30:90]) == {"mpm"}
    assert whole["simulated_by"][int(again[1]) - 1] == "neural"
    with Image.open(files[1]) as film:
        pictures = []
        for index in range(film.n_frames):
            film.seek(index)
            pictures.append(np.asarray(film.convert("RGB")).astype(int))
    green = [
        int((picture[..., 1] - picture.max(axis=2, where=[True, False, True], initial=0) > 40).sum())
        for picture in pictures
    ]
    # 160 frames at 8 a picture: the ghost is there from frame 30 to frame 90, from 80 on under bright water.
    seen = {8 * index: count > 20 for index, count in enumerate(green) if not 80 <= 8 * index <= 96}
    assert seen == {frame: 30 <= frame <= 90 for frame in seen}


def test_a_network_for_a_scene_file_must_be_named(folder: Path) -> None:
    run = _run(folder, "--sketch", str(folder / "arrow.json"), "--solver", "hybrid")
    assert run.exit_code == 2
    assert "give a model" in run.output


def test_a_goal_that_is_missed_gives_status_1(folder: Path) -> None:
    run = _run(folder, "--sketch", str(folder / "oval.png"), "--method", "none", "--frames", "5")
    assert run.exit_code == 1, run.output
    assert "0.0 % of the mass in the goal" in run.output
    assert "frames would do" in run.output
    assert "exit status 1: the middle must be within" in run.output


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
    assert "lava is neither a file nor a scenario" in run.output


def test_shapes_and_goals_in_turn_are_read_from_files(folder: Path) -> None:
    place = {"center": [0.55, 0.5], "height": 0.18}
    Image.fromarray(np.kron(np.array([[255] * 4, [255, 0, 0, 255], [255] * 4]), np.ones((20, 20)))).convert(
        "L"
    ).save(folder / "logo.png")
    goals = {
        "text": {"text": "I", **place},
        "path": {"path": "M0 0h2v2h-2z", **place},
        "picture": {"picture": "logo.png", **place},
        "keyframes": {
            "keyframes": [
                {"path": "M0 0h2v2h-2z", "frames": 120, **place},
                {"strokes": [{"points": [[0.5, 0.5], [0.4, 0.4]], "kind": "arrow"}], "frames": 50, "who": 0},
            ]
        },
    }
    for name, content in goals.items():
        (folder / "goal.json").write_text(json.dumps(content))
        run = _run(folder, "--sketch", str(folder / "goal.json"), "--out", str(folder / "led.npz"))
        assert run.exit_code == 0, (name, run.output)
        assert run.output.count("needs ") == run.output.count("reached ") == (2 if name == "keyframes" else 1)
    with np.load(folder / "led.npz") as data:
        assert len(data["force"]) == 170


@pytest.mark.needs("trimesh", "shapes")
def test_a_file_of_a_surface_is_a_goal(folder: Path) -> None:
    import trimesh

    trimesh.creation.icosphere(2).export(folder / "ball.stl")
    (folder / "goal.json").write_text(json.dumps({"file": "ball.stl", "center": [0.5] * 3, "height": 0.13}))
    body = {"shape": "box", "lower": [0.2] * 3, "upper": [0.4] * 3, "material": "water"}
    (folder / "space.json").write_text(json.dumps({"dim": 3, "resolution": 16, "bodies": [body]}))
    run = _run(folder, "--sketch", str(folder / "goal.json"), "--frames", "40", scene="space.json")
    assert "of 15 g allowed" in run.output
    assert "make it thicker" in run.output
    (folder / "goal.json").write_text(json.dumps({"file": "ball.stl", "center": [0.5] * 3}))
    assert "height is missing beside file" in _run(folder, "--sketch", str(folder / "goal.json")).output


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ({"text": "I"}, "center is missing beside text, in metres"),
        ({"text": "I", "path": "M0 0"}, "must be an object with one of strokes, sketch, text, picture"),
        ({"path": "M0 0L1", "center": [0.5, 0.5], "height": 0.1}, "command 'L' expects 2 values"),
        ({"sketch": {"kind": "star"}}, "sketch: it must have a kind"),
        ({"strokes": [], "height": 1}, "height: there is no such field beside strokes"),
        ({"keyframes": [{"frames": 5}]}, "must be an object with one of"),
    ],
)
def test_what_is_no_goal_in_a_file_is_refused(folder: Path, content: object, message: str) -> None:
    (folder / "goal.json").write_text(json.dumps(content))
    run = _run(folder, "--sketch", str(folder / "goal.json"))
    assert run.exit_code != 0
    assert message in " ".join(run.output.split())
