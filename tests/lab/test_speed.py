"""Benchmarks: their rows are complete and true, whatever the machine's speed."""

import importlib.util
import itertools
import json
import math
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner

import hybridmpm
from hybridmpm import ConfigError, MpmSolver, SceneError, SimulationError, _native, scenarios
from hybridmpm_lab.commands import cli, speed
from hybridmpm_lab.harness import provenance, timing
from hybridmpm_lab.harness.timing import Calibration
from hybridmpm_lab.speed import blocks, mpm, scaling
from hybridmpm_lab.speed.baselines.loading import SOLVERS, check_peer
from hybridmpm_lab.speed.baselines.process import Worker

SOURCE = {"machine", "date", "commit", "command", "solver_version", "ingredients"}
FIELDS = SOURCE | {
    "dim", "material", "particles", "resolution", "frame", "threads", "instructions", "substeps",
    "ns_per_particle_substep", "spread", "ms_per_frame", "build_ns", "build_ratio", "peer", "peer_ns",
    "peer_threads", "peer_setting", "ratio", "slowdown", "loaded",
}  # fmt: skip


def bench(tmp_path: Path, *arguments: str) -> tuple[str, list[dict[str, Any]]]:
    """Run a bench command; return what it printed, and the rows of its file."""
    file = tmp_path / "rows.json"
    result = CliRunner().invoke(cli, [*arguments, "--repeats", "1", "--json", str(file)])
    assert result.exit_code == 0, result.output
    rows = json.loads(file.read_text())
    for row in rows:
        assert f"{row['ns_per_particle_substep']}" in result.stdout
    return result.stdout, rows


def test_rows_on_screen_and_in_the_file(tmp_path: Path) -> None:
    arguments = ["--particles", "216", "--particles", "512", "--threads", "2", "--threads", "1"]
    _, rows = bench(tmp_path, "speed", *arguments)
    expected = [(*case, n, t) for n in (216, 512) for case in mpm.CASES for t in (2, 1)]
    assert [(row["dim"], row["material"], row["particles"], row["threads"]) for row in rows] == expected
    for row in rows:
        assert set(row) == FIELDS
        assert (row["substeps"], row["resolution"]) == ((17, 128) if row["dim"] == 2 else (9, 64))
        per_frame = row["ms_per_frame"] * 1e6 / (row["particles"] * row["substeps"])
        assert row["ns_per_particle_substep"] == pytest.approx(per_frame, rel=0.01)
        given = [*arguments[:4], "--frame 120", *arguments[4:], "--instructions avx512"]
        assert row["command"] == " ".join(["python -m hybridmpm_lab speed", *given, "--repeats 1"])
        rivals = ("build_ns", "build_ratio", "peer", "peer_ns", "peer_threads", "peer_setting", "ratio")
        assert [row[name] for name in rivals] == [None] * 7
        assert row["spread"] == 0
        assert row["slowdown"] >= 1
        assert row["loaded"] == (row["slowdown"] >= mpm.LARGEST_SLOWDOWN)


