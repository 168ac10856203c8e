"""A sweep goes on at the point where it stopped, redoes what was trained for less, and names survivors."""

import importlib
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner, Result

from hybridmpm import ConfigError, DataError, scenarios
from hybridmpm.bench import latency, sweep
from hybridmpm.bench.provenance import Provenance
from hybridmpm.bench.sweep import POINTS, Point, Settings, Sweep, matching
from hybridmpm.cli import cli
from hybridmpm.physics.zero import ZeroStepper

pytest.importorskip("ot", reason="needs POT: pip install 'hybridmpm[bench]'")

SOURCE = Provenance(machine="m", date="2026-01-01", commit="c", command="sweep")
TINY = "water_2d-t8-p1_16-32x3-R2.2"


class Notebook:
    """A laboratory that measures nothing, and fails at a point if asked to."""

    def __init__(self, fails_at: str | None = None) -> None:
        self.log: list[str] = []
        self.fails_at = fails_at

    def references(self, scenario: str) -> list[dict[str, Any]]:
        self.log.append(scenario)
        return [self._row(scenario, "mpm", "1", 1.0, 0.1), self._row(scenario, "still", None, None, 1.4)]

    def measure(self, point: Point, minutes: float) -> dict[str, Any]:
        if point.key == self.fails_at:
            raise KeyboardInterrupt
        self.log.append(point.key)
        error = None if minutes == 0 else 0.5 + 0.1 * point.r_t
        row = self._row(point.scenario, "neural", point.name, 8.0 / point.r_t, error)
        return row | {"minutes": minutes, "trained": minutes > 0}

    def _row(
        self, scenario: str, method: str, label: str | None, ms: float | None, error: float | None
    ) -> dict[str, Any]:
        return {
            "scenario": scenario, "method": method, "label": label, "ms_per_frame": ms, "error": error,
        }  # fmt: skip


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


def test_an_interrupted_sweep_goes_on(tmp_path: Path) -> None:
    points = matching(["water_2d-*-p1_16-32x3-R2.2"])
    keys = [point.key for point in points]
    assert len(keys) == 5
    first = Notebook(fails_at=keys[2])
    with pytest.raises(KeyboardInterrupt):
        Sweep(tmp_path, Settings()).run(points, 0.0, first, SOURCE, nothing)
    assert first.log == ["water_2d", *keys[:2]]
    second, again = Notebook(), Sweep(tmp_path, Settings())
    assert [point.key for point in again.missing(points, 0.0)] == keys[2:]
    done: list[int] = []
    again.run(points, 0.0, second, SOURCE, done.append)
    assert second.log == keys[2:]
    assert done == [1, 1, 1]
    rows = again.rows()
    assert [row["label"] for row in rows[2:]] == [point.name for point in points]
    assert all(row["machine"] == "m" for row in rows)
    assert not list(tmp_path.rglob(".*"))


def test_more_minutes_redo_points_and_fewer_do_not(tmp_path: Path) -> None:
    points = matching(["water_2d-*-p1_16-32x3-R2.2"])
    results, notebook = Sweep(tmp_path, Settings()), Notebook()
    results.run(points, 0.0, notebook, SOURCE, nothing)
    assert results.survivors() == []
    results.run(points[:2], 5.0, notebook, SOURCE, nothing)
    assert notebook.log[-2:] == [point.key for point in points[:2]]
    assert results.missing(points, 5.0) == points[2:]
    assert results.missing(points, 0.0) == []
    # r_t = 16 is quicker and worse than r_t = 8: both survive; the untrained ones cannot.
    assert results.survivors() == points[:2]
    trained = [row for row in results.rows() if row["method"] == "neural" and row["trained"]]
    assert [row["dominated_by"] for row in trained] == [None, "mpm 1"]
    assert [row["as_good"] for row in trained] == ["1", "1"]


def test_other_settings_and_damaged_files_are_refused(tmp_path: Path) -> None:
    points = matching([TINY])
    Sweep(tmp_path, Settings()).run(points, 0.0, Notebook(), SOURCE, nothing)
    with pytest.raises(ConfigError, match="holds points with scenes = 10, not 3; take the same settings"):
        Sweep(tmp_path, Settings(scenes=3))
    (tmp_path / "points" / f"{TINY}.json").write_text("[]")
    with pytest.raises(DataError, match=r"R2\.2\.json is damaged: no list of objects; delete it"):
        Sweep(tmp_path, Settings()).rows()


def test_steps_are_timed_on_states_of_mpm(monkeypatch: pytest.MonkeyPatch) -> None:
    scene = scenarios.water_2d(1_100_000)
    seen: list[np.ndarray] = []

    class Watched(ZeroStepper):
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
    laboratory = importlib.import_module("hybridmpm.bench.laboratory")
    monkeypatch.setattr(laboratory, "RATIOS", {"1/16": 1 / 16})
    monkeypatch.setattr(laboratory, "STRIDES", (8,))
    monkeypatch.setattr("hybridmpm.bench.methods._CROWD", 2)
    small = ["--scenes", "2", "--span", "40", "--trajectories", "1", "--device", "cpu"]

    def command(*arguments: str) -> Result:
        return CliRunner().invoke(
            cli, ["bench", "sweep", "--results", str(tmp_path / "sweep"), *small, *arguments]
        )

    return command


def test_a_point_measured_and_then_trained(
    run: Callable[..., Result], tmp_path: Path, tiny_model: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    file, chart = tmp_path / "rows.json", tmp_path / "chart.svg"
    # An export takes seconds; that of the trained network is done.
    training = importlib.import_module("hybridmpm.bench.sweep_training")
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
    result = run("--points", TINY, "--minutes-per-point", "0.02", "--json", str(file), "--chart", str(chart))
    assert result.exit_code == 0, result.output
    *_, trained = json.loads(file.read_text())
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
    assert "dominated by MPM alone" in chart.read_text()
    assert run("--survivors").exit_code == 0


def test_bad_input_is_named(run: Callable[..., Result], monkeypatch: pytest.MonkeyPatch) -> None:
    for arguments, text in (
        (["--points", "nothing"], "no point matches 'nothing'"),
        (["--survivors"], "no point has been trained yet"),
        (["--minutes-per-point", "-1"], "-1.0 is not in the range"),
        (["--device", "abacus"], "--device abacus cannot be used"),
    ):
        result = run(*arguments)
        assert result.exit_code == 2
        assert text in result.stderr
    assert sweep.SCENARIOS == ("water_2d", "sand_2d")
