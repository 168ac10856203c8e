"""The comparison of methods: complete rows, right errors and fronts, and runs that resume."""

import json
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner

from hybridmpm import Ball, MpmSolver, NonFiniteError, Scene, metrics, scenarios
from hybridmpm.errors import ConfigError, DataError
from hybridmpm.physics.free_fall import FreeFall
from hybridmpm.physics.manifest import models
from hybridmpm.physics.simulator import NeuralPhysics
from hybridmpm.planner import store as calibrations
from hybridmpm.planner.calibration import MEASURES as PLANNED
from hybridmpm.planner.calibration import Calibration
from hybridmpm_lab.commands import cli
from hybridmpm_lab.compare import comparison, hybrid, lists, methods, truth
from hybridmpm_lab.compare.comparison import Case
from hybridmpm_lab.compare.methods import Method
from hybridmpm_lab.harness.provenance import provenance, shipped
from hybridmpm_lab.harness.rows import FIRST_SEED, RowStore, equal_error, is_on_front, read_rows

NAMES = ("mpm 1", "mpm 1/16", "coarse 1/16", "neural fluids_2d all shown", "hybrid fluids_2d r_c 0.8")


def invoke(*words: str) -> Any:
    return CliRunner().invoke(cli, words, prog_name="python -m hybridmpm_lab")


def named(file: Path) -> dict[str, dict[str, Any]]:
    rows = read_rows(file)
    return {f"{row['method']} {row['label'] or ''}".strip(): row for row in rows}


@pytest.fixture
def drop() -> Scene:
    """Return a ball of water whose lowest point is 0.44 m above the floor."""
    ball = Ball(material="water", center=(0.5, 0.6), radius=0.06, velocity=(0.5, 0.0), seed=3)
    return Scene(name="drop", dim=2, resolution=64, bodies=(ball,))


@pytest.fixture(autouse=True)
def few_scenes(monkeypatch: pytest.MonkeyPatch) -> None:
    """Time the largest of two scenes, not of a hundred."""
    monkeypatch.setattr(truth, "_CROWD", 2)


@pytest.mark.needs("ot", "metrics")
def test_runs_gather_and_become_a_table(tmp_path: Path) -> None:
    runs, file, chart = tmp_path / "runs.jsonl", tmp_path / "rows.json", tmp_path / "chart.svg"
    options = ["--scenario", "water_2d", "--scenes", "2", "--span", "40"]
    options += [word for name in NAMES for word in ("--method", name)]
    more = ["--passes", "1", "--jobs", "1", "--runs", str(runs), "--json", str(file)]

    def run(*last: str) -> dict[str, dict[str, Any]]:
        result = invoke("tradeoff", *options, *more, *last)
        assert result.exit_code == 0, result.output
        return named(file)

    unmeasured = run("--only", "errors")
    assert unmeasured["mpm 1"]["ms_per_frame"] is None
    assert not unmeasured["mpm 1"]["on_front"]
    whole = runs.read_text()
    rows = run("--only", "times")
    assert runs.read_text().startswith(whole)
    assert len(runs.read_text().splitlines()) == len(whole.splitlines()) + len(NAMES)
    # The rest of an unfinished line is dropped, and measured again; nothing else is.
    whole = runs.read_text()
    runs.write_text(whole + whole.splitlines()[-1][:50])
    assert run("--chart", str(chart)) == rows
    assert runs.read_text() == whole
    assert chart.stat().st_size > 5_000
    assert "hollow" in chart.read_text()

    assert {name for name, row in rows.items() if row["ms_per_frame"]} == set(NAMES)
    assert {"jitter", "still", "merged 1/16"} < set(rows)
    for name, row in rows.items():
        assert (row["scenes"], row["failed"], row["warm_up"]) == (2, 0, 20)
        for measure in truth.MEASURES:
            assert (measure in row) == (measure not in {"error_100", "error_200"})
            assert measure not in row or row[measure] >= row[f"{measure}_se"] >= 0
        words = "--scenario water_2d --scenes 2 --span 40 " + " ".join(f"--method {one}" for one in NAMES)
        assert row["command"] == f"python -m hybridmpm_lab tradeoff {words}"
        used = {"coarse 1/16": "levels", NAMES[3]: "fluids_2d", NAMES[4]: "fluids_2d"}.get(name)
        assert row["ingredients"] == (used and f"{used}={shipped()[used]}")
    mean = {name: row["error"] for name, row in rows.items()}
    assert mean["mpm 1"] < mean["jitter"] < mean["coarse 1/16"] < mean["still"]
    assert mean["merged 1/16"] < mean["mpm 1/16"]
    assert (rows[NAMES[3]]["mpm_share"], rows["mpm 1"]["mpm_share"]) == (0, 1)
    # The most accurate is on the front, whatever the times are.
    assert rows["mpm 1"]["on_front"]
    assert rows["mpm 1"]["on_front_transport"]
    network = rows[NAMES[3]]
    as_good = [name for name in NAMES if name != NAMES[3] and mean[name] <= mean[NAMES[3]]]
    assert network["equal_mpm"] == min(
        (name for name in as_good if name.startswith(("mpm", "coarse"))),
        key=lambda name: rows[name]["ms_per_frame"],
    )
    assert network["equal_mpm_ms"] == rows[network["equal_mpm"]]["ms_per_frame"]


