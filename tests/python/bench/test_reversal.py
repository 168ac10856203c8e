"""`hybridmpm bench reversal`: its rows, its chart and its command."""

import json
from pathlib import Path

import pytest
from click.testing import CliRunner

from hybridmpm.bench.reversal.reversal import CAP, CAPS, ReversalSettings, measure
from hybridmpm.cli import cli
from hybridmpm.control import reversed_from_seed
from hybridmpm.control.reversal import STARTS


def test_rows_tell_the_error_of_each_cap_and_what_smoothing_does() -> None:
    settings, steps = ReversalSettings(scenarios=("sand_2d",), seeds=1, frames=8), []
    rows = list(measure(settings, steps.append))
    assert sum(steps) == settings.count == len(STARTS) + len(CAPS) - 1
    errors = {(row["start"], row["cap"]): row for row in rows if row["part"] == "error"}
    assert set(errors) == {("live", cap) for cap in CAPS} | {("reversed", CAP)}
    case = reversed_from_seed("sand_2d", 1_100_000, frames=8, start="live")
    live = errors["live", CAP]
    assert live["error"] == pytest.approx(case.error(case.positions[-1]), rel=1e-3)
    assert live["peak"] == pytest.approx(case.peak, rel=1e-3)
    assert (live["seeds"], live["worst_seed"], live["worst"]) == (1, 1_100_000, live["error"])
    smoothed = case.simulator().rollout(8, case.smoothed_forces)[-1]
    assert live["error_smoothed"] == pytest.approx(case.error(smoothed), rel=1e-3)
    assert live["cosine_smoothed"] >= live["cosine"]
    cosines = [row for row in rows if row["part"] == "cosine"]
    assert [row["frame"] for row in cosines] == [0, 3, 6]
    assert all(row["after"] >= row["before"] for row in cosines)


def test_the_command_prints_both_tables_and_draws(tmp_path: Path) -> None:
    arguments = ["--scenario", "sand_3d", "--seeds", "1", "--frames", "4"]
    files = ["--json", str(tmp_path / "r.json"), "--chart", str(tmp_path / "r.svg")]
    result = CliRunner().invoke(cli, ["bench", "reversal", *arguments, *files], prog_name="hybridmpm")
    assert result.exit_code == 0, result.output
    assert "share_good" in result.output
    assert "error_smoothed" in result.output
    rows = json.loads((tmp_path / "r.json").read_text())
    assert rows[0]["command"] == "hybridmpm bench reversal --scenario sand_3d --seeds 1 --frames 4"
    assert (tmp_path / "r.png").stat().st_size > 1000
