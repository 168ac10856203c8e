"""The rows of `bench models` are complete, and count from the right frame; who is dominated is said."""

import importlib
import json
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from click.testing import CliRunner

from hybridmpm import MpmSolver, NonFiniteError, Scene, scenarios
from hybridmpm.physics.free_fall import FreeFall
from hybridmpm.recording import record
from hybridmpm_lab.commands import cli
from hybridmpm_lab.compare.accuracy import comparison, conventions, latency, methods, rollouts
from hybridmpm_lab.compare.accuracy.methods import Method
from hybridmpm_lab.harness import pareto

pytestmark = pytest.mark.needs("ot", "bench")

SOURCE = {"machine", "date", "commit", "command", "solver_version", "ingredients"}
FIELDS = SOURCE | {
    "scenario", "method", "label", "r_p", "r_t", "r_c", "ms_per_frame", "ms_p95", "ms_per_call", "error",
    "error_se", "mpm_share", "threads", "scenes", "failed", "parameters", "warm_up", "start", "as_good",
    "as_good_ms", "dominated_by", "below_zero_40", "minus_zero_40", "minus_zero_40_se", "error_100",
    "grid_nrmse_200", "sinkhorn_40", "centroid", "kinetic_energy", "max_density", "penetrations",
}  # fmt: skip


def invoke(*arguments: str) -> Any:
    return CliRunner().invoke(cli, ["models", *arguments])


