"""A sweep goes on at the point where it stopped, redoes what was trained for less, and names survivors."""

import dataclasses
import importlib
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner, Result

from hybridmpm import ConfigError, DataError, scenarios
from hybridmpm.bench.accuracy import latency
from hybridmpm.bench.report.provenance import Provenance
from hybridmpm.bench.report.rows import Row
from hybridmpm.bench.sweep.family import POINTS, SCENARIOS, Point, SweepSettings, matching
from hybridmpm.bench.sweep.results import SweepResults
from hybridmpm.cli import cli
from hybridmpm.physics.free_fall import FreeFall

pytestmark = pytest.mark.needs("ot", "bench")

SOURCE = Provenance(machine="m", date="2026-01-01", commit="c", command="sweep")
TINY = "water_2d-t8-p1_16-32x3-R2.2"


class Notebook:
    """A runner that measures nothing, and fails at a point if asked to."""

    def __init__(self, fails_at: str | None = None) -> None:
        self.log: list[str] = []
        self.fails_at = fails_at

    def references(self, scenario: str) -> list[Row]:
        self.log.append(scenario)
        rows = [("mpm", "1", 0.1), ("still", None, 1.4)]
        return [
            {"scenario": scenario, "method": method, "label": label, "error": error}
            for method, label, error in rows
        ]

    def ladder(self, scenario: str) -> list[Row]:
        self.log.append(f"time {scenario}")
        return [{"label": "1", "ms_per_frame": 1.0}]

    def errors(self, point: Point, minutes: float) -> Row:
        self._begin(point.key)
        return {**self._row(point), "minutes": minutes, "trained": True, "error": 0.5 + 0.1 * point.r_t}

    def latency(self, point: Point) -> Row:
        self._begin(f"time {point.key}")
        return {**self._row(point), "minutes": 0.0, "trained": False, "ms_per_frame": 8.0 / point.r_t}

    def _begin(self, what: str) -> None:
        if what == self.fails_at:
            raise KeyboardInterrupt
        self.log.append(what)

    def _row(self, point: Point) -> Row:
        return {"scenario": point.scenario, "method": "neural", "label": point.name}


def nothing(_count: int) -> None:
    """Follow no progress."""


def test_the_family() -> None:
    assert len(POINTS) == 2 * 5 * 5 * 3 * 2
    assert len({point.key for point in POINTS}) == len(POINTS)
    paper = Point(scenario="water_2d", r_t=2, ratio="1/1.75", size="128x10", spacings=2.9)
    assert paper in POINTS
    spec = paper.spec(0)
    assert (spec.latent, spec.layers, spec.hidden_layers, spec.r_t, spec.relaxations) == (128, 10, 2, 2, 0)
    # The paper's radius in 2D.
    assert spec.radius == pytest.approx(0.015, rel=0.02)


def test_patterns() -> None:
    assert matching(()) == list(POINTS)
    chosen = matching(["sand_2d-t8-p1_4-*-R2.2", TINY])
    assert [point.key for point in chosen] == [TINY] + [
        f"sand_2d-t8-p1_4-{size}-R2.2" for size in ("32x3", "64x4", "128x10")
    ]
    with pytest.raises(
        ConfigError, match=r"no point matches 'water\*t3\*'; their names are like water_2d-t16"
    ):
        matching([TINY, "water*t3*"])


LINE = "water_2d-*-p1_16-32x3-R2.2"
"""Five points, of r_t = 16 to 1."""


@pytest.mark.parametrize("what", ["training", "timing"])
def test_an_interrupted_sweep_goes_on(tmp_path: Path, what: str) -> None:
    points = matching([LINE])
    keys = [point.key if what == "training" else f"time {point.key}" for point in points]
    assert len(keys) == 5

    def go(results: SweepResults, notebook: Notebook, on_progress: Callable[[int], object]) -> None:
        if what == "training":
            results.train(points, 2.0, notebook, SOURCE, on_progress)
        else:
            results.time(points, notebook, SOURCE, on_progress)

    first, second = Notebook(fails_at=keys[2]), Notebook()
    with pytest.raises(KeyboardInterrupt):
        go(SweepResults(tmp_path, SweepSettings()), first, nothing)
    assert first.log[1:] == keys[:2]
    again = SweepResults(tmp_path, SweepSettings())
    missing = again.untrained(points, 2.0) if what == "training" else again.untimed(points)
    assert missing == points[2:]
    done: list[int] = []
    go(again, second, done.append)
    assert second.log == keys[2:]
    assert done == [1, 1, 1]
    networks = [row for row in again.rows() if row["method"] == "neural"]
    assert [row["label"] for row in networks] == [point.name for point in points]
    assert all(row["machine"] == "m" for row in networks)
    assert not list(tmp_path.rglob(".*"))


