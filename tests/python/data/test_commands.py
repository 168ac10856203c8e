"""`hybridmpm dataset ...`: what it writes and prints, and one-line errors."""

import json
import re
import shutil
from pathlib import Path

import numpy as np
import pytest
import yaml
from click.testing import CliRunner, Result
from PIL import Image

from hybridmpm.cli import cli
from hybridmpm.data import metadata

from . import tfrecords
from .conftest import SOME_TOO_STIFF, trajectories


def run(*arguments: object) -> Result:
    return CliRunner().invoke(cli, ["dataset", *map(str, arguments)], prog_name="hybridmpm")


def assert_fails(result: Result, message: str, status: int = 2) -> None:
    assert result.exit_code == status, result.output
    errors = [line for line in result.stderr.splitlines() if line.startswith("Error: ")]
    assert len(errors) == 1, result.stderr
    assert message in errors[0]
    assert "Traceback" not in result.output


def test_generate_a_scenario(tmp_path: Path) -> None:
    arguments = ["generate", "sand_2d", "--trajectories", 2, "--seed", 5, "--frames", 4, "--stride", 2]
    result = run(*arguments, "--out", tmp_path / "sand")
    assert result.exit_code == 0, result.output
    assert "2 train, 1 valid, 1 test; 0 of them are there. The others take up to " in result.stderr
    assert result.stdout.endswith("sand: 4 trajectories, 4 of them new\n")
    assert [one.seed for one in trajectories(tmp_path / "sand")] == [5, 6]
    assert [one.seed for one in trajectories(tmp_path / "sand", "test")] == [1_100_005]
    assert metadata.read(tmp_path / "sand")["dt"] == pytest.approx(0.005)
    again = run(*arguments, "--out", tmp_path / "sand")
    assert again.exit_code == 0
    assert again.stdout.endswith("sand: 4 trajectories, 0 of them new\n")


