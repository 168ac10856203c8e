"""The command line: what it writes, one-line errors, exit statuses, a clean Ctrl-C."""

import importlib.metadata
import json
import os
import signal
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from click.shell_completion import ShellComplete
from click.testing import CliRunner, Result

from hybridmpm import BallObstacle, Box, MpmSolver, Scene, SceneError, __version__, scenarios
from hybridmpm.cli import cli

MODULE = [sys.executable, "-m", "hybridmpm"]


def run(*arguments: object) -> Result:
    return CliRunner().invoke(cli, [str(argument) for argument in arguments], prog_name="hybridmpm")


def assert_fails(result: Result, status: int, message: str) -> None:
    assert result.exit_code == status
    lines = [line for line in result.stderr.splitlines() if not line.startswith(("Simulating", "Writing"))]
    assert len(lines) == 1, result.stderr
    assert lines[0].startswith("Error: ")
    assert message in lines[0]


@pytest.fixture
def scene_file(tmp_path: Path, drop: Scene) -> Path:
    drop.save(tmp_path / "drop.yaml")
    return tmp_path / "drop.yaml"


def test_simulate_a_scenario(tmp_path: Path) -> None:
    result = run(
        "simulate", "water_2d", "--seed", 3, "--frames", 6, "--every", 2, "--out", tmp_path / "a.npz"
    )
    assert result.exit_code == 0, result.output
    assert "6 frames" in result.stdout
    solver = MpmSolver(scenarios.water_2d(3))
    with np.load(tmp_path / "a.npz") as data:
        assert data["frames"].tolist() == [0, 2, 4, 6]
        np.testing.assert_array_equal(data["positions"], solver.rollout(6)[::2])


def test_simulate_a_scene_file_to_several_files(tmp_path: Path, scene_file: Path) -> None:
    names = ["a.npz", "a.gif", "a.png", "s%02d.ply", "a.vtp"]
    outputs = [part for name in names for part in ("--out", tmp_path / name)]
    result = run("simulate", "--scene", scene_file, "--frames", 8, "--every", 4, "--width", 80, *outputs)
    assert result.exit_code == 0, result.output
    written = {file.name for file in tmp_path.iterdir()} - {"drop.yaml"}
    assert written == {"a.npz", "a.gif", "a.png", "s00.ply", "s04.ply", "s08.ply", "a.vtp"}
    assert result.stdout.count("wrote ") == 5
    flat = run("simulate", "--scene", scene_file, "--out", tmp_path / "a.obj")
    assert flat.exit_code == 2
    assert "--out: surfaces need" in flat.stderr
    points = run("simulate", "--scene", scene_file, "--surface", "--out", tmp_path / "a.vtp")
    assert points.exit_code == 2
    assert "--surface is for --out FILE.ply" in points.stderr


def test_a_page_that_plays_is_written_without_a_run(tmp_path: Path, scene_file: Path) -> None:
    page, lesson = tmp_path / "drop.html", tmp_path / "lesson.md"
    lesson.write_text("# Falling\n\nIt <falls>.", encoding="utf-8")
    result = run("simulate", "--scene", scene_file, "--out", page, "--text", lesson)
    assert result.exit_code == 0, result.output
    assert result.stdout.startswith(f"wrote {page}: ")
    text = page.read_text(encoding="utf-8")
    assert "It &lt;falls&gt;." in text
    scene = ("simulate", "--scene", scene_file)
    assert_fails(run(*scene, "--out", tmp_path / "absent" / "a.html"), 1, "cannot write")
    assert "--text is for a page" in run(*scene, "--text", lesson).stderr
    assert "a page plays MPM alone" in run(*scene, "--budget-ms", 1, "--out", page).stderr


def test_simulate_without_output_tells_a_summary(scene_file: Path) -> None:
    result = run("simulate", "--scene", scene_file, "--frames", 0)
    assert result.exit_code == 0
    assert result.stdout.startswith("drop: 177 particles, 0 frames; ")


def test_simulate_without_output_says_what_it_discards(tmp_path: Path, scene_file: Path) -> None:
    discards = run("simulate", "--scene", scene_file, "--frames", 2)
    assert discards.exit_code == 0
    assert "All states of these 2 frames will be discarded: --out fluid.gif keeps a film" in discards.stderr
    for keeps in (("--save", tmp_path / "a.hmpm"), ("--out", tmp_path / "a.npz")):
        assert "discarded" not in run("simulate", "--scene", scene_file, "--frames", 2, *keeps).stderr