def test_errors_and_latencies_come_together(tmp_path: Path) -> None:
    points = matching([LINE])
    results, notebook = SweepResults(tmp_path, SweepSettings()), Notebook()
    assert results.worthwhile(points) == []
    results.time(points, notebook, SOURCE, nothing)
    # MPM takes 1 ms, r_t = 16 half of it, r_t = 8 as long.
    assert results.worthwhile(points) == points[:1]
    assert results.survivors() == []
    results.train(points[:2], 5.0, notebook, SOURCE, nothing)
    later = dataclasses.replace(SOURCE, commit="d")
    results.train(points[:1], 6.0, notebook, later, nothing)
    assert [point for point in points if point in results.untrained(points, 6.0)] == points[1:]
    assert results.untrained(points, 0.0) == []
    # r_t = 16 is quicker and worse than r_t = 8: both survive; the untrained ones cannot.
    assert results.survivors() == points[:2]
    mpm, still, *networks = results.rows()
    assert (mpm["ms_per_frame"], still["ms_per_frame"]) == (1.0, None)
    assert [row["ms_per_frame"] for row in networks] == [8 / point.r_t for point in points]
    assert [row["minutes"] for row in networks] == [6.0, 5.0, 0.0, 0.0, 0.0]
    assert [(row["commit"], row["timed_commit"]) for row in networks[:2]] == [("d", "c"), ("c", "c")]
    trained = [row for row in networks if row["trained"]]
    assert [row["dominated_by"] for row in trained] == [None, "mpm 1"]
    assert [row["as_good"] for row in trained] == ["1", "1"]
    # Each row has all fields, also those that it has nothing for.
    assert len({tuple(row) for row in (mpm, still, *networks)}) == 1


def test_other_settings_and_damaged_files_are_refused(tmp_path: Path) -> None:
    points = matching([TINY])
    SweepResults(tmp_path, SweepSettings()).train(points, 1.0, Notebook(), SOURCE, nothing)
    with pytest.raises(ConfigError, match="holds points with scenes = 10, not 3; take the same settings"):
        SweepResults(tmp_path, SweepSettings(scenes=3))
    (tmp_path / "points" / f"{TINY}.json").write_text("[]")
    with pytest.raises(DataError, match=r"R2\.2\.json is damaged: no list of objects; delete it"):
        SweepResults(tmp_path, SweepSettings()).rows()


def test_steps_are_timed_on_states_of_mpm(monkeypatch: pytest.MonkeyPatch) -> None:
    scene = scenarios.water_2d(1_100_000)
    seen: list[np.ndarray] = []

    class Watched(FreeFall):
        def step(self, history: np.ndarray, *others: Any) -> np.ndarray:
            seen.append(history)
            return super().step(history, *others)

    stepper = Watched(0.0025, r_p=1 / 16, r_t=8)
    step, yardstick = latency.step_latency(stepper, scene, earliest=80, span=50, threads=1, seconds=60.0)
    assert step is not None
    assert yardstick is not None
    assert 0 < step.median <= step.p95
    assert step.per_call == pytest.approx(8 * step.median)
    assert yardstick.median > 0
    # One untimed, and one every ten frames, each with the solver's own states behind it.
    assert len(seen) == 6
    from hybridmpm import MpmSolver

    solver = MpmSolver(scene, r_p=1 / 16)
    solver.advance(88)
    np.testing.assert_array_equal(seen[0][-1], solver.positions)
    solver.advance(10)
    np.testing.assert_array_equal(seen[1][-1], solver.positions)


