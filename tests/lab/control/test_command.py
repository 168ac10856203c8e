"""`python -m hybridmpm_lab control`: it resumes, takes methods of one's own, and fills the page of docs."""

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner, Result

from hybridmpm import ConfigError
from hybridmpm_lab.commands import cli
from hybridmpm_lab.control.methods import methods_of
from hybridmpm_lab.control.runner import (
    MEASURES,
    ControlSettings,
    count_missing,
    rows_of,
    run_key,
    run_missing,
    run_store,
)
from hybridmpm_lab.control.suite import Case, cases
from hybridmpm_lab.control.table import means, tables
from hybridmpm_lab.harness.provenance import Provenance
from hybridmpm_lab.harness.rows import RowStore, read_rows

pytestmark = pytest.mark.needs("ot", "metrics")

DOCS = Path(__file__).parents[3] / "docs"
PAGE = DOCS / "results" / "control.md"
SOURCE = Provenance(machine="m", date="2026-01-01", commit="0123456789", command="control")
CASES = cases(["gather"], ["water_2d"], seeds=2)
TIMES = ("plan_ms", "first_frame_ms", "total_ms", "slowdown")

METHODS = """
import numpy as np
from hybridmpm import SimulationError
from hybridmpm.control.laws import Unforced

class Idle:
    name = "idle"
    def plan(self, simulator, task):
        return Unforced()

class Raising(Idle):
    def plan(self, simulator, task):
        raise KeyError("weights")

class WrongShape(Idle):
    def plan(self, simulator, task):
        return self
    def force(self, simulator, index):
        return np.zeros((3, 7), np.float32)

class NoLaw(Idle):
    def plan(self, simulator, task):
        return None

class Failing(Idle):
    def plan(self, simulator, task):
        raise SimulationError("no law was found")

class Nameless:
    def plan(self, simulator, task):
        return Unforced()

class Taken(Idle):
    name = "analytic"

number = 3
"""


@pytest.fixture
def mine(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Put a module with methods of one's own where Python finds it."""
    (tmp_path / "my_control.py").write_text(METHODS)
    monkeypatch.syspath_prepend(str(tmp_path))


def ignore(_: int) -> None:
    pass


def invoke(*words: str) -> Result:
    return CliRunner().invoke(cli, ["control", *words])


def add(store: RowStore, case: Case, method: str, **figures: Any) -> None:
    """Add a run with some figures, and without all others."""
    head = {**vars(case), "sketch": case.kind, "method": method, "bodies": 1, "failed": None}
    row = SOURCE.stamped(head | dict.fromkeys(MEASURES) | figures)
    store.add(run_key(case, method), {"run": row, "looks": []})


def settings(*methods: str, seeds: int = 1) -> ControlSettings:
    return ControlSettings(family=("gather",), scenario=("water_2d",), seeds=seeds, method=methods)


@pytest.mark.long
def test_an_interrupted_command_resumes_and_ends_with_the_same_rows(tmp_path: Path) -> None:
    file, both = tmp_path / "runs.jsonl", settings("constant", "filled", seeds=2)
    left = [2]

    def stop_after_two(_: int) -> None:
        left[0] -= 1
        if left[0] == 0:
            raise KeyboardInterrupt

    assert count_missing(both, run_store()) == 4
    with pytest.raises(KeyboardInterrupt):
        run_missing(both, run_store(file), SOURCE, stop_after_two)
    resumed, whole = run_store(file), run_store()
    assert count_missing(both, resumed) == 2
    for store in (resumed, whole):
        run_missing(both, store, SOURCE, ignore)
    found = [rows_of(CASES, both.methods, store) for store in (resumed, whole, run_store(file))]
    for row in (row for rows in found for row in rows):
        for name in TIMES:
            row.pop(name)
    assert len(found[0]) == 4
    assert found[0] == found[1] == found[2]
    assert [np.shape(resumed[run_key(case, "constant")]["looks"]) for case in CASES] == [(4, 13)] * 2


def test_means_and_paired_differences_are_those_of_the_sketches() -> None:
    some = cases(["gather"], ["water_2d", "sand_3d"], seeds=2)
    store = run_store()
    for case, constant in zip(some, (0.4, 0.2, 0.8, 0.6), strict=True):
        add(store, case, "constant", transport=constant)
        add(store, case, "none", transport=constant - 0.1)
    rows = {
        (row["scenario"], row["method"]): row for row in means(store, some, methods_of(("constant", "none")))
    }
    none = rows["water_2d", "none"]
    assert none["transport"] == pytest.approx(0.2)
    assert none["transport_se"] == pytest.approx(0.1)
    assert (none["gap"], none["gap_se"]) == (-0.1, pytest.approx(0, abs=1e-12))
    assert (none["wins"], none["count"], none["suite_count"]) == (1.0, 2, 10)
    assert rows["water_2d", "constant"]["gap"] is None
    assert rows["all", "constant"]["transport"] == pytest.approx(0.5)
    assert (rows["all", "none"]["count"], rows["all", "none"]["suite_count"]) == (4, 20)
    assert none["solver_version"] == SOURCE.solver_version


@pytest.mark.usefixtures("mine")
@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("nothing", "method must be one of none, constant, .* or MODULE:ATTRIBUTE, .* got 'nothing'"),
        ("absent_module:Method", "PYTHONPATH.*ModuleNotFoundError: No module named 'absent_module'"),
        ("my_control:Absent", "has no attribute 'Absent'"),
        ("my_control:number", "'int' object is not callable"),
        ("my_control:Nameless", "has no attribute 'name'"),
        ("my_control:Taken", "a `name` of its own, got 'analytic'"),
    ],
)
def test_a_wrong_method_is_refused_before_anything_runs(name: str, message: str) -> None:
    with pytest.raises(ConfigError, match=message):
        methods_of((name,))