@pytest.mark.parametrize(
    "package", [SOLVERS[0], *(pytest.param(name, marks=pytest.mark.long) for name in SOLVERS[1:])]
)
def test_peers_are_measured_beside_ours(
    package: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    if importlib.util.find_spec(package) is None:
        pytest.skip(f"needs {package}: pip install 'hybridmpm[bench]'")
    monkeypatch.setattr(mpm, "CASES", ((2, "water"),))  # Taichi compiles each for seconds
    chart = tmp_path / "speed.svg"
    printed, rows = bench(tmp_path, "speed", "--particles", "216", "--peer", package, "--chart", str(chart))
    assert [row["threads"] for row in rows] == [1, 2]
    settings = {"plain": 1} if package == "warp" else {"serial": 1, "serial_scatter": 2, "atomic": 2}
    for row in rows:
        by_setting = {name: row[f"{package}_{name}_ns"] for name in settings}
        assert set(row) == FIELDS | {f"{package}_{name}_ns" for name in settings}
        assert row["peer"].startswith(f"{package} 1.")
        assert row["peer_ns"] == min(by_setting.values()) == by_setting[row["peer_setting"]]
        assert row["peer_threads"] == settings[row["peer_setting"]]
        assert row["ratio"] == pytest.approx(row["peer_ns"] / row["ns_per_particle_substep"], rel=0.01)
        assert row["command"].endswith(f"--repeats 1 --peer {package}")
    assert "ratio" in printed
    assert "fastest peer" in chart.read_text()
    assert chart.with_suffix(".png").stat().st_size > 10_000


def test_another_build_is_measured_beside_this_one(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(mpm, "CASES", mpm.CASES[:1])
    checkout = Path(hybridmpm.__file__).parents[2]
    monkeypatch.setattr(speed, "other_commit", lambda folder: "abc1234" if folder == checkout else None)
    _, rows = bench(tmp_path, "speed", "--particles", "216", "--threads", "2", "--build", str(checkout))
    for row in rows:
        assert set(row) == FIELDS
        assert row["build_ratio"] == pytest.approx(row["ns_per_particle_substep"] / row["build_ns"], rel=0.01)
        assert row["command"].endswith("--build abc1234")
    result = CliRunner().invoke(cli, ["speed", "--build", str(tmp_path)])
    assert result.exit_code == 2
    assert "holds no build of hybridmpm: python/hybridmpm/_native*.so is missing" in result.output


def test_instructions_have_their_rows(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(mpm, "CASES", mpm.CASES[:1])
    in_use = mpm.MpmSettings(instructions=mpm.INSTRUCTIONS).instructions_in_use()
    assert in_use == list(mpm.INSTRUCTIONS[: len(in_use)])
    every = [word for name in mpm.INSTRUCTIONS for word in ("--instructions", name)]
    _, rows = bench(tmp_path, "speed", "--particles", "216", "--threads", "1", *every)
    assert [row["instructions"] for row in rows] == in_use
    assert _native.limit_instructions("avx512") == in_use[-1]


def test_failures_in_another_process_are_told() -> None:
    with (
        Worker("hybridmpm") as worker,
        pytest.raises(SimulationError, match=r"(?s)restore failed.*KeyError: 'no'"),
    ):
        worker.call("restore", "no")
    with Worker("hybridmpm") as worker:
        worker._process.kill()
        with pytest.raises(SimulationError, match="the process of hybridmpm has ended with exit code -9"):
            worker.call("restore", "no")


def test_a_peer_that_computes_something_else_is_refused() -> None:
    solver = MpmSolver(blocks.falling_block(2, "water", 512))
    stranger = np.full((512, 2), np.nan)
    with pytest.raises(SimulationError, match="half of the particles of some peer"):
        mpm.require_agreement(solver.positions, stranger, solver.scene, "some peer")


def test_a_missing_peer_is_named_before_any_work(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "taichi", None)
    result = CliRunner().invoke(cli, ["speed", "--peer", "taichi"])
    assert result.exit_code == 2
    assert "pip install 'hybridmpm[bench]'" in result.output
    with pytest.raises(ConfigError, match="must be taichi or quadrants or warp, got 'other'"):
        check_peer("other", known=SOLVERS)


def test_a_busy_machine_is_noticed(monkeypatch: pytest.MonkeyPatch) -> None:
    clock = itertools.accumulate(itertools.cycle([0.0, 1.0]))
    monkeypatch.setattr("hybridmpm_lab.harness.timing.time.perf_counter", lambda: next(clock))
    calibration = Calibration(2)
    assert calibration.slowdown() == 1
    slow = itertools.accumulate(itertools.cycle([0.0, 1.5]))
    monkeypatch.setattr("hybridmpm_lab.harness.timing.time.perf_counter", lambda: next(slow))
    assert calibration.slowdown() == pytest.approx(1.5)


def test_batch_rows_compare_one_thread_with_several(tmp_path: Path) -> None:
    file = tmp_path / "batch.json"
    arguments = ["batch", "sand_ramps_2d", "--scenes", "2", "--frames", "1", "--repeats", "1"]
    result = CliRunner().invoke(cli, [*arguments, "--json", str(file)])
    assert result.exit_code == 0, result.output
    rows = json.loads(file.read_text())
    particles = sum(len(scenarios.sand_ramps_2d(seed).sample().x) for seed in range(2))
    assert [row["threads"] for row in rows] == [1, 2]
    for row in rows:
        assert set(row) == {
            "scenario", "scenes", "particles", "threads", "ms_per_scene_frame", "frames_per_second",
            "speedup", "machine", "date", "commit", "command", "solver_version", "ingredients",
        }  # fmt: skip
        assert (row["scenario"], row["scenes"], row["particles"]) == ("sand_ramps_2d", 2, particles)
        assert row["frames_per_second"] == pytest.approx(1e3 / row["ms_per_scene_frame"], rel=0.01)
        assert row["speedup"] == pytest.approx(
            rows[0]["ms_per_scene_frame"] / row["ms_per_scene_frame"], rel=0.01
        )
        assert row["command"].startswith(
            "python -m hybridmpm_lab batch sand_ramps_2d --scenes 2 --threads 2 "
        )
        assert str(row["speedup"]) in result.stdout


@pytest.mark.parametrize("dim", [2, 3])
@pytest.mark.parametrize("particles", [64, 997, 4000, 20_000, 100_000])
def test_block_has_the_particles_asked_for(dim: int, particles: int) -> None:
    scene = blocks.falling_block(dim, "water", particles)
    count = len(scene.sample().x)
    assert 0.8 * particles < count <= particles
    if particles in {64, 4000, 20_000, 100_000}:
        assert count == particles
    counts = blocks._counts(particles, dim)
    assert max(counts) <= 3.2 * min(counts)
    assert math.prod(counts) == count
    assert scene.resolution == ({100_000: 288}.get(particles, 128) if dim == 2 else 64)
    assert scene.bodies[0].measure / 0.8**dim < 0.5


def test_too_large_a_block_is_refused() -> None:
    with pytest.raises(SceneError, match="resolution"):
        blocks.falling_block(2, "water", 3_000_000)


@pytest.mark.parametrize("dim", [2, 3])
def test_the_measured_state_is_a_splash(dim: int) -> None:
    solver = MpmSolver(blocks.falling_block(dim, "water", 512), substeps="reference")
    start = solver.diagnostics()
    solver.advance(120)
    blocks.require_sane(solver)
    now = solver.diagnostics()
    assert now.centroid[1] < start.centroid[1] - 0.05
    assert now.max_speed > 0.5


def test_scaling_rows(tmp_path: Path) -> None:
    chart = tmp_path / "scaling.svg"
    arguments = ["--particles", "1000", "--particles", "4000", "--resolution", "32", "--resolution", "64"]
    _, rows = bench(tmp_path, "scaling", *arguments, "--chart", str(chart))
    assert [(row["series"], row["dim"]) for row in rows] == [
        ("particles", 2), ("particles", 2), ("particles", 3), ("particles", 3), ("grid", 3), ("grid", 3),
    ]  # fmt: skip
    for row, aimed in zip(rows[:4], (1000, 4000, 1000, 4000), strict=True):
        assert row["particles"] == pytest.approx(aimed, rel=0.25)
    assert [row["resolution"] for row in rows[4:]] == [32, 64]
    for row in rows:
        assert set(row) == SOURCE | {
            "series", "dim", "particles", "resolution", "threads", "ms_per_substep",
            "ns_per_particle_substep",
        }  # fmt: skip
        per_particle = row["ms_per_substep"] * 1e6 / row["particles"]
        assert row["ns_per_particle_substep"] == pytest.approx(per_particle, rel=0.02)
    assert chart.with_suffix(".png").stat().st_size > 10_000


def test_the_blob_is_the_same_in_every_grid() -> None:
    solvers = [MpmSolver(scaling.blob(resolution), substeps=scaling.SUBSTEPS) for resolution in (32, 64, 128)]
    centre = np.full(3, 0.5)
    radii = [np.abs(s.positions - centre).max() * s.scene.resolution for s in solvers]
    assert len({s.particle_count for s in solvers}) == 1
    assert max(radii) - min(radii) < 0.1
    assert {s.scene.frame_dt * s.scene.resolution for s in solvers} == {scaling.SUBSTEPS * 0.02}


def test_simulations_are_timed_by_turns() -> None:
    log: list[str] = []

    def simulation(name: str, frames: int) -> timing.TimedSimulation:
        return timing.TimedSimulation(
            restore=lambda: log.append(f"restore {name}"),
            advance=lambda count: log.append(f"{name} {count}"),
            frames=frames,
        )

    times = timing.time_per_frame([simulation("a", 3), simulation("b", 1)], repeats=2)
    assert log == ["restore a", "a 1", "a 3", "restore b", "b 1", "b 1"] * 3
    assert len(times) == 2
    assert min(time.seconds for time in times) > 0


def test_the_lower_quartile_of_a_clock_of_its_own() -> None:
    pieces = itertools.cycle([9.0, 0.0, 4.0, 0.0, 2.0, 0.0, 3.0, 0.0, 1.0, 0.0])
    next(pieces)  # the first round warms up, and each piece follows an untimed frame
    own = timing.TimedSimulation(restore=lambda: None, advance=lambda _: next(pieces), frames=2)
    (time,) = timing.time_per_frame([own], repeats=4)
    assert (time.seconds, time.spread) == (0.875, pytest.approx(4.5 / 1.75 - 1))


def test_where_a_row_comes_from(tmp_path: Path) -> None:
    source = provenance.provenance("a command")
    assert source.command == "a command"
    assert source.machine.endswith("cores")
    assert len(source.date) == 10
    untracked = tmp_path / "file.py"
    untracked.write_text("")
    assert provenance._commit(untracked) is None


def test_sleeping_saves_time_and_stays_below_the_floor(tmp_path: Path) -> None:
    chart = tmp_path / "sleeping.svg"
    file = tmp_path / "rows.json"
    arguments = ["sleeping", "--particles", "600", "--frames", "480"]
    result = CliRunner().invoke(cli, [*arguments, "--json", str(file), "--chart", str(chart)])
    assert result.exit_code == 0, result.output
    rows = json.loads(file.read_text())
    assert set(rows[0]) == SOURCE | {
        "particles", "frame", "asleep", "ms_awake", "ms_sleeping", "ratio", "error", "floor",
    }  # fmt: skip
    assert rows[0]["asleep"] == 0
    assert rows[0]["error"] == 0
    assert rows[-1]["asleep"] > 0.95
    assert all(row["error"] < row["floor"] for row in rows)
    assert chart.with_suffix(".png").stat().st_size > 10_000