@pytest.mark.parametrize("rule", ["cfl", "reference", "20"])
def test_substep_rules(scene_file: Path, rule: str) -> None:
    assert run("simulate", "--scene", scene_file, "--frames", 2, "--substeps", rule).exit_code == 0


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["simulate"], "Give a scenario (water_2d, "),
        (["simulate", "water_2d", "--scene", "FILE"], "Give a scenario"),
        (["simulate", "lava"], "scenario: must be one of water_2d, "),
        (["simulate", "water_2d", "--seed", "-1"], "seed: must be a whole number in [0, 9007199254740991]"),
        (["simulate", "water_2d", "--substeps", "fast"], "none of cfl, reference or a whole number"),
        (["simulate", "water_2d", "--substeps", "0"], "substeps must be in [1, 20000], got 0"),
        (["simulate", "water_2d", "--out", "a.txt"], "--out: output files end in .gif"),
        (["simulate", "water_2d", "--out", "nowhere/a.npz"], "--out: the folder nowhere does not exist"),
        (["simulate", "--scene", "absent.json"], "File 'absent.json' does not exist"),
        (["simulate", "--speed", "0"], "--speed"),
        (["simulate", "--frmes", "3"], "--frmes"),
        (["serve", "--port", "65536"], "--port"),
    ],
)
def test_bad_input_is_one_line_and_status_2(arguments: list[str], message: str, scene_file: Path) -> None:
    assert_fails(run(*[scene_file if part == "FILE" else part for part in arguments]), 2, message)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (
            '{"dim": 2, "bodies": [{"shape": "ball", "material": "sand", "center": [1, 1], "radius": 0.1}]}',
            "bodies[0]: must lie inside the walls",
        ),
        ("{", "the scene is not JSON"),
    ],
)
def test_bad_scene_file(tmp_path: Path, text: str, message: str) -> None:
    (tmp_path / "bad.json").write_text(text)
    assert_fails(run("simulate", "--scene", tmp_path / "bad.json"), 2, message)


def test_a_run_that_fails_is_status_1(scene_file: Path, tmp_path: Path) -> None:
    result = run("simulate", "--scene", scene_file, "--substeps", 1, "--out", tmp_path / "a.npz")
    assert_fails(result, 1, "above the stability limit")
    assert not (tmp_path / "a.npz").exists()


def test_interrupt_of_the_real_command(tmp_path: Path) -> None:
    """A signal during a long run: status 130 and no file, neither whole nor torn."""
    command = [*MODULE, "simulate", "sand_3d", "--frames", "100000", "--every", "500"]
    with subprocess.Popen(
        [*command, "--out", tmp_path / "a.npz"], stderr=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    ) as process:
        assert process.stderr.readline().startswith("Simulating")
        process.send_signal(signal.SIGINT)
        _, errors = process.communicate(timeout=120)
    assert process.returncode == 130
    assert "Traceback" not in errors
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(("number", "status"), [("SIGINT", 130), ("SIGTERM", 143), ("SIGHUP", 129)])
def test_an_interrupted_run_is_saved_and_goes_on(number: str, status: int, tmp_path: Path) -> None:
    state = tmp_path / "state"
    command = [*MODULE, "simulate", "water_2d", "--frames", "100000"]
    with subprocess.Popen(
        [*command, "--save", state], stderr=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    ) as process:
        assert process.stderr.readline().startswith("Simulating")
        process.send_signal(getattr(signal, number))
        output, errors = process.communicate(timeout=120)
    assert process.returncode == status
    assert "Traceback" not in errors
    assert [file.name for file in tmp_path.iterdir()] == ["state"]
    solver = MpmSolver.load(state)
    assert f"saved frame {solver.frame} to {state}" in output
    twin = MpmSolver(scenarios.water_2d(0))
    twin.advance(solver.frame)
    assert solver.snapshot() == twin.snapshot()


def test_installed_command_and_module_agree(tmp_path: Path) -> None:
    installed = Path(sys.executable).with_name("hybridmpm")
    for command in ([installed], MODULE):
        done = subprocess.run([*command, "--version"], capture_output=True, text=True, check=True)
        assert done.stdout == f"hybridmpm, version {__version__}\n"
    outside = {key: value for key, value in os.environ.items() if key != "PYTHONPATH"}
    elsewhere = subprocess.run(
        [installed, "schema"], capture_output=True, text=True, check=True, cwd=tmp_path, env=outside
    )
    assert json.loads(elsewhere.stdout) == Scene.json_schema()