@pytest.mark.usefixtures("mine")
@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("Raising", "idle is broken, in gather/water_2d/oval/.*: KeyError: 'weights'"),
        ("WrongShape", r"idle is broken, .*\(3, 7\)"),
        ("NoLaw", "idle is broken, .* must return a law"),
    ],
)
def test_a_broken_method_is_named_with_its_case_and_its_error(name: str, message: str) -> None:
    with pytest.raises(ConfigError, match=message):
        run_missing(settings(f"my_control:{name}"), run_store(), SOURCE, ignore)


@pytest.mark.usefixtures("mine")
def test_the_command_compares_ones_own_method_with_the_others(tmp_path: Path) -> None:
    rows_file, picture = tmp_path / "rows.json", tmp_path / "control.svg"
    own = ("--method", "my_control:Idle", "--method", "my_control:Failing")
    words = [
        *("--family", "gather", "--scenario", "water_2d", "--seeds", "1", "--method", "analytic"),
        *("--method", "filled", *own[:2], "--json", str(rows_file)),
        *("--chart", str(picture)),
    ]
    done = invoke(*words)
    assert done.exit_code == 0, done.output
    assert "| gather, ovals: transport [mm] | constant | analytic | filled | idle |" in done.output
    rows = {row["method"]: row for row in read_rows(rows_file)}
    assert set(rows) == {"constant", "analytic", "filled", "idle"}
    needed = {
        "scenario", "family", "sketch", "method", "error", "error_se", "transport", "inside", "naturalness",
        "first_frame_ms", "total_ms", "machine", "threads", "date", "commit", "command", "solver_version",
        "ingredients",
    }  # fmt: skip
    assert all(needed <= set(row) for row in rows.values())
    assert all(row["slowdown"] >= 1 for row in rows.values())
    assert rows["analytic"]["inside"] > 0.9 > rows["idle"]["inside"]
    assert rows["filled"]["transport"] < rows["analytic"]["transport"] < rows["constant"]["transport"]
    assert all(row["count"] == 1 < row["suite_count"] for row in rows.values())
    assert picture.stat().st_size > 5_000
    failed = invoke(*words[:6], *own[2:])
    assert "| water_2d | " in failed.output
    assert "| failed |" in failed.output


def test_families_without_sketches_in_a_scenario_are_refused() -> None:
    done = invoke("--family", "bent", "--scenario", "sand_ramps_2d")
    assert done.exit_code == 2
    assert "have no sketches in sand_ramps_2d: bent and gather leave out ramps" in done.output


def test_the_method_of_the_page_can_be_run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (example,) = re.findall(r"```python\n(.*?)```", PAGE.read_text(encoding="utf-8"), re.DOTALL)
    (tmp_path / "my_springs.py").write_text(example)
    monkeypatch.syspath_prepend(str(tmp_path))
    store = run_store()
    run_missing(settings("my_springs:Springs"), store, SOURCE, ignore)
    row = store[run_key(CASES[0], "springs")]["run"]
    assert row["inside"] > 0.5
    assert row["peak_g"] <= 15.001


def test_tables_have_figures_costs_and_the_papers_ratios() -> None:
    some = cases(["reversed"], ["water_2d"], seeds=2)[:2]
    store = run_store()
    for case, better in zip(some, (0.5, 0.7), strict=True):
        add(store, case, "constant", error=1.0, nrmse=0.2, rms_g=1.0, plan_ms=800.0, slowdown=1.1)
        add(store, case, "analytic", error=better, nrmse=0.1, rms_g=2.0, plan_ms=20.0, slowdown=1.2)
    methods = methods_of(("constant", "analytic"))
    text = tables(means(store, some, methods))
    assert "Measured on a part of the sketches, 2 a row or more; m, 2026-01-01, commit 0123456." in text
    assert "| water_2d | 1.000 ± 0.000 | 0.600 ± 0.100 |" in text
    assert "| reversed, ovals, analytic |  |  |  | 20 |  |  | 1.2 |" in text
    assert "| paper, learned | 0.0802 (0.88) |" in text
    assert "| ovals, analytic | 0.1000 ± 0.0000 (0.60) |" in text


def test_the_page_has_the_tables_of_the_committed_results() -> None:
    page = PAGE.read_text(encoding="utf-8")
    rows = read_rows(DOCS / "results" / "control.json")
    assert [part for part in tables(rows).split("\n\n") if part.strip() not in page] == []