def test_wrong_options_are_named(tmp_path: Path) -> None:
    for words, message in (
        (("tradeoff", "--only", "table"), "--runs"),
        (("tradeoff", "--method", "mpm 1/3", "--only", "errors"), "coarse 1/16"),
        (("tradeoff", "--chart", str(tmp_path / "absent" / "chart.svg")), "does not exist"),
        (
            ("models", "--model", "fluids_2d", "--scenario", "sand_3d"),
            "no model serves sand_3d",
        ),
        (("models", "--model", "fluids_2d", "--model", "fluids_2d"), "two models are called fluids_2d"),
        (("models", "--model", str(tmp_path / "none.onnx")), "none.onnx"),
    ):
        result = invoke(*words)
        assert result.exit_code == 2, result.output
        assert message in result.stderr


def test_files_of_other_settings_and_damaged_files_are_refused(tmp_path: Path) -> None:
    file = tmp_path / "runs.jsonl"
    store = RowStore({"span": 200}, file)
    store.add(("errors", 1), {"error": 0.5})
    assert RowStore({"span": 200}, file)["errors", 1] == {"error": 0.5}
    with pytest.raises(ConfigError, match="has rows with span = 200, not 100"):
        RowStore({"span": 100}, file)
    file.write_text("no rows\n")
    with pytest.raises(DataError, match=r"runs.jsonl is no file of rows, or damaged"):
        RowStore({"span": 200}, file)


def test_all_methods_of_a_plan_are_compared() -> None:
    for case in lists.tradeoff_cases(lists.TradeoffSettings()):
        name = case.head["scenario"]
        served = methods.serving(name)
        assert {"mpm truth", "mpm 1/1.75", "mpm softer 1/4", "coarse 1/64"} < set(case.methods)
        assert {f"{kind} {one}" for one in served for kind in ("neural", "hybrid")} < set(case.methods)
        assert [one.settings["r_c"] for one in case.methods.values() if one.variant == "cosine"][0::5] == [
            0.0,
            0.9,
        ]
        assert case.warm_up == max(5 * models()[one].r_t for one in served)
        assert case.bounds[:3] == ("jitter", "still", "merged 1/1.75")


def test_rows_that_no_other_beats_are_the_front() -> None:
    times_, errors = (1.0, 2.0, 2.0, 3.0, None), (0.5, 0.4, 0.5, 0.4, 0.1)
    rows = [{"ms_per_frame": ms, "error": error} for ms, error in zip(times_, errors, strict=True)]
    assert [is_on_front(row, rows) for row in rows] == [True, True, False, False, False]
    assert equal_error({"error": 0.45}, rows) == rows[1]
    assert equal_error({"error": 0.3}, rows) is None
    assert equal_error({"error": None}, rows) is None


