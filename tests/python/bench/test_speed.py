"""Benchmarks: their rows are complete and true, whatever the machine's speed."""

import json
import math
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner

from hybridmpm import ConfigError, MpmSolver, SceneError, SimulationError, scenarios
from hybridmpm.bench.peers.loading import peer_module
from hybridmpm.bench.report import provenance, timing
from hybridmpm.bench.speed import mpm, scaling
from hybridmpm.cli import cli

SOURCE = {"machine", "date", "commit", "command"}
FIELDS = SOURCE | {
    "dim", "material", "particles", "resolution", "threads", "substeps", "ns_per_particle_substep",
    "ms_per_frame", "peer", "peer_ns", "peer_threads", "peer_ns_serial", "peer_ns_serial_scatter",
    "peer_ns_atomic", "ratio",
}  # fmt: skip


def bench(tmp_path: Path, *arguments: str) -> tuple[str, list[dict[str, Any]]]:
    """Run a bench command; return what it printed, and the rows of its file."""
    file = tmp_path / "rows.json"
    result = CliRunner().invoke(cli, ["bench", *arguments, "--repeats", "1", "--json", str(file)])
    assert result.exit_code == 0, result.output
    rows = json.loads(file.read_text())
    for row in rows:
        measure = "team_us" if row.get("series") == "hand_out" else "ns_per_particle_substep"
        assert f"{row[measure]}" in result.stdout
    return result.stdout, rows


def test_rows_on_screen_and_in_the_file(tmp_path: Path) -> None:
    arguments = ["--particles", "216", "--particles", "512", "--threads", "2", "--threads", "1"]
    _, rows = bench(tmp_path, "mpm", *arguments)
    expected = [(*case, n, t) for n in (216, 512) for case in mpm.CASES for t in (2, 1)]
    assert [(row["dim"], row["material"], row["particles"], row["threads"]) for row in rows] == expected
    for row in rows:
        assert set(row) == FIELDS
        assert (row["substeps"], row["resolution"]) == ((17, 128) if row["dim"] == 2 else (9, 64))
        per_frame = row["ms_per_frame"] * 1e6 / (row["particles"] * row["substeps"])
        assert row["ns_per_particle_substep"] == pytest.approx(per_frame, rel=0.01)
        assert row["command"] == " ".join(["hybridmpm bench mpm", *arguments, "--repeats 1"])
        assert [row[name] for name in FIELDS if "peer" in name or name == "ratio"] == [None] * 7


