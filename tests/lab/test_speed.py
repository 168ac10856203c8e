"""Measurements of speed: their rows are complete and true, whatever the machine's speed."""

import dataclasses
import importlib.util
import itertools
import math
import os
import shutil
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner

from hybridmpm import MpmSolver, SceneError, SimulationError, scenarios
from hybridmpm_lab.commands import cli
from hybridmpm_lab.harness import timing
from hybridmpm_lab.harness.rows import read_rows
from hybridmpm_lab.harness.timing import Calibration
from hybridmpm_lab.speed import packages, solver
from hybridmpm_lab.speed.baselines import SOLVERS

ORIGIN = {"machine", "date", "commit", "command", "solver_version", "ingredients"}
TIMES = ORIGIN | {
    "dim", "particles", "resolution", "frame", "threads", "instructions", "substeps",
    "ns_per_particle_substep", "spread", "ms_per_frame", "peer", "peer_ns", "peer_threads", "peer_way",
    "ratio", "slowdown", "loaded",
}  # fmt: skip


def measured(folder: Path, *arguments: str, chart: bool = True) -> tuple[str, list[dict[str, Any]]]:
    """Run a command with one timing of each; return what it printed, and the rows of its file."""
    file, picture = folder / "rows.json", folder / "chart.svg"
    files = ["--json", str(file), *(["--chart", str(picture)] if chart else [])]
    result = CliRunner().invoke(cli, [*arguments, "--repeats", "1", *files])
    assert result.exit_code == 0, result.output
    assert not chart or picture.stat().st_size > 5_000
    return result.stdout, read_rows(file)


def test_rows_of_the_solver(tmp_path: Path) -> None:
    sizes = ["--particles", "216", "--particles", "512", "--threads", "2", "--threads", "1"]
    sets = ["--instructions", "portable", "--instructions", "avx2"]
    printed, rows = measured(tmp_path, "speed", *sizes, *sets, "--frame", "20")
    expected = [(*case, n, t) for n in (216, 512) for case in solver.CASES for _ in range(2) for t in (2, 1)]
    assert [(row["dim"], row["material"], row["particles"], row["threads"]) for row in rows] == expected
    assert [row["instructions"] for row in rows[:2]] == ["portable"] * 2
    assert {row["instructions"] for row in rows[2:4]} <= {"portable", "avx2"}
    for row in rows:
        assert set(row) == TIMES | {"material"}
        assert f"{row['ns_per_particle_substep']}" in printed
        assert (row["substeps"], row["resolution"]) == ((17, 128) if row["dim"] == 2 else (9, 64))
        per_frame = row["ms_per_frame"] * 1e6 / (row["particles"] * row["substeps"])
        assert row["ns_per_particle_substep"] == pytest.approx(per_frame, rel=0.01)
        assert row["loaded"] == (row["slowdown"] >= timing.QUIET)