def test_errors_count_from_the_impact_or_the_first_prediction(drop: Scene) -> None:
    true = truth.Truth.of(drop, span=20)
    # The ball's lowest point is 0.44 m above the floor.
    assert true.impact * drop.frame_dt == pytest.approx(np.sqrt(2 * 0.44 / 9.81), abs=0.01)
    assert true.states.frames.tolist() == [true.impact + 10, true.impact + 20]
    later = truth.Truth.of(drop, warm_up=150, until=175)
    assert (later.start, later.states.frames.tolist()) == (150, [160, 170])
    run, counts = true.rollout(MpmSolver(drop, substeps="reference"))
    np.testing.assert_array_equal(run.positions, true.states.positions)
    assert truth.grid_errors(run, true)["error"] == 0
    assert truth.shares(true, counts, is_whole=True)["mpm_share"] == 1
    held = true.still()
    np.testing.assert_array_equal(held.positions[1], drop.sample().x)
    falling = methods.free_fall(1.0, 4).make(drop)
    assert truth.grid_errors(true.rollout(falling)[0], true)["error"] > 0.2


def test_the_grid_errors_are_those_of_all_errors(drop: Scene) -> None:
    true = truth.Truth.of(drop, span=40)
    run, _ = true.rollout(MpmSolver(drop, r_p=1 / 4))
    few, every = truth.grid_errors(run, true), truth.errors(run, true)
    for measure, value in few.items():
        assert value == pytest.approx(every[measure], rel=1e-4)
    states = metrics.merged_states(true.states, 1 / 4)
    assert truth.errors(states, true)["error"] < every["error"]


class Wandering(FreeFall):
    """Is lost after three steps."""

    calls = 0

    def step(self, history: Any, *others: Any) -> Any:
        self.calls += 1
        return super().step(history, *others) * np.float32(1 if self.calls <= 3 else np.nan)


class Lost(Method):
    def make(self, scene: Scene, threads: int = 1) -> NeuralPhysics:
        network = Wandering(scene.frame_dt, r_p=1 / 16, r_t=8)
        return NeuralPhysics(scene, network, show_all=False, threads=threads)


def test_a_failure_is_counted_and_the_others_are_measured() -> None:
    broken = Lost(method="neural", label="lost", r_p=1 / 16, r_t=8)
    with pytest.raises(NonFiniteError, match="frame 65"):
        broken.make(scenarios.water_2d(1)).advance(100)
    known = methods.planned("water_2d")
    case = Case(
        head={"scenario": "water_2d"},
        scene=partial(scenarios.get, "water_2d"),
        timed=partial(scenarios.get, "water_2d", FIRST_SEED),
        methods={one.name: one for one in (broken, known["coarse 1/64"])},
        seeds=(FIRST_SEED,),
        span=40,
        is_full=False,
    )
    store = RowStore({})
    comparison.measure_errors([case], store, provenance("c"), 1, lambda _: None)
    comparison.measure_times([case], store, provenance("c"), 1, lambda _: None)
    wrong, right = comparison.table([case], store)
    assert wrong["failed"] == 1
    assert {wrong[name] for name in ("error", "ms_per_frame", "dominated_by")} == {None}
    assert (right["failed"], right["on_front"], right["scenes"]) == (0, True, 1)
    assert right["ms_per_frame"] > 0


