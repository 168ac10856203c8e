"""The published results: their rows, and whether they are still of what ships."""

from pathlib import Path

import pytest
from click.testing import CliRunner

from hybridmpm import SOLVER_VERSION
from hybridmpm.planner import store
from hybridmpm_lab.commands import cli
from hybridmpm_lab.compare import plan_errors
from hybridmpm_lab.harness import provenance, results
from hybridmpm_lab.harness.rows import read_rows, write_rows

ORIGIN = {"machine", "date", "commit", "command", "solver_version", "ingredients"}


def test_every_published_table_has_a_command() -> None:
    assert {file.stem for file in results.FOLDER.glob("*.json")} == {one.name for one in results.RESULTS}
    order = [one.name for one in results.RESULTS]
    for place, one in enumerate(results.RESULTS):
        assert one.command.split()[0] in cli.commands
        assert set(one.needs) <= set(order[:place])


@pytest.mark.parametrize("one", results.RESULTS, ids=lambda one: str(one.name))
def test_published_rows_are_of_what_ships(one: results.Result) -> None:
    for row in one.rows():
        assert set(row) >= ORIGIN
        assert row["command"].startswith("python -m hybridmpm_lab ")
    # `python -m hybridmpm_lab all` makes stale results anew; a listed one that is fresh leaves the list.
    assert bool(one.reasons()) == (one.name in results.STALE), one.reasons()


@pytest.mark.parametrize(
    "one",
    [
        # A chart of eight panels takes seconds.
        pytest.param(
            one, id=one.name, marks=() if one.name in ("mpm", "hybrid", "service") else pytest.mark.long
        )
        for one in results.RESULTS
    ],
)
def test_published_rows_are_drawn_again(one: results.Result, tmp_path: Path) -> None:
    picture = tmp_path / "chart.svg"
    words = [one.command.split()[0], "--rows", str(one.file)]
    done = CliRunner().invoke(cli, [*words, *(["--chart", str(picture)] if one.has_chart else [])])
    assert done.exit_code == 0, done.output
    assert f", commit {one.rows()[0]['commit']}" in done.stdout
    assert not one.has_chart or "</svg>" in picture.read_text()


def test_plans_know_the_published_errors() -> None:
    shipped = store.shipped()
    rows = read_rows(results.FOLDER / "tradeoff.json")
    assert plan_errors.calibration_of(rows, shipped.times) == shipped


def test_rows_are_written_without_what_is_none_and_read_as_they_were(tmp_path: Path) -> None:
    file = tmp_path / "rows.json"
    rows = [{"a": None, "b": 1, "c": None}, {"a": None, "b": None, "c": 0.5}, {"a": 0, "b": False, "c": ""}]
    write_rows(file, rows)
    assert file.read_text().count("null") == 2
    assert [list(row.items()) for row in read_rows(file)] == [list(row.items()) for row in rows]
    # A field that the first row lacks is added to all.
    write_rows(file, [{"a": 1}, {"a": None, "b": 2}])
    assert read_rows(file) == [{"a": 1, "b": None}, {"a": None, "b": 2}]


def test_rows_of_other_ingredients_are_outdated() -> None:
    origin = provenance.provenance("python -m hybridmpm_lab coarse").using("levels", "fluids_2d")
    row = origin.stamped({"error": 0.5})
    assert row["solver_version"] == SOLVER_VERSION
    assert [word.partition("=")[0] for word in row["ingredients"].split()] == ["fluids_2d", "levels"]
    assert provenance.outdated(row) is None
    assert provenance.outdated(row | {"solver_version": 1}) == f"solver version 1, now {SOLVER_VERSION}"
    now = provenance.shipped()["levels"]
    assert provenance.outdated(row | {"ingredients": "levels=0123"}) == f"levels 0123, now {now}"
    assert provenance.outdated(row | {"ingredients": "old=0123"}) == "old 0123, now retired"
    assert provenance.outdated({"error": 0.5}) == f"solver version None, now {SOLVER_VERSION}"
    assert origin.using().ingredients is None


def test_stale_results_are_listed_and_made_in_order(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    row = provenance.provenance("python -m hybridmpm_lab coarse").stamped({"error": 0.5})
    for name, version in (
        ("coarse", 1),
        ("models", SOLVER_VERSION),
        ("hybrid", SOLVER_VERSION),
        ("mpm-gpu", 1),
    ):
        write_rows(tmp_path / f"{name}.json", [row | {"solver_version": version}])
    listed = (
        results.Result(name="coarse", command="coarse --scenes 2", minutes=3, has_runs=True),
        results.Result(
            name="models",
            command="models",
            minutes=4,
            needs=("coarse",),
            has_chart=False,
            after="plan-errors a b",
        ),
        results.Result(name="hybrid", command="hybrid", minutes=5),
        results.Result(name="mpm-gpu", command="speed", minutes=2, needs_gpu=True),
    )
    monkeypatch.setattr(results, "FOLDER", tmp_path)
    monkeypatch.setattr(results, "RESULTS", listed)
    done = CliRunner().invoke(cli, ["all", "--stale"])
    assert done.exit_code == 0, done.output
    head, first, second, third, last = done.stdout.splitlines()
    assert head.split() == ["result", "minutes", "needs", "command", "reason"]
    assert "solver version 1" in first
    assert "needs coarse" in second
    assert third.startswith("mpm-gpu")
    assert last == "3 of 4 results are stale; making them takes 9 minutes"

    made: list[list[str]] = []

    class Done:
        returncode = 0

    monkeypatch.setattr("subprocess.run", lambda words, **_: made.append(words[3:]) or Done())
    monkeypatch.setattr(results, "has_gpu", lambda: False)
    done = CliRunner().invoke(cli, ["all", "--runs", str(tmp_path)])
    assert (done.exit_code, "mpm-gpu needs a GPU of CUDA, and stays as it is" in done.stdout) == (0, True)
    assert made == [
        ["coarse", "--scenes", "2", "--json", str(tmp_path / "coarse.json"),
         "--chart", str(tmp_path / "coarse.svg"), "--runs", str(tmp_path / "coarse.jsonl")],
        ["models", "--json", str(tmp_path / "models.json")],
        ["plan-errors", "a", "b"],
    ]  # fmt: skip
    monkeypatch.setattr(Done, "returncode", 1)
    failed = CliRunner().invoke(cli, ["all", "--runs", str(tmp_path)])
    assert failed.exit_code == 2
    assert "coarse could not be made" in failed.stderr