@pytest.mark.long
def test_packages_of_others_are_timed_between_runs_of_ours(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    absent = CliRunner().invoke(cli, ["packages", "--package", "splishsplash"])
    if importlib.util.find_spec("pysplishsplash") is None:
        assert "pysplishsplash is not installed: pip install --editable 'lab[packages]'" in absent.output
    # In its place our own solver, which then is exactly where ours is.
    monkeypatch.setattr(packages, "version", lambda _: "1.0")
    monkeypatch.setitem(
        packages.PACKAGES,
        "splishsplash",
        dataclasses.replace(packages.PACKAGES["splishsplash"], run=packages._hybridmpm),
    )
    file = tmp_path / "rows.json"
    arguments = ["--package", "splishsplash", "--particles", "216", "--json", str(file)]
    result = CliRunner().invoke(cli, ["packages", *arguments])
    assert result.exit_code == 0, result.output
    (row,) = read_rows(file)
    assert (row["package"], row["material"], row["particles"]) == ("pysplishsplash 1.0", "water", 216)
    assert (row["steps"], row["inside"], row["apart"]) == (row["ours_steps"], 1.0, 0.0)
    assert row["ratio"] == pytest.approx(row["ms_per_frame"] / row["ours_ms_per_frame"], rel=0.01)
    assert "SPH" in row["differs"]


def test_slopes_of_what_grows(tmp_path: Path) -> None:
    sizes = ["--particles", "216", "--particles", "512", "--scenes", "1", "--scenes", "3"]
    printed, rows = measured(tmp_path, "scaling", "--part", "particles", "--part", "scenes", *sizes)
    lines = {(row["part"], row["line"]): [one for one in rows if one["line"] == row["line"]] for row in rows}
    assert len(lines) == len(solver.CASES) + 1
    for first, second in lines.values():
        assert first["size"] < second["size"]
        slope = math.log(second["value"] / first["value"]) / math.log(second["size"] / first["size"])
        assert first["slope"] == second["slope"] == pytest.approx(slope, abs=0.01)
    assert "ms a substep" in printed


def test_a_gpu_that_is_missing_is_refused_before_anything_is_measured(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setenv("PATH", "")
    done = CliRunner().invoke(cli, ["speed", "--baseline", "warp", "--device", "cuda"])
    assert (done.exit_code, "nvidia-smi finds no GPU" in done.output) == (2, True)


@pytest.mark.long
def test_rows_of_the_networks_steps(tmp_path: Path) -> None:
    arguments = ["--scenario", "water_2d", "--device", "cpu"]
    printed, rows = measured(tmp_path, "networks", *arguments, chart=False)
    assert [row["method"] for row in rows] == [
        "network 128 x 10", "network 128 x 10", "network 48 x 3",
        *["MPM, all particles"] * 2, *["MPM, coarse 1/16"] * 2,
    ]  # fmt: skip
    paper, thinned, ships, solver, *_ = rows
    assert (paper["r_t"], thinned["r_t"], ships["r_t"]) == (1, 2, 4)
    for row, r_p in ((paper, 1), (thinned, 1 / 1.75), (ships, 1 / 8)):
        assert row["particles"] == pytest.approx(r_p * solver["particles"], rel=0.01)
        assert 6 < row["edges"] / row["particles"] < 20
        assert 0 < row["search"] < row["ms_per_frame"]
        assert f"{row['network']}" in printed
    refused = CliRunner().invoke(cli, ["networks", *arguments, "--way", "captured"])
    assert "way captured needs a GPU of CUDA; choose eager on cpu" in refused.output


def test_rows_of_the_cost_of_forces(tmp_path: Path) -> None:
    printed, (row,) = measured(tmp_path, "forces", "--scenario", "water_2d", "--repeats", "2", chart=False)
    assert row["scene"] == "water_2d"
    assert row["cost"] == pytest.approx(row["with_forces"] / row["ms_per_frame"] - 1, abs=1e-3)
    assert f"{row['with_forces']}" in printed


def test_rows_of_the_cost_of_contact(tmp_path: Path) -> None:
    name = "two discs that touch"
    printed, (row,) = measured(tmp_path, "contact", "--scene", name, "--repeats", "2", chart=False)
    assert (row["scene"], row["particles"], row["substeps"]) == (name, 6040, 40)
    assert row["ratio"] == pytest.approx(row["ms_per_frame"] / row["without"], abs=2e-3)
    assert f"{row['ms_per_frame']}" in printed


@pytest.mark.skipif(
    os.environ.get("CI") != "true" and shutil.which("chromium") is None, reason="needs Debian's chromium"
)
@pytest.mark.long
def test_rows_of_pages_that_play(tmp_path: Path) -> None:
    printed, rows = measured(tmp_path, "playing", "--scenario", "water_2d", "--seconds", "1", chart=False)
    assert [(row["scene"], row["coarse"]) for row in rows] == [("water_2d", None), ("dam-in-space", "1/16")]
    for row in rows:
        assert f"{row['page_ms_per_frame']}" in printed
        assert row["ratio"] == pytest.approx(row["page_ms_per_frame"] / row["native_ms_per_frame"], rel=0.05)
        assert row["pictures_per_second"] >= 0
        assert 0 <= row["share_of_real_time"] < 1.2
        assert row["bytes"] > 400_000


@pytest.mark.parametrize(
    "package", [SOLVERS[-1], *(pytest.param(name, marks=pytest.mark.long) for name in SOLVERS[:-1])]
)
def test_a_baseline_is_measured_beside_ours(
    package: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    if importlib.util.find_spec(package) is None:
        pytest.skip(f"needs {package}: pip install --editable lab")
    monkeypatch.setattr(solver, "CASES", solver.CASES[:1])  # each is compiled for seconds
    printed, rows = measured(tmp_path, "speed", "--particles", "216", "--baseline", package)
    assert [row["threads"] for row in rows] == [1, 2]
    ways = {"plain": 1} if package == "warp" else {"serial": 1, "serial_scatter": 2, "atomic": 2}
    for row in rows:
        assert row["peer"].startswith(f"{package} 1.")
        assert row["peer_threads"] == ways[row["peer_way"]]
        assert row["ratio"] == pytest.approx(row["peer_ns"] / row["ns_per_particle_substep"], rel=0.01)
        assert f"--baseline {package}" in row["command"]
    assert "ratio" in printed
    assert "fastest baseline" in (tmp_path / "chart.svg").read_text()


def test_a_baseline_that_computes_something_else_is_refused() -> None:
    ours = MpmSolver(solver.falling_block(2, "water", 512))
    with pytest.raises(SimulationError, match="half of the particles of some baseline"):
        solver.require_agreement(ours.positions, np.full((512, 2), np.nan), ours.scene, "some baseline")


def test_a_missing_baseline_is_named_before_any_work(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "taichi", None)
    result = CliRunner().invoke(cli, ["speed", "--baseline", "taichi"])
    assert result.exit_code == 2
    assert "pip install --editable lab" in result.output


def test_a_busy_machine_is_noticed(monkeypatch: pytest.MonkeyPatch) -> None:
    clock = itertools.accumulate(itertools.cycle([0.0, 1.0]))
    monkeypatch.setattr("hybridmpm_lab.harness.timing.time.perf_counter", lambda: next(clock))
    calibration = Calibration(2)
    assert calibration.slowdown() == 1
    slow = itertools.accumulate(itertools.cycle([0.0, 1.5]))
    monkeypatch.setattr("hybridmpm_lab.harness.timing.time.perf_counter", lambda: next(slow))
    assert calibration.slowdown() == pytest.approx(1.5)


def test_batch_rows_compare_one_thread_with_several(tmp_path: Path) -> None:
    arguments = ["batch", "--scenario", "sand_ramps_2d", "--scenes", "2", "--frames", "1"]
    printed, rows = measured(tmp_path, *arguments, chart=False)
    particles = sum(len(scenarios.sand_ramps_2d(seed).sample().x) for seed in range(2))
    assert [row["threads"] for row in rows] == [1, 2]
    for row in rows:
        assert set(row) == ORIGIN | {
            "scenario", "scenes", "particles", "threads", "ms_per_scene_frame", "frames_per_second",
            "speedup",
        }  # fmt: skip
        assert (row["scenario"], row["scenes"], row["particles"]) == ("sand_ramps_2d", 2, particles)
        assert row["frames_per_second"] == pytest.approx(1e3 / row["ms_per_scene_frame"], rel=0.01)
        speedup = rows[0]["ms_per_scene_frame"] / row["ms_per_scene_frame"]
        assert row["speedup"] == pytest.approx(speedup, rel=0.01)
        assert str(row["speedup"]) in printed
    assert rows[0]["command"].startswith("python -m hybridmpm_lab batch --scenario sand_ramps_2d --scenes 2")


@pytest.mark.parametrize("dim", [2, 3])
@pytest.mark.parametrize("particles", [64, 997, 4000, 20_000, 100_000])
def test_a_block_has_the_wanted_particles(dim: int, particles: int) -> None:
    scene = solver.falling_block(dim, "water", particles)
    count = len(scene.sample().x)
    assert 0.8 * particles < count <= particles
    if particles in {64, 4000, 20_000, 100_000}:
        assert count == particles
    counts = solver._counts(particles, dim)
    assert max(counts) <= 3.2 * min(counts)
    assert math.prod(counts) == count
    assert scene.resolution == ({100_000: 288}.get(particles, 128) if dim == 2 else 64)
    assert scene.bodies[0].measure / 0.8**dim < 0.5


def test_too_large_a_block_is_refused() -> None:
    with pytest.raises(SceneError, match="max_particles"):
        solver.falling_block(2, "water", 3_000_000)


def test_calls_are_timed_by_turns() -> None:
    log: list[str] = []

    def named(name: str) -> timing.TimedCall:
        return timing.TimedCall(
            prepare=lambda: log.append(f"prepare {name}"), call=lambda: log.append(f"call {name}")
        )

    times = timing.seconds_by_turns([named("a"), named("b")], repeats=2)
    # One more round comes first, and is not counted.
    assert log == ["prepare a", "call a", "prepare b", "call b"] * 3
    assert [len(mine) for mine in times] == [2, 2]
    assert min(map(min, times)) > 0


def test_a_clock_of_its_own_counts() -> None:
    pieces = itertools.count(1.0)
    own = timing.TimedCall(call=lambda: next(pieces))
    assert timing.seconds_by_turns([own], repeats=3) == [[2.0, 3.0, 4.0]]
