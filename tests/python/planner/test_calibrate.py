"""`hybridmpm calibrate`: the time of each kind of work on a machine."""

import dataclasses
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from hybridmpm._native import SOLVER_VERSION
from hybridmpm.cli import cli
from hybridmpm.errors import DataError
from hybridmpm.planner import store
from hybridmpm.planner.calibrating import measure
from hybridmpm.planner.calibrating.fit import (
    FIELDS,
    Sample,
    fitted_line,
    fitted_work,
    non_negative_least_squares,
)
from hybridmpm.planner.calibration import MachineTimes

TRUE = dict(zip(FIELDS, (2.0, 0.02, 0.01, 0.5, 0.005, 3.0, 0.03, 10.0, 0.05, 0.01, 0.002), strict=True))


def took(work: dict[str, float], one: Sample) -> float:
    """Return what a sample takes [us]."""
    k, n = one.obstacles, one.particles
    each = work["particle_substep"] + work["obstacle_particle_substep"] * k
    whole = work["substep"] + work["obstacle_substep"] * k + work["cell_substep"] * one.cells
    spent = one.substeps * (whole + each * n)
    shown = work["upsample_shown"] + work["upsample_obstacle"] * k
    carried = work["upsample"] + work["upsample_coarse"] * n + shown * one.shown
    return spent + work["frame"] + work["particle"] * one.particles + one.show_all * carried


def sample(particles: int, shown: int, substeps: int, *, show_all: bool) -> Sample:
    """Return a sample that takes what `TRUE` says."""
    cells = particles / (2 if particles < 500 else 4)
    one = Sample(
        name="one", particles=particles, shown=shown, substeps=substeps, cells=cells,
        obstacles=3 * (substeps % 2), show_all=show_all, microseconds=0.0,
    )  # fmt: skip
    return dataclasses.replace(one, microseconds=took(TRUE, one))


def test_the_work_is_found_again() -> None:
    few = [sample(n, n, s, show_all=False) for n in (50, 500, 4000) for s in (2, 6, 17)]
    all_shown = [
        sample(n, shown, s, show_all=True) for n in (50, 400) for shown in (1000, 4000) for s in (1, 5)
    ]
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
    result = CliRunner().invoke(cli, ["calibrate"])
    assert result.exit_code == 0, result.output
    assert "water in 2D" in result.output
    times = MachineTimes.model_validate_json(file.read_text())
    assert times.solver_version == SOLVER_VERSION
    assert [(one.material, one.dim) for one in times.materials] == [("water", 2)]
    assert times.materials[0].particle_substep > 0
    assert {one.model for one in times.networks} == {"fluids_2d"}
    ratios = {one.name: one.ratio for one in times.ratios}
    assert set(ratios) == {"hybrid fluids_2d"}
    assert all(ratio > 0 for ratio in ratios.values())
    with pytest.raises(DataError, match="incomplete: it lacks sand in 2D, water in 3D, sand in 3D"):
        store.read_times(file)
