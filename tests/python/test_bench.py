"""Benchmarks: their rows are complete and true, whatever the machine's speed."""

import json
import math
from pathlib import Path

import pytest
from click.testing import CliRunner

from hybridmpm import MpmSolver, SceneError, scenarios
from hybridmpm.bench import mpm, provenance
from hybridmpm.cli import cli

FIELDS = {
    "dim", "material", "particles", "ns_per_particle_substep", "ms_per_frame", "threads", "substeps",
    "peer", "peer_ns", "ratio", "machine", "date", "commit", "command",
}  # fmt: skip


def test_rows_on_screen_and_in_the_file(tmp_path: Path) -> None:
    file = tmp_path / "mpm.json"
    result = CliRunner().invoke(
        cli, ["bench", "mpm", "--particles", "512", "--repeats", "1", "--threads", "2", "--json", str(file)]
    )
    assert result.exit_code == 0, result.output
    rows = json.loads(file.read_text())
    assert [(row["dim"], row["material"]) for row in rows] == list(mpm.CASES)
    for row in rows:
        assert set(row) == FIELDS
        assert (row["threads"], row["particles"]) == (2, 512)
        assert row["substeps"] == (17 if row["dim"] == 2 else 9)
        expected = row["ms_per_frame"] * 1e6 / (row["particles"] * row["substeps"])
        assert row["ns_per_particle_substep"] == pytest.approx(expected, rel=0.01)
        assert row["command"] == "hybridmpm bench mpm --particles 512 --threads 2 --repeats 1"
        assert (row["peer"], row["peer_ns"], row["ratio"]) == (None, None, None)
        assert f"{row['ns_per_particle_substep']}" in result.stdout


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
@pytest.mark.parametrize("particles", [64, 997, 4000, 30_000])
def test_block_has_the_particles_asked_for(dim: int, particles: int) -> None:
    count = len(mpm.falling_block(dim, "water", particles).sample().x)
    assert 0.8 * particles < count <= particles
    if particles in {64, 4000}:
        assert count == particles
    counts = mpm._counts(particles, dim)
    assert max(counts) <= 3.2 * min(counts)
    assert math.prod(counts) == count


def test_too_large_a_block_is_refused() -> None:
    with pytest.raises(SceneError, match="bodies"):
        mpm.falling_block(2, "water", 50_000)


@pytest.mark.parametrize("dim", [2, 3])
def test_the_measured_state_is_a_splash(dim: int) -> None:
    solver = MpmSolver(mpm.falling_block(dim, "water", 512), substeps="reference")
    start = solver.diagnostics()
    solver.advance(mpm._RUN_UP)
    mpm._require_sane(solver)
    now = solver.diagnostics()
    assert now.centroid[1] < start.centroid[1] - 0.05
    assert now.max_speed > 0.5


def test_where_a_row_comes_from(tmp_path: Path) -> None:
    source = provenance.provenance("a command")
    assert source.command == "a command"
    assert source.machine.endswith("cores")
    assert len(source.date) == 10
    untracked = tmp_path / "file.py"
    untracked.write_text("")
    assert provenance._commit(untracked) is None