def test_generate_tells_failures_and_status_1(tmp_path: Path) -> None:
    (tmp_path / "drops.yaml").write_text(yaml.safe_dump(SOME_TOO_STIFF, sort_keys=False))
    arguments = ["--trajectories", 8, "--valid", 0, "--test", 0, "--frames", 3, "--substeps", 20]
    result = run("generate", "--scene", tmp_path / "drops.yaml", *arguments, "--out", tmp_path / "drops")
    assert result.exit_code == 1
    failures = re.findall(r"seed (\d) failed: a substep of ", result.stderr)
    there = [one.seed for one in trajectories(tmp_path / "drops")]
    assert failures
    assert sorted([*map(int, failures), *there]) == list(range(8))


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["generate", "--trajectories", "1", "--out", "x"], "Give a scenario (water_2d, "),
        (["generate", "lava", "--trajectories", "1", "--out", "x"], "scenario: must be one of water_2d"),
        (["generate", "sand_2d", "--out", "x"], "Missing option '--trajectories'"),
        (["generate", "sand_2d", "--trajectories", "1", "--out", "x", "--r-p", "1/0"], "'1/0' is no number"),
        (["generate", "sand_2d", "--trajectories", "1", "--out", "x", "--r-p", "2"], "r_p must be in (0, 1]"),
        (["stats", "nowhere"], "nowhere is no folder"),
        (["stats", "DATA", "--split", "exam"], "exam.h5 does not exist"),
        (["view", "DATA", "--out", "x.txt"], "--out: files end in .png, .gif or .mp4"),
        (["view", "DATA", "--out", "x.gif", "--index", "0", "--index", "1"], "a film shows one trajectory"),
        (["view", "DATA", "--out", "x.png", "--index", "9"], "holds the trajectories 0 to 3, not 9"),
        (["convert", "DATA", "--to", "deepmind", "--out", "x"], "the format deepmind is only read"),
        (["convert", "DATA", "--to", "hdf6", "--out", "x"], "'hdf6' is not one of"),
    ],
)
def test_bad_input(
    arguments: list[str], message: str, made: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    assert_fails(run(*[made if part == "DATA" else part for part in arguments]), message)
    assert not (tmp_path / "x").exists()


def test_stats(made: Path) -> None:
    result = run("stats", made)
    assert result.exit_code == 0, result.output
    assert "train (hybridmpm)\n  trajectories     4\n" in result.stdout
    found = json.loads(run("stats", made, "--json").stdout)
    about = metadata.read(made)
    assert {split: part["digest"] for split, part in found.items()} == about["hybridmpm"]["digests"]
    assert found["train"]["vel_std"] == about["vel_std"]
    assert list(json.loads(run("stats", made, "--split", "test", "--json").stdout)) == ["test"]


def test_a_sheet_and_a_film(made: Path, tmp_path: Path) -> None:
    sheet, film = tmp_path / "a.png", tmp_path / "a.gif"
    assert run("view", made, "--out", sheet, "--moments", 3, "--width", 80).exit_code == 0
    with Image.open(sheet) as picture:
        assert picture.size == (3 * 80 + 2 * 6, 4 * 80 + 3 * 6)
        row = np.asarray(picture)[40]
        assert not np.array_equal(row[10:70], row[182:242])
    assert run("view", made, "--out", film, "--split", "test", "--width", 80, "--speed", 0.1).exit_code == 0
    with Image.open(film) as picture:
        assert picture.n_frames > 5


@pytest.mark.parametrize("bounds", [[[0.1, 0.9], [0.1, 0.9]], [[-1.0, 3.0], [0.0, 2.0]]])
def test_a_sheet_of_foreign_data_shows_its_obstacles(tmp_path: Path, bounds: list[list[float]]) -> None:
    low, high = np.array(bounds, dtype=np.float32).T
    grid = np.stack(np.meshgrid(np.linspace(0.4, 0.5, 20), np.linspace(0.4, 0.5, 20)), axis=-1).reshape(-1, 2)
    x = (low + (high - low) * np.concatenate([grid, grid + np.array([0.3, 0.0])])).astype(np.float32)
    one = tfrecords.data.Trajectory(positions=np.stack([x, x, x]), types=np.array([5] * 400 + [3] * 400))
    about = {"bounds": bounds, "dim": 2, "dt": 0.0025, "sequence_length": 2}
    radius = 0.02 * float((high - low).max())
    tfrecords.write(tmp_path / "dm", "train", [one], {**about, "default_connectivity_radius": radius})
    result = run("view", tmp_path / "dm", "--out", tmp_path / "a.png", "--moments", 1, "--width", 200)
    assert result.exit_code == 0, result.output
    with Image.open(tmp_path / "a.png") as picture:
        pixels = np.asarray(picture).astype(int)
    height = pixels.shape[0]
    inside = 200 * 0.03 / 1.06, 200 * 1.0 / 1.06
    at = [int(inside[0] + inside[1] * place) for place in (0.45, 0.75)]
    water, solid = (
        pixels[int(height * 0.547) - 3 : int(height * 0.547) + 3, x - 3 : x + 3].mean((0, 1)) for x in at
    )
    assert water[2] > 2 * water[0] > 0
    assert solid[2] < 1.6 * solid[0]
    assert solid[0] > 80


def test_convert(made: Path, tmp_path: Path) -> None:
    result = run("convert", made, "--to", "gns", "--out", tmp_path / "gns")
    assert result.exit_code == 0, result.output
    assert "gns cannot store force, mass, scene; left out" in result.stderr
    assert result.stdout.startswith("wrote 4 train, 1 valid, 1 test to ")
    back = run("convert", tmp_path / "gns", "--to", "lagrangebench", "--out", tmp_path / "lb")
    assert back.exit_code == 0, back.output
    found = json.loads(run("stats", tmp_path / "lb", "--json").stdout)
    assert found["train"]["types"] == json.loads(run("stats", made, "--json").stdout)["train"]["types"]


def test_a_format_must_be_named_where_nothing_tells(made: Path, tmp_path: Path) -> None:
    shutil.copy(made / "train.h5", tmp_path)
    assert_fails(run("stats", tmp_path), "name the format lagrangebench (3 is a rigid body) or hybridmpm")
    assert run("stats", tmp_path, "--from", "hybridmpm").exit_code == 0


def test_without_h5py(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(__import__("sys").modules, "h5py", None)
    arguments = ["generate", "sand_2d", "--trajectories", 1, "--frames", 4, "--out", tmp_path / "x"]
    assert_fails(run(*arguments), "data sets need h5py; install it with: pip install 'hybridmpm[data]'")


def test_without_ray(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(__import__("sys").modules, "ray", None)
    arguments = ["generate", "sand_2d", "--trajectories", 1, "--executor", "ray", "--out", tmp_path / "x"]
    assert_fails(run(*arguments), "needs Ray; install it with: pip install 'hybridmpm[ray]'")