def test_the_peer_is_measured_beside_ours(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip(
        "hybridmpm.bench.peers.taichi_mpm", reason="needs Taichi: pip install 'hybridmpm[bench]'"
    )
    monkeypatch.setattr(mpm, "CASES", mpm.CASES[:2])  # in 3D Taichi compiles for a minute
    chart = tmp_path / "speed.svg"
    printed, rows = bench(tmp_path, "mpm", "--particles", "216", "--peer", "taichi", "--chart", str(chart))
    assert len(rows) == 4
    for row in rows:
        assert set(row) == FIELDS
        assert row["peer"].startswith("taichi 1.")
        by_setting = [row[f"peer_ns_{name}"] for name in ("serial", "serial_scatter", "atomic")]
        assert row["peer_ns"] == min(by_setting)
        assert row["peer_threads"] == (1 if row["peer_ns_serial"] == row["peer_ns"] else 2)
        assert row["ratio"] == pytest.approx(row["peer_ns"] / row["ns_per_particle_substep"], rel=0.01)
        assert row["command"].endswith("--repeats 1 --peer taichi")
    assert "ratio" in printed
    assert "Taichi" in chart.read_text()
    assert chart.with_suffix(".png").stat().st_size > 10_000


def test_a_peer_that_computes_something_else_is_refused() -> None:
    class Stranger:
        positions = np.full((512, 2), np.nan)

    solver = MpmSolver(mpm.falling_block(2, "water", 512))
    with pytest.raises(SimulationError, match="half a cell"):
        mpm._require_agreement(solver, [Stranger()])


def test_a_missing_peer_is_named_before_any_work(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "taichi", None)
    monkeypatch.delitem(sys.modules, "hybridmpm.bench.peers.taichi_mpm", raising=False)
    monkeypatch.delattr("hybridmpm.bench.peers.taichi_mpm", raising=False)
    result = CliRunner().invoke(cli, ["bench", "mpm", "--peer", "taichi"])
    assert result.exit_code == 2
    assert "pip install 'hybridmpm[bench]'" in result.output
    with pytest.raises(ConfigError, match="must be taichi"):
        peer_module("other", known=mpm.PEER)


def test_batch_rows_compare_one_thread_with_several(tmp_path: Path) -> None:
    file = tmp_path / "batch.json"
    arguments = ["bench", "batch", "sand_ramps_2d", "--scenes", "2", "--frames", "1", "--repeats", "1"]
    result = CliRunner().invoke(cli, [*arguments, "--json", str(file)])
    assert result.exit_code == 0, result.output
    rows = json.loads(file.read_text())
    particles = sum(len(scenarios.sand_ramps_2d(seed).sample().x) for seed in range(2))
    assert [row["threads"] for row in rows] == [1, 2]
    for row in rows:
        assert set(row) == {
            "scenario", "scenes", "particles", "threads", "ms_per_scene_frame", "frames_per_second",
            "speedup", "machine", "date", "commit", "command",
        }  # fmt: skip
        assert (row["scenario"], row["scenes"], row["particles"]) == ("sand_ramps_2d", 2, particles)
        assert row["frames_per_second"] == pytest.approx(1e3 / row["ms_per_scene_frame"], rel=0.01)
        assert row["speedup"] == pytest.approx(
            rows[0]["ms_per_scene_frame"] / row["ms_per_scene_frame"], rel=0.01
        )
        assert row["command"].startswith("hybridmpm bench batch sand_ramps_2d --scenes 2 --threads 2 ")
        assert str(row["speedup"]) in result.stdout


@pytest.mark.parametrize("dim", [2, 3])
@pytest.mark.parametrize("particles", [64, 997, 4000, 20_000, 100_000])
def test_block_has_the_particles_asked_for(dim: int, particles: int) -> None:
    scene = mpm.falling_block(dim, "water", particles)
    count = len(scene.sample().x)
    assert 0.8 * particles < count <= particles
    if particles in {64, 4000, 20_000, 100_000}:
        assert count == particles
    counts = mpm._counts(particles, dim)
    assert max(counts) <= 3.2 * min(counts)
    assert math.prod(counts) == count
    assert scene.resolution == ({100_000: 288}.get(particles, 128) if dim == 2 else 64)
    assert scene.bodies[0].measure / 0.8**dim < 0.5


def test_too_large_a_block_is_refused() -> None:
    with pytest.raises(SceneError, match="resolution"):
        mpm.falling_block(2, "water", 3_000_000)


@pytest.mark.parametrize("dim", [2, 3])
def test_the_measured_state_is_a_splash(dim: int) -> None:
    solver = MpmSolver(mpm.falling_block(dim, "water", 512), substeps="reference")
    start = solver.diagnostics()
    solver.advance(mpm._RUN_UP)
    mpm._require_sane(solver)
    now = solver.diagnostics()
    assert now.centroid[1] < start.centroid[1] - 0.05
    assert now.max_speed > 0.5


def test_scaling_rows(tmp_path: Path) -> None:
    chart = tmp_path / "scaling.svg"
    arguments = ["--particles", "1000", "--particles", "4000", "--resolution", "32", "--resolution", "64"]
    printed, rows = bench(tmp_path, "scaling", *arguments, "--chart", str(chart))
    assert "team_us" in printed
    rows, handed_out = rows[:-3], rows[-3:]
    assert [(row["series"], row["dim"]) for row in rows] == [
        ("particles", 2), ("particles", 2), ("particles", 3), ("particles", 3), ("grid", 3), ("grid", 3),
    ]  # fmt: skip
    assert [(row["series"], row["work_us"], row["pause_us"]) for row in handed_out] == [
        ("hand_out", 0, 0), ("hand_out", 20, 0), ("hand_out", 20, 20),
    ]  # fmt: skip
    ways = {"alone_us", "team_us", "pool_us", "rayon_us"}
    for row in handed_out:
        assert set(row) == SOURCE | ways | {"series", "threads", "work_us", "pause_us"}
        assert row["threads"] == 2
    assert all(row[way] > 5 for row in handed_out[1:] for way in ways)
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

    seconds = timing.seconds_per_frame([simulation("a", 3), simulation("b", 1)], repeats=2)
    assert log == ["restore a", "a 3", "restore b", "b 1"] * 3
    assert len(seconds) == 2
    assert min(seconds) > 0


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
    arguments = ["bench", "sleeping", "--particles", "600", "--frames", "480"]
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
