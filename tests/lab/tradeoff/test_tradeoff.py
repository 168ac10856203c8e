"""The benchmark of all methods: complete rows, right fronts, and runs that go on after an interruption."""

import json
from pathlib import Path

import pytest
from click.testing import CliRunner

from hybridmpm import scenarios
from hybridmpm.errors import NonFiniteError
from hybridmpm.physics.manifest import models
from hybridmpm_lab.commands import cli
from hybridmpm_lab.compare.accuracy.conventions import FIRST_SEED
from hybridmpm_lab.compare.tradeoff import chart as drawing
from hybridmpm_lab.compare.tradeoff import errors, sheet
from hybridmpm_lab.compare.tradeoff.entrants import entrants
from hybridmpm_lab.compare.tradeoff.measures import FRONTS, MEASURES
from hybridmpm_lab.compare.tradeoff.settings import warm_up
from hybridmpm_lab.compare.tradeoff.table import on_front
from hybridmpm_lab.compare.tradeoff.times import PIECE, by_turns

NAMES = ("mpm 1", "mpm 1/16", "coarse 1/16", "neural fluids_2d carried", "hybrid fluids_2d r_c 0.8")


@pytest.mark.needs("ot", "metrics")
def test_runs_gather_and_become_a_table(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sheet, "AFTER", 5)
    monkeypatch.setattr(drawing, "FRONTS", {"transport": "transport [m]"})
    monkeypatch.setattr(errors, "LADDER", {"1": 1.0, "1/16": 1 / 16})
    runs, file, chart = tmp_path / "runs.jsonl", tmp_path / "rows.json", tmp_path / "chart.svg"
    patterns = [text for name in NAMES for text in ("--entrant", name)]
    options = ["--scenario", "water_2d", "--scenes", "2", "--span", "40", "--passes", "1", "--jobs", "1"]
    command = ["tradeoff", *options, *patterns, "--runs", str(runs), "--json", str(file)]

    def run(*more: str) -> dict[str, dict[str, object]]:
        result = CliRunner().invoke(cli, [*command, *more])
        assert result.exit_code == 0, result.output
        return {f"{row['method']} {row['label'] or ''}".strip(): row for row in json.loads(file.read_text())}

    unmeasured = run("--only", "errors")
    assert unmeasured["mpm 1"]["ms_per_frame"] is None
    assert not unmeasured["mpm 1"]["on_front"]
    whole = runs.read_text()
    rows = run("--only", "times")
    assert runs.read_text().startswith(whole)
    assert len(runs.read_text().splitlines()) == len(whole.splitlines()) + len(NAMES)
    whole = runs.read_text()
    # What the file holds is not measured again.
    assert run() == rows
    assert runs.read_text() == whole

    assert {name for name, row in rows.items() if row["ms_per_frame"]} == set(NAMES)
    assert {"jitter", "still", "merged 1/16"} < set(rows)
    for row in rows.values():
        assert (row["scenes"], row["failed"], row["warm_up"]) == (2, 0, 20)
        for measure in MEASURES:
            assert not measure.endswith(("_100", "_200")) or row[measure] is None
            assert row[measure] is None or row[measure] >= row[f"{measure}_se"] >= 0
    mean = {name: row["error"] for name, row in rows.items()}
    assert mean["mpm 1"] < mean["jitter"] < mean["coarse 1/16"] < mean["still"]
    assert mean["merged 1/16"] < mean["mpm 1/16"]
    assert rows["neural fluids_2d carried"]["mpm_share"] == 0
    assert rows["mpm 1"]["mpm_share"] == 1
    # The most accurate is on the front; the network is slower than what errs less.
    assert all(rows["mpm 1"]["on_front" if one == "error" else f"on_front_{one}"] for one in FRONTS)
    assert rows["neural fluids_2d carried"]["dominated_by"] == "coarse 1/16"
    assert rows["neural fluids_2d carried"]["as_good_ms"] == rows["coarse 1/16"]["ms_per_frame"]
    apart = rows["neural fluids_2d carried"]["minus_as_good"]
    assert apart == pytest.approx(mean["neural fluids_2d carried"] - mean["coarse 1/16"], abs=1e-3)

    pytest.importorskip("matplotlib")
    run("--only", "table", "--chart", str(chart), "--sheet", str(tmp_path / "sheet.png"))
    for drawn in ("chart-transport.png", "sheet.png"):
        assert (tmp_path / drawn).stat().st_size > 10_000
    assert "hollow" in (tmp_path / "chart-transport.svg").read_text()


def test_a_table_needs_runs() -> None:
    result = CliRunner().invoke(cli, ["tradeoff", "--only", "table"])
    assert result.exit_code == 2
    assert "--runs" in result.output
    result = CliRunner().invoke(cli, ["tradeoff", "--entrant", "mpm 1/3", "--only", "errors"])
    assert result.exit_code == 2
    assert "coarse 1/16" in result.output


def test_all_that_the_chart_promises_enters() -> None:
    for scenario in scenarios.NAMES:
        served = [name for name, entry in models().items() if scenario in entry.scenarios]
        found = entrants(scenario)
        assert {"mpm 1", "mpm 1/1.75", "mpm softer 1/4", "mpm sleeping", "coarse 1/64"} < set(found)
        assert {f"neural {name}" for name in served} | {f"hybrid {name}" for name in served} < set(found)
        assert [one.settings["r_c"] for one in found.values() if one.variant == "cosine"][0::5] == [0.0, 0.9]
        assert warm_up(scenario) == max(5 * models()[name].r_t for name in served)
        scene = scenarios.get(scenario, FIRST_SEED)
        softer = found["mpm softer 1/4"].make(scene, 1)
        assert softer.scene.materials != scene.materials


def test_a_front_is_who_nobody_beats() -> None:
    times, errors = (1.0, 2.0, 2.0, 3.0, None), (0.5, 0.4, 0.5, 0.4, 0.1)
    rows = [{"ms_per_frame": ms, "error": error} for ms, error in zip(times, errors, strict=True)]
    assert [on_front(row, rows, "error") for row in rows] == [True, True, False, False, False]


class Clockwork:
    """Takes as many seconds for a frame as its number; every second pass takes ten times as long."""

    def __init__(self, *, fails: bool = False) -> None:
        self._frame, self._passes, self._fails = 0, 0, fails

    def restore(self) -> None:
        self._frame, self._passes = 0, self._passes + 1

    def advance(self, frames: int) -> list[float]:
        if self._fails:
            raise NonFiniteError("lost")
        slow = 10 if self._passes % 2 == 0 else 1
        times = [slow * float(self._frame + one) for one in range(frames)]
        self._frame += frames
        return times


def test_times_are_quartiles_of_each_frame() -> None:
    whole, failed = by_turns([Clockwork(), Clockwork(fails=True)], 10 * PIECE + 3, 5, threads=1)
    assert failed is None
    assert whole is not None
    assert whole.seconds.tolist() == list(range(10 * PIECE))
    row = whole.fields()
    assert row["ms_per_frame"] == row["ms_mean"] == pytest.approx(1e3 * (10 * PIECE - 1) / 2)
    assert row["ms_p95"] < row["ms_frame_p95"] < 1e3 * 10 * PIECE
    assert row["slowdown"] >= 1
