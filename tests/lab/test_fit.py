"""Fitting of levels: a short search, its journal, its table, and what is refused."""

import json
import shutil
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner

from hybridmpm import ConfigError, DataError, MpmSolver, scenarios
from hybridmpm.cli import cli
from hybridmpm.coarse import coarse_level, coarse_table
from hybridmpm_lab.fitting import judge, search
from hybridmpm_lab.fitting.cases import Case
from hybridmpm_lab.fitting.cma_es import minimise
from hybridmpm_lab.fitting.levels import FitSettings, fit_levels
from hybridmpm_lab.fitting.outcome import measure
from hybridmpm_lab.fitting.space import SCALE, TARGETS, Constants, Target

TARGET = Target("water", 2, "1/64")


@pytest.fixture(autouse=True)
def _few_scenarios(monkeypatch: pytest.MonkeyPatch) -> None:
    """Judge coarse levels on the scenario alone that they are fitted to."""
    monkeypatch.setattr("hybridmpm_lab.fitting.levels.scenarios_of", lambda target: [target.scenario])
    monkeypatch.setattr(judge, "_SEEN", 20)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("fit")


def fit(folder: Path, trials: int, scenes: int = 1) -> int:
    """Fit one level, and return how many trials the journal holds."""
    settings = FitSettings(trials=trials, scenes=scenes, held_out=2)
    file = folder / "levels.json"
    coarse_table.cache_clear()
    fit_levels([TARGET], settings, folder=folder, file=file, on_step=lambda: None)
    return len((folder / f"{TARGET.key}.jsonl").read_text().splitlines()) - 1


def test_a_search_goes_on_where_it_stopped(folder: Path) -> None:
    assert fit(folder, 2) == 2
    journal = folder / f"{TARGET.key}.jsonl"
    before = journal.read_text()
    first = coarse_table(folder / "levels.json").entries
    assert fit(folder, 2) == 2
    coarse_table.cache_clear()
    assert coarse_table(folder / "levels.json").entries == first
    assert fit(folder, 3) == 3
    assert journal.read_text().startswith(before)
    (entry,) = first
    assert (entry.seeds, entry.trials) == ((0,), 2)
    (seen,) = entry.held_out
    assert (seen.scenario, seen.first_seed, seen.scenes) == ("water_2d", 1_100_000, 2)
    assert 0.3 < seen.error < 0.9
    assert 0 < seen.transport < 0.3
    scene = scenarios.water_2d(1_100_000)
    solver = MpmSolver(scene, coarse=coarse_level(scene, "1/64", coarse_table(folder / "levels.json")))
    case = Case.of("water_2d", 1_100_000, folder / "truths")
    outcome = measure(case, solver)
    other = measure(
        Case.of("water_2d", 1_100_001, folder / "truths"),
        MpmSolver(scenarios.water_2d(1_100_001), coarse=solver.coarse),
    )
    # The card is what this measures.
    assert seen.error == pytest.approx((outcome.error + other.error) / 2, rel=0.02)
    assert outcome.simulated == len(solver.coarse_positions)
    assert outcome.redone == 0