def test_a_subcommand_is_imported_when_it_is_asked_for() -> None:
    program = "import sys; from hybridmpm.cli import main; sys.argv[1:] = ['schema']\ntry: main()\n"
    program += "finally: print(*(name for name in sys.modules if name.startswith('hybridmpm.cli.')))"
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert set(done.stdout.splitlines()[-1].split()) == {"hybridmpm.cli.report"}


def test_all_subcommands_are_listed_completed_and_guessed() -> None:
    names = [
        "calibrate", "check", "control", "dataset", "doctor", "export", "key", "plan", "scenarios", "schema",
        "serve", "simulate", "train",
    ]  # fmt: skip
    listed = run("--help").stdout.partition("Commands:\n")[2].splitlines()
    assert [line.split()[0] for line in listed] == names
    assert [cli.commands[name].name for name in names] == names
    complete = ShellComplete(cli, {}, "hybridmpm", "_HYBRIDMPM_COMPLETE").get_completions
    assert [found.value for found in complete([], "s")] == ["scenarios", "schema", "serve", "simulate"]
    assert "--frames" in {found.value for found in complete(["simulate"], "--f")}
    assert [found.value for found in complete(["simulate"], "sand")] == [
        "sand_2d",
        "sand_ramps_2d",
        "sand_3d",
    ]
    assert [found.value for found in complete(["simulate", "--coarse"], "1/1")] == ["1/16"]
    assert "fluids_2d" in {found.value for found in complete(["simulate", "--model"], "f")}
    assert_fails(run("simulat"), 2, "No such command 'simulat'. Did you mean 'simulate'?")


def test_schema_scenarios_and_help() -> None:
    assert json.loads(run("schema").stdout) == Scene.json_schema()
    listed = run("scenarios").stdout.splitlines()
    assert [line.split()[0] for line in listed] == list(scenarios.NAMES)
    assert run("scenarios", "--ranges").stdout.count("\n") == len(scenarios.NAMES) + 2
    for name in ("simulate", "doctor", "schema", "scenarios"):
        assert run(name, "--help").stdout.startswith("Usage: hybridmpm")
    assert run("serve", "--help").stdout.startswith("usage: hybridmpm serve")
    assert "Usage: hybridmpm" in run().output


def test_doctor_is_well_here() -> None:
    result = run("doctor")
    assert result.exit_code == 0
    states = {line[:13].strip(): line[14:22].strip() for line in result.stdout.splitlines()}
    for subject in ("hybridmpm", "python", "threads", "cpu features", "solver"):
        assert states[subject] == "ok"
    for library in ("numpy", "pydantic", "pillow", "click", "pyyaml"):
        assert states[library] == "ok"
        assert importlib.metadata.version(library) in result.stdout
    assert set(states.values()) <= {"ok", "missing"}


def test_doctor_tells_what_is_broken_or_missing(monkeypatch: pytest.MonkeyPatch) -> None:
    def broken(_seed: int) -> Scene:
        raise SceneError("no scene today")

    monkeypatch.setattr("hybridmpm.cli.report.water_2d", broken)
    monkeypatch.setattr("hybridmpm.cli.report._BROWSERS", ())
    monkeypatch.setitem(sys.modules, "imageio_ffmpeg", None)
    result = run("doctor")
    assert result.exit_code == 1
    assert "solver        broken   no scene today" in result.stdout
    assert "mp4 encoder   missing  pip install 'hybridmpm[video]'" in result.stdout
    assert "chromium      missing" in result.stdout


def test_serve_hands_over_to_the_service(monkeypatch: pytest.MonkeyPatch) -> None:
    calls: list[tuple[str, ...]] = []

    def main(arguments: tuple[str, ...], command: str) -> int:
        calls.append((command, *arguments))
        return 130

    monkeypatch.setitem(sys.modules, "hybridmpm_service", SimpleNamespace(main=main))
    assert run("serve").exit_code == 130
    assert run("serve", "--host", "::1", "--max-sessions=3").exit_code == 130
    assert calls == [("hybridmpm serve",), ("hybridmpm serve", "--host", "::1", "--max-sessions=3")]


def test_serve_has_all_flags_of_the_service() -> None:
    text = run("serve", "--help").stdout
    for name in importlib.import_module("hybridmpm_service").Settings.model_fields:
        assert f"--{name.replace('_', '-')} " in text
    assert_fails(run("serve", "--max-session", 3), 2, "--max-session")
    assert_fails(run("serve", "--idle-seconds", "soon"), 2, "--idle-seconds")


def test_serve_without_the_service_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "hybridmpm_service", None)
    assert_fails(run("serve"), 1, "pip install 'hybridmpm[service]'")


