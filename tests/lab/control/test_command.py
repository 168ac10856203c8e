"""`python -m hybridmpm_lab control`: it goes on where it stopped, and takes methods of others."""

import json
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner, Result
from PIL import Image

from hybridmpm import ConfigError, DataError
from hybridmpm_lab.commands import cli
from hybridmpm_lab.control.entrants import entrant
from hybridmpm_lab.control.report.means import means
from hybridmpm_lab.control.report.sheets import first_cases, sheets, write_sheets
from hybridmpm_lab.control.results import Runs
from hybridmpm_lab.control.runner import ControlSettings, count_missing, measure
from hybridmpm_lab.control.suite.cases import Case, cases
from hybridmpm_lab.control.trial import MEASURES
from hybridmpm_lab.harness.provenance import Provenance
from hybridmpm_lab.harness.rows import Row

pytestmark = pytest.mark.needs("ot", "bench")

SOURCE = Provenance(machine="m", date="2026-01-01", commit="c", command="control")
CASES = cases(["gather"], ["water_2d"], seeds=2)
SETTINGS = ControlSettings(cases=CASES, entrants=[entrant("none"), entrant("filled")])
TIMES = ("plan_ms", "first_frame_ms", "total_ms", "slowdown")

METHODS = """
import numpy as np
from hybridmpm import SimulationError
from hybridmpm.control import Law
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
    return CliRunner().invoke(cli, ["control", *words], prog_name="hybridmpm")


def without_times(rows: list[dict[str, Any]]) -> list[dict[str, Any]]:
    return [{name: value for name, value in row.items() if name not in TIMES} for row in rows]


def test_an_interrupted_benchmark_goes_on_and_ends_with_the_same_rows(tmp_path: Path) -> None:
    file = tmp_path / "runs.jsonl"

    def stop_after_two(_: int, left: list[int] = [2]) -> None:  # noqa: B006 - counts down
        left[0] -= 1
        if left[0] == 0:
            raise KeyboardInterrupt

    runs = Runs(SETTINGS.shared(), file)
    assert count_missing(SETTINGS, runs) == 4
    with pytest.raises(KeyboardInterrupt):
        measure(SETTINGS, runs, SOURCE, stop_after_two)
    with file.open("a") as out:
        out.write('{"run": {"family": "gath')  # the machine went off amid a line
    again = Runs(SETTINGS.shared(), file)
    assert count_missing(SETTINGS, again) == 2
    measure(SETTINGS, again, SOURCE, ignore)
    whole = Runs(SETTINGS.shared())
    measure(SETTINGS, whole, SOURCE, ignore)
    names = ["none", "filled"]
    expected = without_times(whole.rows(CASES, names))
    assert len(expected) == 4
    assert without_times(again.rows(CASES, names)) == expected
    assert without_times(Runs(SETTINGS.shared(), file).rows(CASES, names)) == expected
    assert [look.shape for look in again.looks(CASES, "none")] == [(4, 13)] * 2


def test_runs_of_other_settings_and_damaged_files_are_refused(tmp_path: Path) -> None:
    file = tmp_path / "runs.jsonl"
    Runs(SETTINGS.shared(), file)
    with pytest.raises(ConfigError, match=r"holds runs with cap = 15\.0, not 5: take the same settings"):
        Runs(SETTINGS.shared() | {"cap": 5}, file)
    with pytest.raises(ConfigError, match=r"suite = .*, not other"):
        Runs(SETTINGS.shared() | {"suite": "other"}, file)
    file.write_text("no runs\n")
    with pytest.raises(DataError, match="is no file of runs, or damaged"):
        Runs(SETTINGS.shared(), file)


def test_differences_to_the_constant_force_are_paired() -> None:
    runs = Runs(SETTINGS.shared())
    for case, constant in zip(CASES, (0.4, 0.2), strict=True):
        for name, value in (("constant", constant), ("none", constant - 0.1)):
            blank: dict[str, Any] = dict.fromkeys(MEASURES)
            head = {
                "family": "gather", "scenario": "water_2d", "sketch": "oval", "seed": case.seed,
                "method": name, "failed": None,
            }  # fmt: skip
            runs.add(SOURCE.stamped(head | blank | {"transport": value}), [])
    constant, none = means(runs, CASES, [entrant("constant"), entrant("none")])
    assert none["transport"] == pytest.approx(0.2)
    assert none["transport_se"] == pytest.approx(0.1)
    assert (none["transport_gap"], none["transport_gap_se"]) == (-0.1, pytest.approx(0, abs=1e-12))
    assert (none["wins"], none["count"], none["suite_count"]) == (1.0, 2, 10)
    assert constant["transport_gap"] is None


def test_a_family_of_several_scenarios_has_a_row_for_all_its_sketches() -> None:
    runs, some = Runs(SETTINGS.shared()), cases(["gather"], ["water_2d", "sand_3d"], seeds=1)
    for case, value in zip(some, (0.4, 0.2), strict=True):
        blank: dict[str, Any] = dict.fromkeys(MEASURES)
        head = {
            "family": "gather", "scenario": case.scenario, "sketch": "oval", "seed": case.seed,
            "method": "constant", "failed": None,
        }  # fmt: skip
        runs.add(SOURCE.stamped(head | blank | {"transport": value}), [])
    rows = {row["scenario"]: row for row in means(runs, some, [entrant("constant")])}
    assert set(rows) == {"water_2d", "sand_3d", "all"}
    assert rows["all"]["transport"] == pytest.approx(0.3)
    assert (rows["all"]["count"], rows["all"]["suite_count"]) == (2, 20)


@pytest.mark.usefixtures("mine")
@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("nothing", "method must be one of none, constant, .* or MODULE:ATTRIBUTE for a method of your own"),
        ("absent_module:Method", "the module absent_module cannot be imported .*PYTHONPATH"),
        ("my_control:Absent", "the module my_control has no attribute Absent"),
        ("my_control:number", "must be a method or make one when it is called, got 3"),
        ("my_control:Nameless", "must have a text `name` and a function `plan"),
        ("my_control:Taken", "the name 'analytic' is taken"),
    ],
)
def test_a_method_that_is_none_is_refused_before_anything_runs(name: str, message: str) -> None:
    with pytest.raises(ConfigError, match=message):
        entrant(name)


@pytest.mark.usefixtures("mine")
@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("Raising", "idle is broken, in gather/water_2d/oval/.*: KeyError: 'weights'"),
        ("WrongShape", r"idle is broken, .*\(3, 7\)"),
        ("NoLaw", "idle is broken, .* must return a law"),
    ],
)
def test_a_method_that_breaks_is_told_with_its_case_and_its_error(name: str, message: str) -> None:
    settings = ControlSettings(cases=CASES[:1], entrants=[entrant(f"my_control:{name}")])
    with pytest.raises(ConfigError, match=message):
        measure(settings, Runs(settings.shared()), SOURCE, ignore)


@pytest.mark.usefixtures("mine")
def test_the_command_holds_ones_own_method_against_the_others(tmp_path: Path) -> None:
    pytest.importorskip("matplotlib")
    rows_file, picture = tmp_path / "rows.json", tmp_path / "control.svg"
    words = [
        *("--family", "gather", "--scenario", "water_2d", "--seeds", "1", "--method", "analytic"),
        *("--method", "filled", "--method", "my_control:Idle", "--json", str(rows_file)),
        *("--chart", str(picture), "--sheets", str(tmp_path)),
    ]
    done = invoke(*words)
    assert done.exit_code == 0, done.output
    rows = {row["method"]: row for row in json.loads(rows_file.read_text())}
    assert set(rows) == {"constant", "analytic", "filled", "idle"}
    needed = {
        "scenario", "family", "sketch", "method", "error", "error_se", "transport", "inside", "inside_later",
        "rms_g", "bound_g", "peak_g", "naturalness", "first_frame_ms", "total_ms", "machine", "threads",
        "date", "commit", "command", "solver_version", "ingredients",
    }  # fmt: skip
    assert all(needed <= set(row) for row in rows.values())
    assert all(row["slowdown"] >= 1 for row in rows.values())
    assert rows["analytic"]["inside"] > 0.9 > rows["idle"]["inside"]
    assert rows["filled"]["transport"] < rows["analytic"]["transport"] < rows["constant"]["transport"]
    assert rows["idle"]["naturalness"] is None
    assert all(row["count"] == 1 < row["suite_count"] for row in rows.values())
    assert picture.with_suffix(".png").stat().st_size > 10_000
    assert all((tmp_path / f"control-{name}.png").stat().st_size > 5_000 for name in ("gather", "worst"))


def test_the_worst_sheet_has_the_worst_case_of_each_family() -> None:
    some = cases(["free", "bent"], ["water_2d", "sand_2d"], seeds=2)

    def row(case: Case, value: float) -> Row:
        head = {**vars(case), "sketch": case.kind, "method": "analytic", "failed": None}
        return {**head, "transport": value, "path_error": value}

    rows = [row(case, 0.01 * index) for index, case in enumerate(some)]
    rows[-1]["failed"] = "the solver stopped"
    found = sheets(some, rows)
    assert set(found) == {"free", "bent", "worst"}
    assert {case.family: case for case in found["worst"]} == {
        "free": [case for case in some if case.family == "free"][-1],
        "bent": some[-2],
    }


@pytest.mark.usefixtures("mine")
def test_a_run_that_fails_is_drawn_as_an_empty_room(tmp_path: Path) -> None:
    some = cases(["bent"], ["water_2d"], seeds=1)
    entrants = [entrant("none"), entrant("my_control:Failing")]
    (sheet,) = write_sheets(tmp_path, first_cases(some), entrants, on_progress=ignore)
    with Image.open(sheet) as picture:
        pixels = np.asarray(picture)
    # The last picture of the line is that of the method that failed; the one before it shows fluid.
    last, before = pixels[20:180, -160:-10], pixels[20:180, -334:-184]
    assert len(np.unique(last.reshape(-1, 3), axis=0)) < len(np.unique(before.reshape(-1, 3), axis=0)) / 2


def test_families_without_sketches_in_a_scenario_are_told() -> None:
    done = invoke("--family", "bent", "--scenario", "sand_ramps_2d")
    assert done.exit_code == 2
    assert "have no sketches in sand_ramps_2d: bent and gather leave out ramps" in done.output


def test_the_method_of_the_documentation_can_be_entered(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    page = Path(__file__).parents[4] / "docs" / "results" / "control.md"
    (example,) = re.findall(r"```python\n(.*?)```", page.read_text(encoding="utf-8"), re.DOTALL)
    (tmp_path / "my_springs.py").write_text(example)
    monkeypatch.syspath_prepend(str(tmp_path))
    settings = ControlSettings(cases=CASES[:1], entrants=[entrant("my_springs:Springs")])
    runs = Runs(settings.shared())
    measure(settings, runs, SOURCE, ignore)
    (row,) = runs.rows(CASES[:1], ["springs"])
    assert row["inside"] > 0.5
    assert row["peak_g"] <= 15.001