def test_constants_that_no_trial_beats_stay(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def value(_target: Target, constants: Constants, *_: object) -> tuple[float, dict[str, float]]:
        return abs(constants.modulus - 0.1), {}

    monkeypatch.setattr(search, "_value", value)
    monkeypatch.setattr(search, "_run", lambda _solver, _case: SimpleNamespace(transport=1.0))
    cases: list[Any] = [SimpleNamespace(scene=scenarios.water_2d(0))]
    best = replace(Constants.start(TARGET), modulus=0.1)
    for known, stays in ((best, True), (replace(best, modulus=1.0), False)):
        found = search.search(TARGET, cases, 2, tmp_path / "trials.jsonl", lambda: None, known=known)
        assert (found.constants == known) == stays
        assert found.trials == 2


def test_without_trials_the_levels_of_a_table_are_judged_anew(folder: Path, tmp_path: Path) -> None:
    fit(folder, 1)
    shutil.copytree(folder / "truths", tmp_path / "truths")
    file = tmp_path / "levels.json"
    coarse_table.cache_clear()
    settings = FitSettings(trials=0, scenes=1, held_out=2)
    with pytest.raises(ConfigError, match="has no coarse level water_2d-1-64 to judge"):
        fit_levels([TARGET], settings, folder=tmp_path, file=file, on_step=lambda: None)
    (known,) = coarse_table(folder / "levels.json").entries
    blank = known.model_copy(update={"held_out": ()})
    table = coarse_table(folder / "levels.json").model_copy(update={"entries": (blank,)})
    file.write_text(table.model_dump_json())
    coarse_table.cache_clear()
    done = fit_levels([TARGET], settings, folder=tmp_path, file=file, on_step=lambda: None)
    assert done.entries == (known,)
    assert not list(tmp_path.glob("*.jsonl"))


def test_a_journal_of_another_search_is_refused(folder: Path) -> None:
    fit(folder, 2)
    with pytest.raises(DataError, match="on other scenes or of another solver"):
        fit(folder, 2, scenes=2)
    journal = folder / f"{TARGET.key}.jsonl"
    head, first, *others = journal.read_text().splitlines()
    moved = json.loads(first) | {"offset": [0.5] * len(SCALE)}
    journal.write_text("\n".join([head, json.dumps(moved), *others]) + "\n")
    with pytest.raises(DataError, match="is of another search"):
        fit(folder, 2)
    journal.write_text(head + "\n{\n")
    with pytest.raises(DataError, match="is damaged"):
        fit(folder, 2)


@pytest.mark.parametrize("target", TARGETS, ids=lambda target: target.key)
def test_searches_begin_and_stay_within_bounds(target: Target) -> None:
    start = Constants.start(target)
    assert Constants.at(target, 0 * SCALE) == start
    for far in (-100 * SCALE, 100 * SCALE):
        at = Constants.at(target, far)
        assert 1 <= at.particles_per_cell <= 6
        assert 0 < at.modulus <= 1
        assert 0 < at.cfl <= 1
        assert 0 <= at.affine_share <= 1
        assert 0 < at.relaxation <= 8
    scene = scenarios.get(target.scenario, 0)
    level = start.coarse(target, scene)
    assert (level.name, level.r_p) == (target.name, target.r_p)
    assert 8 <= level.resolution <= scene.resolution


def test_the_command_says_what_it_found(folder: Path, tmp_path: Path) -> None:
    shutil.copytree(folder / "truths", tmp_path / "new" / "truths")
    arguments = ["--scenario", "water_2d", "--coarse", "1/64", "--trials", "1", "--scenes", "1"]
    run = CliRunner().invoke
    done = run(cli, ["fit", "coarse levels", str(tmp_path / "new"), *arguments, "--held-out", "2"])
    assert done.exit_code == 0, done.output
    assert "transport_few" in done.output
    assert "wrote" in done.output
    assert len(coarse_table(tmp_path / "new" / "levels.json").entries) == 1
    refused = run(cli, ["fit", "coarse levels", str(tmp_path), "--table", str(tmp_path / "none" / "t.json")])
    assert refused.exit_code == 2
    assert "does not exist" in refused.output


def test_cma_es_finds_a_minimum_and_repeats_by_seed() -> None:
    def valley(x: Any) -> float:
        return float((x[0] - 0.3) ** 2 + 100 * (x[1] + 0.2 - x[0] ** 2) ** 2)

    best = minimise(valley, np.full(2, 0.3), go_on=lambda trials: trials < 600, seed=1)
    assert best.value < 1e-6
    again = minimise(valley, np.full(2, 0.3), go_on=lambda trials: trials < 600, seed=1)
    assert np.array_equal(best.x, again.x)
    none = minimise(lambda x: float(x @ x), np.ones(3), go_on=lambda _: False, seed=1)
    assert (none.trials, none.value) == (1, 0.0)
