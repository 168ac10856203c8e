"""The bench of hybrids on many scenes: its rows, and that it goes on where it stopped."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner

from hybridmpm import metrics
from hybridmpm.errors import ConfigError, DataError
from hybridmpm_lab.commands import cli
from hybridmpm_lab.compare.hybrid import scene_means, scenes, scenes_chart
from hybridmpm_lab.harness.grid import TrueGrids
from hybridmpm_lab.harness.store import RowStore


def test_a_bench_that_was_interrupted_goes_on(tmp_path: Path) -> None:
    runs, target = tmp_path / "runs.jsonl", tmp_path / "rows.json"
    words = [
        "hybrid", "--scenario", "sand_2d", "--scenes", "1", "--frames", "120", "--model", "zero",
        "--method", "hybrid", "--method", "mpm", "--runs", str(runs), "--json", str(target),
    ]  # fmt: skip
    done = CliRunner().invoke(cli, words, prog_name="hybridmpm")
    assert done.exit_code == 0, done.output
    rows = json.loads(target.read_text())
    hybrid, mpm = (row for row in rows if row["part"] == "run")
    shares = [hybrid[name] for name in ("network", "free_fall", "rest", "mpm")]
    assert sum(shares) == pytest.approx(1, abs=1e-3)
    assert hybrid["free_fall"] > 0
    assert mpm["mpm"] is None
    means = {(row["scenario"], row["method"]): row for row in rows if row["part"] == "mean"}
    assert means["all", "hybrid"]["ratio"] == pytest.approx(hybrid["error"] / mpm["error"], rel=1e-3)
    assert means["sand_2d", "mpm"]["ratio"] == 1
    # What an interruption left of a line is dropped; what is missing is run, and nothing else.
    first, one, two = runs.read_text().splitlines()
    runs.write_text(f"{first}\n{one}\n{two[: len(two) // 2]}")
    again = CliRunner().invoke(cli, words, prog_name="hybridmpm")
    assert again.exit_code == 0, again.output
    assert runs.read_text().splitlines()[:2] == [first, one]
    assert [row["error"] for row in json.loads(target.read_text()) if row["part"] == "run"] == [
        hybrid["error"], mpm["error"],
    ]  # fmt: skip


def test_scenes_beyond_the_table_serve_promises_alone(tmp_path: Path) -> None:
    settings = scenes.ScenesSettings(
        scenarios=("water_2d",),
        first=5,
        scenes=1,
        promised=3,
        methods=("hybrid", "cosine-0.5"),
        carried=(False,),
    )
    assert settings.asked_for() == [
        ("water_2d", 5, "hybrid", False), ("water_2d", 5, "cosine-0.5", False),
        ("water_2d", 6, "hybrid", True), ("water_2d", 6, "mpm", True),
        ("water_2d", 7, "hybrid", True), ("water_2d", 7, "mpm", True),
    ]  # fmt: skip


def test_means_tell_the_variance_of_the_scenes() -> None:
    rows = [
        {"part": "run", "scenario": "sand_2d", "seed": seed, "method": "mpm", "show_all": True, "frames": 400,
         "calm": 400, "kinetic": 0.0, "kinetic_true": 0.0, "error": 1.0, "nrmse": nrmse,
         **dict.fromkeys(("network", "free_fall", "rest", "mpm", "contact")), "ms_per_frame": 1.0}
        for seed, nrmse in enumerate((0.1, 0.2, 0.3))
    ]  # fmt: skip
    (one, _) = scene_means.means(rows)
    assert (one["nrmse"], one["nrmse_var"]) == pytest.approx((0.2, 0.01))
    assert (one["ratio"], one["worst"], one["network"]) == (1.0, 1.0, None)


def test_the_two_readings_of_an_error_differ_by_a_factor() -> None:
    rng = np.random.default_rng(3)
    states = rng.uniform(0.2, 0.8, (2, 50, 2)).astype(np.float32)
    mass = np.ones(50, np.float32)
    true, other = metrics.grid_mass(states[0], mass, 16), metrics.grid_mass(states[1], mass, 16)
    grids = TrueGrids(states[:1], mass, 16)
    found = grids.rmse(0, states[1], mass) * grids.nrmse_over_rmse(0)
    assert found == pytest.approx(metrics.grid_nrmse(other, true), rel=1e-5)


def test_the_chart_shows_shares_and_errors(tmp_path: Path) -> None:
    pytest.importorskip("matplotlib")
    shares = {"network": 0.4, "free_fall": 0.1, "rest": 0.2, "mpm": 0.3}
    common = {"scenario": "sand_2d", "show_all": True, "seed": 1}
    rows = [
        {**common, "part": "run", "method": "hybrid", "error": 1.05},
        {**common, "part": "run", "method": "mpm", "error": 1.0},
        {**common, "part": "mean", "method": "hybrid", **shares},
    ]
    scenes_chart.chart(rows, tmp_path / "shares.svg")
    assert (tmp_path / "shares.png").stat().st_size > 10_000


def test_runs_of_other_settings_are_refused(tmp_path: Path) -> None:
    file = tmp_path / "runs.jsonl"
    RowStore({"frames": 400}, file).add(("a", 1), {"error": 2.0})
    assert RowStore({"frames": 400}, file).row(("a", 1)) == {"error": 2.0}
    with pytest.raises(ConfigError, match="holds rows with frames = 400, not 200"):
        RowStore({"frames": 200}, file)
    file.write_text("nothing\n")
    with pytest.raises(DataError, match=r"runs.jsonl is no file of rows, or damaged"):
        RowStore({"frames": 400}, file)


def rows_of(ratios: Any) -> list[dict[str, Any]]:
    """Return rows of a hybrid whose error is so many times MPM's."""
    common = {"scenario": "water_ramps_2d", "show_all": True}
    errors = {f"error_{at}": 0.5 for at in scene_means.AT}
    return [
        {**common, "seed": seed, "method": method, **{name: value * times for name, value in errors.items()}}
        for seed, ratio in enumerate(ratios)
        for method, times in (("hybrid", ratio), ("mpm", 1.0))
    ]


def test_a_promise_is_taken_from_one_half_and_tested_on_the_other() -> None:
    # Even seeds have 1.01 to 1.99, odd ones are all better but for every fifth.
    ratios = np.empty(198)
    ratios[::2] = 1 + np.arange(1, 100) / 100
    ratios[1::2] = np.where(np.arange(99) % 5 == 0, 3.0, 1.0)
    (first, *_) = scene_means.promises(rows_of(ratios))
    assert (first["scenario"], first["after"]) == ("water_2d", 40)
    assert first["bound"] == pytest.approx(1.90)
    assert first["held"] == pytest.approx(79 / 99, rel=1e-3)
    assert (first["calibrated_on"], first["tested_on"]) == (99, 99)
    # Eight scenes cannot bear a promise about nine in ten.
    (few, *_) = scene_means.promises(rows_of([1.0] * 16))
    assert (few["bound"], few["held"]) == (None, None)