def test_rows_and_chart(tmp_path: Path, tiny_model: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(comparison, "LADDER", {"1": 1.0, "1/16": 1 / 16})
    monkeypatch.setattr(methods, "_CROWD", 3)
    file, chart = tmp_path / "rows.json", tmp_path / "chart.svg"
    options = ["--model", str(tiny_model), "--scenes", "2", "--span", "40", "--threads", "1"]
    result = invoke(*options, "--json", str(file), "--chart", str(chart))
    assert result.exit_code == 0, result.output
    rows = {(row["method"], row["label"]): row for row in json.loads(file.read_text())}
    assert list(rows) == [
        ("neural", "tiny"), ("relaxed", "r_p 1/16, r_t 8, R 0.03, 1 rounds"),
        ("zero", "r_p 1/16, r_t 8"), ("mpm", "1"), ("mpm", "1/16"), ("merged", "1/16"), ("still", None),
        ("frozen", None), ("jitter", None),
    ]  # fmt: skip
    for row in rows.values():
        assert set(row) > FIELDS
        assert set(row) == set(rows["neural", "tiny"])
        assert (row["scenario"], row["scenes"], row["failed"], row["warm_up"]) == ("water_2d", 2, 0, 40)
        assert row["start"] >= 40
        assert row["error"] > 0
        assert row["error_se"] >= 0
        assert row["error_200"] is None
        assert row["command"] == " ".join(["python -m hybridmpm_lab models", *options])
    for method in ("neural", "zero", "mpm"):
        row = next(row for row in rows.values() if row["method"] == method)
        assert 0 < row["ms_per_frame"] <= row["ms_p95"]
        assert row["ms_per_call"] == pytest.approx(row["ms_per_frame"] * row["r_t"], rel=1e-3)
        assert row["sinkhorn_40"] > 0
    tiny = rows["neural", "tiny"]
    assert (tiny["r_p"], tiny["r_t"], tiny["r_c"], tiny["mpm_share"]) == (0.0625, 8, None, 0.0)
    assert tiny["below_zero_40"] == pytest.approx(
        1 - tiny["error_40"] / rows["zero", "r_p 1/16, r_t 8"]["error_40"], abs=1e-3
    )
    assert rows["mpm", "1"]["mpm_share"] == 1.0
    assert rows["merged", "1/16"]["r_p"] == 0.0625
    assert rows["merged", "1/16"]["ms_per_frame"] is None
    assert rows["mpm", "1"]["error"] < rows["mpm", "1/16"]["error"] < rows["still", None]["error"]
    assert rows["mpm", "1"]["as_good"] == "1"
    assert rows["still", None]["as_good"] == "1/16"
    assert "tiny" in result.stdout
    assert "free fall" in chart.read_text()
    assert chart.with_suffix(".png").stat().st_size > 10_000


def test_errors_are_counted_from_impact_or_first_prediction(drop: Scene) -> None:
    truth = rollouts.Truth.of(drop, latest_warm_up=150, span=20)
    # The ball's lowest point is 0.44 m above the floor.
    assert truth.impact * drop.frame_dt == pytest.approx(np.sqrt(2 * 0.44 / 9.81), abs=0.01)
    assert truth.start(40) == truth.impact
    assert truth.start(150) == 150
    assert truth.frames == 170
    part = rollouts.excerpt(truth.states, truth.impact, 20)
    assert part.frames.tolist() == [truth.impact + 10, truth.impact + 20]
    held = rollouts.frozen(truth.states, truth.impact)
    np.testing.assert_array_equal(held.positions[3], truth.states.positions[truth.impact])
    assert rollouts.errors(part, part, transport=False)["error"] == 0


def test_the_zero_network_is_right_until_the_impact_and_wrong_after(drop: Scene) -> None:
    truth = rollouts.Truth.of(drop, latest_warm_up=0, span=60)
    run = record(methods.zero(1.0, 4, threads=1).make(drop), truth.frames)
    falling = (
        rollouts.excerpt(run, truth.impact - 30, 20),
        rollouts.excerpt(truth.states, truth.impact - 30, 20),
    )
    landed = rollouts.excerpt(run, truth.impact, 60), rollouts.excerpt(truth.states, truth.impact, 60)
    assert rollouts.errors(*falling, transport=False)["error"] < 1e-3
    assert rollouts.errors(*landed, transport=False)["error"] > 0.5


class Wandering(FreeFall):
    """Is lost after three steps."""

    calls = 0

    def step(self, history: Any, *others: Any) -> npt.NDArray[np.float32]:
        self.calls += 1
        return super().step(history, *others) * np.float32(1 if self.calls <= 3 else np.nan)


def test_a_model_that_fails_has_no_error() -> None:
    stepper = Wandering(0.0025, r_p=1 / 16, r_t=8)
    model = methods.neural("lost", stepper, threads=1, parameters=1)
    assert rollouts.rollout(model.make(scenarios.water_2d(1)), 100) is None
    stepper.calls = 0
    scene = scenarios.water_2d(1)
    with pytest.raises(NonFiniteError, match="frame 65"):
        model.make(scene).advance(100)


def test_a_failure_is_counted_and_the_others_go_on(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(comparison, "LADDER", {"1/16": 1 / 16})
    monkeypatch.setattr(methods, "_CROWD", 2)
    model = methods.neural("lost", Wandering(0.0025, r_p=1 / 16, r_t=8), threads=1, parameters=1)
    one = comparison.Comparison(
        "water_2d", [model], comparison.ComparisonSettings(scenes=1, span=40, passes=1)
    )
    one.run(scenarios.water_2d(1_100_000))
    lost, zero, *_ = one.rows()
    assert (lost["failed"], lost["error"], lost["below_zero_40"], lost["dominated_by"]) == (
        1,
        None,
        None,
        None,
    )
    assert zero["failed"] == 0
    assert zero["error"] > 0


def level(label: str, ms: float | None, error: float | None, method: str = "mpm") -> dict[str, Any]:
    return {"method": method, "label": label, "ms_per_frame": ms, "error": error}


def test_who_dominates_and_which_level_is_as_good() -> None:
    ladder = [level("1", 1.0, 0.1), level("1/4", 0.3, 0.4), level("1/16", 0.1, 0.9)]
    models = [
        level("slow", 0.5, 0.5, "neural"), level("fast", 0.05, 0.95, "neural"),
        level("good", 0.2, 0.3, "neural"), level("unmeasured", 0.2, None, "neural"),
    ]  # fmt: skip
    bounds = [level("x", None, 0.01, "merged"), level("y", None, 1.0, "still")]
    found = {row["label"]: row for row in pareto.compared([*ladder, *models, *bounds])}
    assert found["slow"]["dominated_by"] == "neural good"
    assert (found["slow"]["as_good"], found["slow"]["as_good_ms"]) == ("1/4", 0.3)
    assert found["fast"]["dominated_by"] is None
    assert found["fast"]["as_good"] == "1/16"
    assert (found["good"]["dominated_by"], found["good"]["as_good"]) == (None, "1")
    assert found["1/4"]["dominated_by"] == "neural good"
    assert (found["unmeasured"]["dominated_by"], found["unmeasured"]["as_good"]) == (None, None)
    assert (found["x"]["dominated_by"], found["x"]["as_good"]) == (None, None)
    assert found["y"]["as_good"] == "1/16"


class Clock:
    """A simulator that logs what it is asked for."""

    def __init__(self, log: list[str], name: str) -> None:
        self.log, self.name, self.frame = log, name, 0

    def reset(self) -> None:
        self.frame = 0

    def advance(self, frames: int = 1) -> None:
        self.frame += frames
        self.log.append(f"{self.name}{self.frame}")


def test_latencies_are_taken_by_turns() -> None:
    log: list[str] = []
    timings = [latency.Timing(Clock(log, "a"), 5), latency.Timing(Clock(log, "b"), 10)]
    found = latency.latencies_by_turns(timings, start=20, span=20, passes=2, seconds=10.0)
    once = ["a20", "b20", "a25", "a30", "b30", "a35", "a40", "b40"]
    assert log == once * 2
    for one, frames in zip(found, (5, 10), strict=True):
        assert one is not None
        assert 0 < one.median <= one.p95
        assert one.per_call == pytest.approx(one.median * frames)
    log.clear()
    slow = latency.Timing(Clock(log, "c"))
    latency.latencies_by_turns([slow], start=0, span=20, passes=3, seconds=0.0)
    assert log == ["c0", "c1", "c2", "c3"]


def test_the_reference_scene_is_crowded() -> None:
    scene = methods.reference_scene("sand_3d")
    assert MpmSolver(scene).particle_count > 0.9 * scenarios.describe("sand_3d").max_particles


def test_labels_of_ratios() -> None:
    assert [conventions.ratio_label(r_p) for r_p in (1.0, 1 / 1.75, 0.125, 0.3)] == [
        "1",
        "1/1.75",
        "1/8",
        "0.3",
    ]
    method = Method(kind="zero", label="x", r_p=1.0, r_t=16, make=MpmSolver)
    assert (method.name, method.warm_up) == ("zero x", 80)


def test_bad_input_is_named(tmp_path: Path, tiny_model: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    model = ["--model", str(tiny_model)]
    result = invoke(*model, "--scenario", "sand_3d", "--scenario", "water_2d")
    assert result.exit_code == 2
    assert f"no model serves sand_3d; the models are {tiny_model}" in result.stderr
    result = invoke(*model, *model)
    assert result.exit_code == 2
    assert "two models are called tiny" in result.stderr
    result = invoke("--model", str(tmp_path / "none.onnx"))
    assert result.exit_code == 2
    assert "none.onnx" in result.stderr
    result = invoke(*model, "--chart", str(tmp_path / "absent" / "chart.svg"))
    assert result.exit_code == 2
    assert "does not exist" in result.stderr
    monkeypatch.setattr(importlib.import_module("hybridmpm_lab.commands.errors"), "shipped_models", dict)
    result = invoke()
    assert result.exit_code == 2
    assert "no model serves any scenario; the models are none yet" in result.stderr