def test_the_timed_scene_is_crowded(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(truth, "_CROWD", 100)
    scene = truth.reference_scene("sand_3d")
    assert MpmSolver(scene).particle_count > 0.9 * scenarios.describe("sand_3d").max_particles


def test_labels_of_ratios() -> None:
    assert [methods.ratio_label(r_p) for r_p in (1.0, 1 / 1.75, 0.125, 0.3)] == ["1", "1/1.75", "1/8", "0.3"]


@pytest.mark.needs("ot", "metrics")
def test_models_of_the_library_and_of_files(tmp_path: Path) -> None:
    own, file = tmp_path / "own.onnx", tmp_path / "rows.json"
    folder = Path(methods.__file__).parents[3] / "python/hybridmpm/physics/weights"
    own.write_bytes((folder / models()["fluids_2d"].file).read_bytes())
    words = ["--scenario", "sand_2d", "--scenes", "1", "--span", "40", "--only", "errors", "--jobs", "1"]
    result = invoke("models", "--model", str(own), *words, "--json", str(file))
    assert result.exit_code == 0, result.output
    rows = named(file)
    assert list(rows)[:3] == ["neural own", "free fall r_p 1/8, r_t 4", "mpm 1"]
    assert rows["neural own"]["ingredients"] is None
    assert rows["mpm 1"]["error"] < rows["neural own"]["error"] < rows["free fall r_p 1/8, r_t 4"]["error"]


def test_hybrids_are_compared_with_mpm_of_as_few_particles(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(hybrid, "FRAMES", 130)
    file, chart = tmp_path / "rows.json", tmp_path / "chart.svg"
    words = ["--scenario", "water_2d", "--scenes", "1", "--bounded", "2", "--jobs", "1"]
    result = invoke("hybrid", *words, "--json", str(file), "--chart", str(chart))
    assert result.exit_code == 0, result.output
    rows = read_rows(file)
    means = {(row["scenario"], row["method"], row["label"]): row for row in rows if row["part"] == "mean"}
    hybrids = means["water_2d", "hybrid", "fluids_2d"]
    shares = [hybrids[name] for name in ("mpm_share", "network", "free_fall", "rest")]
    assert sum(shares) == pytest.approx(1, abs=1e-3)
    assert hybrids["free_fall"] > 0
    base = means["water_2d", "coarse", "unfitted 1/8"]
    assert (base["ratio"], base["mpm_share"], base["scenes"]) == (1, 1, 1)
    assert hybrids["ratio"] == pytest.approx(hybrids["error"] / base["error"], rel=1e-3)
    assert means["all", "hybrid", "network"]["ratio"] == hybrids["ratio"]
    assert means["water_2d", "coarse", "unfitted 1/8, other jitter"]["ratio"] != 1
    bounds = [row for row in rows if row["part"] == "bound"]
    assert [row["after"] for row in bounds] == [40, 100, 200]
    assert bounds[0]["calibrated_on"] + bounds[0]["tested_on"] == 2
    assert chart.stat().st_size > 5_000


def test_bounds_hold_in_nine_scenes_of_ten() -> None:
    # In 99 scenes the 90th smallest is the bound: (99 + 1) 0.9.
    known = [1 + one / 100 for one in range(1, 100)]
    found = hybrid.bound(known, [one + 0.105 for one in known])
    assert found["bound"] == pytest.approx(1.90)
    assert found["held"] == pytest.approx(79 / 99, rel=1e-3)
    assert (found["calibrated_on"], found["tested_on"]) == (99, 99)
    # Eight scenes are too few for nine of ten.
    assert hybrid.bound([1.0] * 8, [1.0] * 8)["bound"] is None


def test_a_calibration_of_rows(tmp_path: Path) -> None:
    fields = dict.fromkeys(PLANNED.values(), 0.5) | {f"{field}_se": 0.1 for field in PLANNED.values()}
    head = {"scenario": "water_2d", "scenes": 3, "commit": "abc"}
    rows = [
        head | fields | {"method": "mpm", "label": "1/8"},
        head | fields | {"method": "jitter", "label": None, "error_se": None},
        head | fields | {"method": "mpm", "label": "truth"},
        head | fields | {"method": "hybrid", "label": "fluids_2d r_c 0.8"},
        head | fields | {"method": "coarse", "label": "1/8", "error": None},
    ]
    source, file = tmp_path / "rows.json", tmp_path / "calibration.json"
    source.write_text(json.dumps(rows))
    result = invoke("plan-errors", str(source), str(file))
    assert result.exit_code == 0, result.output
    made = Calibration.model_validate_json(file.read_text())
    # Plans take neither the truth itself, nor hybrids at a chosen r_c, nor what failed.
    assert [one.name for one in made.errors] == ["mpm 1/8", "jitter"]
    assert made.errors[0].means["grid_rmse"] == 0.5
    assert "grid_rmse" not in made.errors[1].standard_errors
    assert made.times == calibrations.shipped().times
    with pytest.raises(DataError, match="no rows of a result"):
        read_rows(file)