@pytest.fixture
def run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[..., Result]:
    """Return the command on a small sweep: one rung of MPM, one r_t of the zero network, two scenes."""
    small_runner = importlib.import_module("hybridmpm.bench.sweep.runner")
    for rungs in ("LADDER", "RATIOS"):
        monkeypatch.setattr(small_runner, rungs, {"1/16": 1 / 16})
    monkeypatch.setattr(small_runner, "STRIDES", (8,))
    monkeypatch.setattr("hybridmpm.bench.accuracy.methods._CROWD", 2)
    small = ["--scenes", "2", "--span", "40", "--trajectories", "1", "--device", "cpu"]

    def command(*arguments: str) -> Result:
        return CliRunner().invoke(
            cli, ["bench", "sweep", "--results", str(tmp_path / "sweep"), *small, *arguments]
        )

    return command


def test_a_point_measured_without_training(
    run: Callable[..., Result], tmp_path: Path, tiny_model: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    file = tmp_path / "rows.json"
    # An export takes seconds; that of this network is done.
    training = importlib.import_module("hybridmpm.bench.sweep.training")
    monkeypatch.setattr(training, "to_onnx", lambda _simulator, _info: tiny_model.read_bytes())
    result = run("--points", TINY, "--json", str(file))
    assert result.exit_code == 0, result.output
    *references, untrained = json.loads(file.read_text())
    assert [(row["method"], row["label"]) for row in references] == [
        ("mpm", "1/16"), ("zero", "r_p 1/16, r_t 8"), ("merged", "1/16"), ("still", None), ("frozen", None),
        ("jitter", None),
    ]  # fmt: skip
    assert untrained["label"] == "t8-p1_16-32x3-R2.2"
    assert (untrained["trained"], untrained["error"], untrained["steps"]) == (False, None, 0)
    assert 0 < untrained["ms_per_frame"] <= untrained["ms_p95"]
    assert untrained["ms_mpm"] > 0


@pytest.mark.long
def test_a_point_measured_and_then_trained(
    run: Callable[..., Result], tmp_path: Path, tiny_model: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    file, chart = tmp_path / "rows.json", tmp_path / "chart.svg"
    # An export takes seconds; that of the trained network is done.
    training = importlib.import_module("hybridmpm.bench.sweep.training")
    monkeypatch.setattr(training, "to_onnx", lambda _simulator, _info: tiny_model.read_bytes())
    assert run("--points", TINY, "--json", str(file)).exit_code == 0
    *references, untrained = json.loads(file.read_text())
    longer = ("--minutes-per-point", "0.02", "--untimed")
    result = run("--points", TINY, *longer, "--json", str(file), "--chart", str(chart))
    assert result.exit_code == 0, result.output
    *_, trained = json.loads(file.read_text())
    assert trained["ms_per_frame"] == untrained["ms_per_frame"]
    assert (trained["trained"], trained["minutes"], trained["failed"]) == (True, 0.02, 0)
    assert trained["steps"] >= 1
    assert trained["error"] > 0
    assert trained["start"] >= 80
    assert trained["below_zero_40"] is not None
    assert trained["dominated_by"] == "mpm 1/16"
    assert set(trained) == set(references[0])
    required = {
        "scenario",
        "method",
        "label",
        "r_p",
        "r_t",
        "r_c",
        "ms_per_frame",
        "ms_p95",
        "error",
        "error_se",
    }
    assert required | {"mpm_share", "machine", "threads", "date", "commit", "command"} < set(trained)
    assert (tmp_path / "sweep" / "training" / f"{TINY}-0.02min" / "checkpoint.pt").exists()
    assert chart.with_suffix(".png").stat().st_size > 20_000
    assert "hollow: dominated by MPM" in chart.read_text()
    assert run("--survivors").exit_code == 0


def test_bad_input_is_named(run: Callable[..., Result], monkeypatch: pytest.MonkeyPatch) -> None:
    for arguments, text in (
        (["--points", "nothing"], "no point matches 'nothing'"),
        (["--survivors"], "no point has been both trained and timed yet"),
        (["--worthwhile", "--untimed"], "none of the points is known to be quicker than MPM"),
        (["--minutes-per-point", "-1"], "-1.0 is not in the range"),
        (["--device", "abacus"], "--device abacus cannot be used"),
    ):
        result = run(*arguments)
        assert result.exit_code == 2
        assert text in result.stderr
    assert SCENARIOS == ("water_2d", "sand_2d")