def test_serve_names_a_library_that_the_service_lacks(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in [name for name in sys.modules if name.split(".")[0] == "hybridmpm_service"]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, "uvicorn", None)
    assert_fails(run("serve"), 1, "uvicorn is missing; install it with: pip install 'hybridmpm[service]'")


def test_a_run_in_two_parts_is_the_run_in_one(tmp_path: Path, scene_file: Path) -> None:
    state, whole, parts = tmp_path / "a.hmpm", tmp_path / "whole.npz", tmp_path / "parts.npz"
    source = ("simulate", "--scene", scene_file, "--substeps", "reference")
    assert run(*source, "--frames", 12, "--out", whole).exit_code == 0
    saved = run(*source, "--frames", 5, "--save", state)
    assert saved.exit_code == 0, saved.output
    assert f"saved frame 5 to {state}" in saved.stdout
    resumed = run(
        "simulate", "--resume", state, "--frames", 7, "--threads", 2, "--out", parts, "--save", state
    )
    assert resumed.exit_code == 0, resumed.output
    assert f"saved frame 12 to {state}" in resumed.stdout
    with np.load(whole) as one, np.load(parts) as two:
        assert two["frames"].tolist() == list(range(5, 13))
        np.testing.assert_array_equal(two["positions"], one["positions"][5:])


def test_without_frames_a_resumed_run_goes_to_the_end_of_the_scene(tmp_path: Path, drop: Scene) -> None:
    drop.model_copy(update={"frames": 9}).save(tmp_path / "short.yaml")
    state = tmp_path / "state"
    assert run("simulate", "--scene", tmp_path / "short.yaml", "--frames", 4, "--save", state).exit_code == 0
    assert "5 frames" in run("simulate", "--resume", state, "--save", state).stdout
    assert "0 frames" in run("simulate", "--resume", state).stdout


def test_a_frame_that_fails_leaves_the_state_before_it(tmp_path: Path) -> None:
    crash = {"dim": 2, "resolution": 64, "bodies": []}
    for lower, speed in (([0.3, 0.3], 45.0), ([0.52, 0.3], -45.0)):
        upper = [lower[0] + 0.18, 0.5]
        body = {"shape": "box", "material": "water", "lower": lower, "upper": upper, "velocity": [speed, 0]}
        crash["bodies"].append(body)
    Scene.parse(crash).save(tmp_path / "crash.json")
    result = run(
        "simulate", "--scene", tmp_path / "crash.json", "--substeps", 1, "--save", tmp_path / "state"
    )
    assert result.exit_code == 1
    assert "saved frame 0" in result.stdout
    assert MpmSolver.load(tmp_path / "state").frame == 0


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["water_2d"], "drop '[SCENARIO]'"),
        (["--scene", "FILE"], "drop '--scene'"),
        (["--seed", "0"], "drop '--seed'"),
        (["--substeps", "cfl"], "drop '--substeps'"),
    ],
)
def test_what_a_resumed_run_cannot_change(
    tmp_path: Path, scene_file: Path, drop: Scene, arguments: list[str], message: str
) -> None:
    MpmSolver(drop).save(tmp_path / "state")
    words = [scene_file if word == "FILE" else word for word in arguments]
    result = run("simulate", "--resume", tmp_path / "state", *words)
    assert_fails(result, 2, "--resume continues with the scene and settings of its file; " + message)


def test_files_that_cannot_be_resumed_or_saved(tmp_path: Path) -> None:
    (tmp_path / "notes").write_text("no snapshot")
    assert_fails(run("simulate", "--resume", tmp_path / "notes"), 2, "notes is no snapshot file of hybridmpm")
    result = run("simulate", "water_2d", "--save", tmp_path / "nowhere" / "a")
    assert_fails(result, 2, f"--save: the folder {tmp_path / 'nowhere'} does not exist")


def test_warnings_are_one_line(tmp_path: Path) -> None:
    body = Box(material="water", lower=(0.4, 0.4), upper=(0.6, 0.6))
    thin = BallObstacle(center=(0.5, 0.3), radius=0.005)
    Scene(dim=2, resolution=32, bodies=(body,), obstacles=(thin,)).save(tmp_path / "thin.yaml")
    options = ["--scene", tmp_path / "thin.yaml", "--frames", "1", "--save", tmp_path / "state.hmpm"]
    done = subprocess.run([*MODULE, "simulate", *options], capture_output=True, text=True, check=True)
    assert done.stderr.startswith("Warning: obstacles[0] (ball) is 0.01 m thick")
    assert done.stderr.splitlines()[1].startswith("Simulating")
