"""Fitting of coarse levels: a short search, its file of trials, its table, and refusals."""

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner

from hybridmpm import ConfigError, DataError, MpmSolver, scenarios
from hybridmpm.coarse import coarse_level, coarse_table
from hybridmpm_lab.commands import cli
from hybridmpm_lab.compare.truth import Truth
from hybridmpm_lab.fitting import levels
from hybridmpm_lab.fitting.levels import SCALE, TARGETS, Constants, FitSettings, Target, fit_levels, measure

TARGET = Target("water", 2, "1/64")


@pytest.fixture(autouse=True)
def _few_scenarios(monkeypatch: pytest.MonkeyPatch) -> None:
    """Measure levels on the scenario alone that they are fitted to."""
    monkeypatch.setattr(levels, "scenarios_of", lambda target: [target.scenario])
    monkeypatch.setattr(levels, "_SEEN", 20)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("fit")


def settings(trials: int, scenes: int = 1) -> FitSettings:
    return FitSettings(scenario=("water_2d",), coarse=("1/64",), trials=trials, scenes=scenes, held_out=2)


def fit(folder: Path, trials: int, scenes: int = 1) -> int:
    """Fit one level, and return the number of trials in its file."""
    coarse_table.cache_clear()
    fit_levels(settings(trials, scenes), folder=folder, file=folder / "levels.json", on_step=lambda: None)
    return len((folder / f"{TARGET.key}.jsonl").read_text().splitlines()) - 1


def test_a_search_is_resumed_where_it_stopped(folder: Path) -> None:
    assert fit(folder, 2) == 2
    file = folder / f"{TARGET.key}.jsonl"
    before = file.read_text()
    first = coarse_table(folder / "levels.json").entries
    assert fit(folder, 2) == 2
    coarse_table.cache_clear()
    assert coarse_table(folder / "levels.json").entries == first
    assert fit(folder, 3) == 3
    assert file.read_text().startswith(before)
    (entry,) = first
    assert (entry.seeds, entry.trials) == ((0,), 2)
    (seen,) = entry.held_out
    assert (seen.scenario, seen.first_seed, seen.scenes) == ("water_2d", 1_100_000, 2)
    assert 0.3 < seen.error < 0.9
    assert 0 < seen.transport < 0.3
    scene = scenarios.water_2d(1_100_000)
    solver = MpmSolver(scene, coarse=coarse_level(scene, "1/64", coarse_table(folder / "levels.json")))
    outcome = measure(Truth.of(scene), solver)
    second = scenarios.water_2d(1_100_001)
    other = measure(Truth.of(second), MpmSolver(second, coarse=solver.coarse))
    assert seen.error == pytest.approx((outcome.error + other.error) / 2, rel=0.02)
    assert outcome.simulated == len(solver.coarse_positions)
    assert outcome.redone == 0


def test_a_search_comes_near_to_the_least_objective_and_keeps_better_constants(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    best = replace(Constants.start(TARGET), modulus=0.1, affine_share=0.8)

    def value(_target: Target, constants: Constants, *_: object) -> dict[str, float]:
        far = [np.log(constants.modulus / best.modulus), constants.affine_share - best.affine_share]
        return {"value": float(np.square(far).sum())}

    monkeypatch.setattr(levels, "objective", value)
    monkeypatch.setattr(levels, "measure", lambda _true, _solver: SimpleNamespace(transport=1.0))
    truths: list[Any] = [SimpleNamespace(states=SimpleNamespace(scene=scenarios.water_2d(0)))]
    file = tmp_path / "trials.jsonl"
    found = levels.search(TARGET, truths, 80, file, lambda: None)
    start = value(TARGET, Constants.start(TARGET))["value"]
    assert value(TARGET, found)["value"] < 0.02 * start
    for known, stays in ((best, True), (replace(best, modulus=1.0), False)):
        again = levels.search(TARGET, truths, 80, file, lambda: None, known=known)
        assert (again == known) == stays


@pytest.mark.long
def test_without_trials_the_levels_of_a_table_are_measured_anew(folder: Path, tmp_path: Path) -> None:
    fit(folder, 1)
    file = tmp_path / "levels.json"
    coarse_table.cache_clear()
    with pytest.raises(ConfigError, match="has no coarse level water_2d-1-64 to measure"):
        fit_levels(settings(0), folder=tmp_path, file=file, on_step=lambda: None)
    (known,) = coarse_table(folder / "levels.json").entries
    blank = known.model_copy(update={"held_out": ()})
    table = coarse_table(folder / "levels.json").model_copy(update={"entries": (blank,)})
    file.write_text(table.model_dump_json())
    coarse_table.cache_clear()
    done = fit_levels(settings(0), folder=tmp_path, file=file, on_step=lambda: None)
    assert done.entries == (known,)
    assert not list(tmp_path.glob("*.jsonl"))


@pytest.mark.long
def test_a_file_of_another_search_is_refused(folder: Path) -> None:
    fit(folder, 2)
    with pytest.raises(ConfigError, match="has rows with scenes"):
        fit(folder, 2, scenes=2)
    file = folder / f"{TARGET.key}.jsonl"
    file.write_text(file.read_text().splitlines()[0] + "\n{\n")
    with pytest.raises(DataError, match="damaged"):
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
    level = start.level(target, scene)
    assert (level.name, level.r_p) == (target.name, target.r_p)
    assert 8 <= level.resolution <= scene.resolution


def test_the_command_prints_and_writes_the_levels(tmp_path: Path) -> None:
    arguments = ["--scenario", "water_2d", "--coarse", "1/64", "--trials", "1", "--scenes", "1"]
    run = CliRunner().invoke
    done = run(cli, ["fit", str(tmp_path / "new"), *arguments, "--held-out", "2"])
    assert done.exit_code == 0, done.output
    assert "transport_few" in done.output
    assert "wrote" in done.output
    assert len(coarse_table(tmp_path / "new" / "levels.json").entries) == 1
    refused = run(cli, ["fit", str(tmp_path), "--table", str(tmp_path / "none" / "t.json")])
    assert refused.exit_code == 2
    assert "does not exist" in refused.output
