"""`hybridmpm simulate --solver hybrid`."""

from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner, Result

from hybridmpm import Scene
from hybridmpm.cli import cli


def run(*words: str) -> Result:
    return CliRunner().invoke(cli, ["simulate", *words], prog_name="hybridmpm")


@pytest.fixture
def scene_file(tmp_path: Path, fall: Scene) -> Path:
    file = tmp_path / "fall.json"
    file.write_text(fall.model_dump_json())
    return file


def test_the_hybrid_simulates_and_tells_the_share_of_mpm(scene_file: Path, tmp_path: Path) -> None:
    out = tmp_path / "fall.npz"
    done = run("--scene", str(scene_file), "--solver", "hybrid", "--model", "zero", "--frames", "30",
               "--every", "10", "--out", str(out))  # fmt: skip
    assert done.exit_code == 0, done.output
    # 10 frames of warm-up; the block is still falling after 30.
    assert "33 % of the frames by MPM" in done.output
    assert np.load(out)["positions"].shape == (4, 256, 2)


def test_a_network_simulates_alone(scene_file: Path) -> None:
    done = run("--scene", str(scene_file), "--solver", "neural", "--model", "zero", "--frames", "30")
    assert done.exit_code == 0, done.output
    assert "fall: 256 particles, 30 frames" in done.output


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["--solver", "mpm", "--model", "zero"], "'--model' is for --solver neural or hybrid, not for mpm"),
        (["--solver", "hybrid", "--substeps", "3"], "'--substeps' is for --solver mpm, not for hybrid"),
        (["--solver", "neural", "--r-c", "0.5"], "'--r-c' is for --solver hybrid, not for neural"),
        (["--solver", "hybrid"], "choose a network by --model NAME"),
        (["--solver", "hybrid", "--model", "zero", "--r-c", "1.5"], "1.5 is not in the range"),
        (["--solver", "hybrid", "--model", "none such"], "there is no model 'none such'"),
    ],
)
def test_what_cannot_be_is_refused(scene_file: Path, words: list[str], message: str) -> None:
    done = run("--scene", str(scene_file), "--frames", "1", *words)
    assert done.exit_code != 0
    assert message in f"{done.output} {done.exception}"
