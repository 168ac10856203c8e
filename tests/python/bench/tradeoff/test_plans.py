"""What a machine takes for each kind of work, and how well plans tell it."""

import dataclasses
import json
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from hybridmpm._native import SOLVER_VERSION
from hybridmpm.bench.calibrate import judge, measure
from hybridmpm.bench.calibrate.errors import calibration_of
from hybridmpm.bench.calibrate.fit import FIELDS, Sample, fitted_line, fitted_work, non_negative_least_squares
from hybridmpm.cli import cli
from hybridmpm.errors import DataError
from hybridmpm.planner import store
from hybridmpm.planner.calibration import MEASURES, Calibration, MachineTimes
from hybridmpm.planner.candidates import candidates

TRUE = dict(zip(FIELDS, (2.0, 0.02, 0.01, 0.5, 0.005, 3.0, 0.03, 10.0, 0.05, 0.01, 0.002), strict=True))


def took(work: dict[str, float], one: Sample) -> float:
    """Return what a sample takes [us]."""
    k, n = one.obstacles, one.particles
    each = work["particle_substep"] + work["obstacle_particle_substep"] * k
    whole = work["substep"] + work["obstacle_substep"] * k + work["cell_substep"] * one.cells
    spent = one.substeps * (whole + each * n)
    shown = work["carry_shown"] + work["carry_obstacle"] * k
    carried = work["carry"] + work["carry_few"] * n + shown * one.shown
    return spent + work["frame"] + work["particle"] * one.particles + one.carry * carried


def sample(particles: int, shown: int, substeps: int, *, carry: bool) -> Sample:
    """Return a sample that takes what `TRUE` says."""
    cells = particles / (2 if particles < 500 else 4)
    one = Sample(
        name="one", particles=particles, shown=shown, substeps=substeps, cells=cells,
        obstacles=3 * (substeps % 2), carry=carry, microseconds=0.0,
    )  # fmt: skip
    return dataclasses.replace(one, microseconds=took(TRUE, one))


def test_the_work_is_found_again() -> None:
    few = [sample(n, n, s, carry=False) for n in (50, 500, 4000) for s in (2, 6, 17)]
    all_shown = [sample(n, shown, s, carry=True) for n in (50, 400) for shown in (1000, 4000) for s in (1, 5)]
    found = fitted_work([*few, *all_shown])
    for one in (*few, *all_shown):
        assert took(found, one) == pytest.approx(one.microseconds, rel=0.02)
    assert fitted_line([100, 300], [20.0, 40.0]) == pytest.approx((10.0, 0.1), rel=1e-6)


def test_no_work_takes_less_than_nothing() -> None:
    x = non_negative_least_squares(np.array([[1.0, 1.0], [1.0, 2.0], [0.0, 0.0]]), np.array([2.0, 1.0, 0.0]))
    assert (x >= 0).all()
    # Of two parts that would have opposite signs one is left: the mean of 2 and 1.
    assert x == pytest.approx((1.5, 0.0))
    assert fitted_line([100, 300], [40.0, 10.0])[1] == 0


@pytest.fixture
def quick(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let a calibration measure little."""
    monkeypatch.setattr(measure, "CLASSES", (("water", 2),))
    monkeypatch.setattr(measure, "_SEEDS", range(2))
    monkeypatch.setattr(measure, "_SPAN", 40)
    monkeypatch.setattr(measure, "_PASSES", 1)
    monkeypatch.setattr(measure, "_OBSTRUCTED", 1)


@pytest.mark.usefixtures("quick")
def test_times_of_this_machine_are_written_where_plans_look(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    file = tmp_path / "cache" / "hybridmpm" / "calibration.json"
    monkeypatch.delenv("HYBRIDMPM_CALIBRATION", raising=False)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    assert store.user_file() == file
    result = CliRunner().invoke(cli, ["bench", "calibrate"])
    assert result.exit_code == 0, result.output
    assert "water in 2D" in result.output
    times = MachineTimes.model_validate_json(file.read_text())
    assert times.solver_version == SOLVER_VERSION
    assert [(one.material, one.dim) for one in times.materials] == [("water", 2)]
    assert times.materials[0].particle_substep > 0
    assert {one.model for one in times.networks} == {"fluids_2d"}
    ratios = {one.name: one.ratio for one in times.ratios}
    assert set(ratios) == {"mpm sleeping", "carried fitted 1/16 sleeping", "hybrid fluids_2d"}
    assert all(ratio > 0 for ratio in ratios.values())
    with pytest.raises(DataError, match="incomplete: it lacks sand in 2D, water in 3D, sand in 3D"):
        store.read_times(file)


def test_a_calibration_of_rows(tmp_path: Path) -> None:
    fields = dict.fromkeys(MEASURES.values(), 0.5) | {f"{field}_se": 0.1 for field in MEASURES.values()}
    head = {"scenario": "water_2d", "scenes": 3, "commit": "abc"}
    rows = [
        head | fields | {"method": "mpm", "label": "1/8"},
        head | fields | {"method": "jitter", "label": None, "error_se": None},
        head | fields | {"method": "mpm", "label": "truth"},
        head | fields | {"method": "hybrid", "label": "fluids_2d r_c 0.8"},
        head | fields | {"method": "carried", "label": "1/8", "error": None},
    ]
    made = calibration_of(rows, store.shipped().times)
    # Plans take neither the truth itself, nor what nobody would choose, nor what failed.
    assert [one.name for one in made.errors] == ["mpm 1/8", "jitter"]
    assert made.errors[0].means["grid_rmse"] == 0.5
    assert "grid_rmse" not in made.errors[1].standard_errors
    assert Calibration.model_validate_json(made.model_dump_json()) == made
    file = tmp_path / "rows.json"
    file.write_text("[]")
    out = str(tmp_path / "out.json")
    result = CliRunner().invoke(cli, ["bench", "calibrate", "--errors", str(file), "--out", out])
    assert result.exit_code == 2
    assert "no file of rows" in result.output
    result = CliRunner().invoke(cli, ["bench", "calibrate", "--errors", str(file)])
    assert "needs --out" in result.output


@pytest.mark.needs("ot", "metrics")
def test_plans_are_held_against_what_is_measured(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("HYBRIDMPM_CALIBRATION", str(tmp_path / "none.json"))
    names = ("mpm 1", "mpm 1/16", "carried fitted 1/16")
    few = {name: candidates("water_2d")[name] for name in names}
    monkeypatch.setattr(judge, "candidates", lambda _: few)
    runs, file = tmp_path / "runs.jsonl", tmp_path / "rows.json"
    options = ["--scenario", "water_2d", "--scenes", "1", "--span", "40", "--passes", "1"]
    command = ["bench", "plans", *options, "--runs", str(runs), "--json", str(file)]
    assert CliRunner().invoke(cli, command).exit_code == 0
    rows = json.loads(file.read_text())
    mine = {row["name"]: row for row in rows if row["part"] == "run"}
    assert set(mine) == set(names)
    for row in mine.values():
        assert row["seed"] == judge.FIRST
        assert row["ms_per_frame"] > 0
        assert row["expected_ms"] > 0
    means = [row for row in rows if row["part"] == "mean"]
    assert [row["scenario"] for row in means] == ["water_2d", "all"]
    # Errors of these three are far apart, on any machine.
    assert [(row["pairs"], row["pairs_right"]) for row in means] == [(3, 1.0), (3, 1.0)]
    kept = runs.read_text()
    assert CliRunner().invoke(cli, command).exit_code == 0
    assert runs.read_text() == kept
