"""Plans: the method for an error or a time, refusals, and calibrations that are checked."""

import json
import math
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from hybridmpm import (
    Ball,
    Box,
    CalibrationWarning,
    CoarseWarning,
    MpmSolver,
    RectangularEmitter,
    Scene,
    plan,
    scenarios,
)
from hybridmpm._native import SOLVER_VERSION
from hybridmpm.cli import cli
from hybridmpm.errors import ConfigError, DataError, SceneError
from hybridmpm.planner import planning, store
from hybridmpm.planner.calibration import MEASURES, MachineTimes
from hybridmpm.planner.candidates import candidates, softened
from hybridmpm.planner.cost import milliseconds, work

SEED = 2_000_000


@pytest.fixture(autouse=True)
def _no_times_of_the_user(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("HYBRIDMPM_CALIBRATION", str(tmp_path / "none.json"))


def test_the_cheapest_within_an_error_and_the_most_accurate_within_a_time() -> None:
    scene = scenarios.water_2d(SEED)
    found = plan(scene, max_error=0.5)
    assert found.feasible
    assert found.error < found.error_bound <= 0.5
    # Asked for its own time, or its own error, the same coarse level comes out.
    same = plan(scene, budget_ms=found.ms_per_frame)
    assert same.ms_per_frame <= found.ms_per_frame
    assert same.error <= found.error
    assert plan(scene, max_error=same.error_bound).ms_per_frame <= same.ms_per_frame
    assert found.runner_up is not None
    assert found.runner_up.ms_per_frame >= found.ms_per_frame
    assert found.name in found.reason
    assert found.runner_up.name in found.reason


def test_errors_of_one_scene_bound_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    known, origin = store.present(None)
    alone = known.model_copy(
        update={"errors": tuple(one.model_copy(update={"standard_errors": {}}) for one in known.errors)}
    )
    monkeypatch.setattr(planning, "present", lambda _: (alone, origin))
    found = plan(scenarios.water_2d(SEED), max_error=5.0)
    assert found.error_bound is None
    assert not found.feasible
    assert "no method keeps an error of 5" in found.reason
    assert "without a bound, for one water_2d scene was measured" in found.reason
    quick = plan(scenarios.water_2d(SEED), budget_ms=0.2)
    assert quick.feasible
    assert "(no bound)" in quick.reason
    assert json.loads(json.dumps(quick.to_dict()))["error_bound"] is None


@pytest.mark.parametrize("measure", MEASURES)
def test_more_time_never_errs_more_and_a_larger_error_never_takes_longer(measure: str) -> None:
    scene = scenarios.sand_3d(SEED)
    by_time = [plan(scene, budget_ms=ms, measure=measure) for ms in np.geomspace(0.01, 20, 9).tolist()]
    errors = [one.error for one in by_time if one.feasible]
    assert errors == sorted(errors, reverse=True)
    limits = np.geomspace(min(errors) / 2, 4 * max(errors), 9).tolist()
    by_error = [plan(scene, max_error=limit, measure=measure) for limit in limits]
    times = [one.ms_per_frame for one in by_error if one.feasible]
    assert times == sorted(times, reverse=True)
    assert not by_time[0].feasible
    assert not by_error[0].feasible
    assert all(one.feasible for one in (by_time[-1], by_error[-1]))


def test_what_cannot_be_had_gets_the_nearest_and_what_it_takes() -> None:
    scene = scenarios.water_2d(SEED)
    best, quickest = plan(scene, max_error=1e-6), plan(scene, budget_ms=1e-6)
    assert (best.name, best.feasible, quickest.feasible) == ("mpm 1", False, False)
    assert "no method keeps an error of 1e-06" in best.reason
    assert 'substeps="reference"' in best.reason
    assert any("with different jitter" in note for note in best.notes)
    assert f"{quickest.ms_per_frame:.3g} ms" in quickest.reason
    assert quickest.ms_per_frame < best.ms_per_frame


@pytest.mark.parametrize(
    ("demand", "said"),
    [
        ({}, "got neither"),
        ({"max_error": 0.1, "budget_ms": 1.0}, "got both"),
        ({"max_error": -0.1}, "max_error must be a finite number above 0, got -0.1"),
        ({"budget_ms": math.nan}, "budget_ms must be a finite number above 0, got nan"),
        ({"budget_ms": math.inf}, "above 0, got inf"),
        ({"budget_ms": True}, "above 0, got True"),
        ({"max_error": "0.1"}, "above 0, got '0.1'"),
        ({"max_error": 0.1, "measure": "grid_rms"}, "did you mean 'grid_rmse'"),
    ],
)
def test_a_demand_is_one_positive_number(demand: dict[str, object], said: str) -> None:
    with pytest.raises(ConfigError, match=said):
        plan(scenarios.water_2d(SEED), **demand)  # type: ignore[arg-type]


def test_a_plan_is_for_a_scene() -> None:
    with pytest.raises(SceneError):
        plan("water_2d", budget_ms=1.0)  # type: ignore[arg-type]


def test_a_plan_makes_its_simulator() -> None:
    scene = scenarios.water_ramps_2d(SEED)
    found = plan(scene, max_error=1.0)
    # Its ramps are thinner than a cell of the level: the plan tells of it, and so does the simulator.
    with pytest.warns(CoarseWarning) as told:
        simulator = found.make()
    texts = {str(one.message) for one in told}
    assert texts <= set(found.notes)
    assert any("thick" in text for text in texts)
    simulator.advance(2)
    assert simulator.scene == scene
    assert simulator.r_p == found.r_p
    assert len(simulator.coarse_positions) == pytest.approx(found.particles, rel=0.05)
    assert found.show_all == (len(simulator.coarse_positions) < simulator.particle_count)
    plain = json.loads(json.dumps(found.to_dict()))
    assert plain["name"] == found.name
    assert "scene" not in plain


@pytest.mark.parametrize("name", ["mpm 1", "mpm 1/16", "mpm softer 1/4", "coarse unfitted 1/8", "coarse 1/8"])
@pytest.mark.parametrize("scenario", ["sand_2d", "water_3d"])
def test_the_work_told_is_the_work_done(name: str, scenario: str) -> None:
    scene = scenarios.get(scenario, SEED)
    candidate = candidates(scenario)[name]
    told = work(candidate, scene, speed=1.0)
    simulator = candidate.make(scene)
    simulator.advance(1)
    assert isinstance(simulator, MpmSolver)
    assert told.resolution == simulator.resolution
    assert told.particles == pytest.approx(len(simulator.coarse_positions), rel=0.1)
    assert told.shown == pytest.approx(simulator.particle_count, rel=0.1)
    assert simulator.last_frame is not None
    # Before the splash no particle is as fast as later, so there may be fewer.
    assert 0.4 * told.substeps - 1 <= simulator.last_frame.substeps <= told.substeps + 1


def test_time_grows_with_the_work() -> None:
    small = Scene(dim=2, bodies=(Box(material="water", lower=(0.2, 0.2), upper=(0.3, 0.3)),))
    large = Scene(dim=2, bodies=(Box(material="water", lower=(0.2, 0.2), upper=(0.6, 0.6)),))
    known = store.shipped()
    for name, candidate in candidates("water_2d").items():
        few, many = (milliseconds(candidate, scene, known) for scene in (small, large))
        assert few is not None, name
        assert many is not None, name
        assert 0 < few < many
    sizes = ("mpm 1", "mpm 1/1.75", "mpm 1/4", "mpm 1/64")
    by_size = [milliseconds(candidates("water_2d")[name], large, known) or 0.0 for name in sizes]
    assert by_size == sorted(by_size, reverse=True)


def test_softer_matter_is_softer_everywhere() -> None:
    inlet = RectangularEmitter(material="water", lower=(0.15, 0.7), upper=(0.15, 0.8), velocity=(1.0, 0.0))
    ball = Ball(material="water", center=(0.5, 0.5), radius=0.1)
    scene = Scene(dim=2, bodies=(ball,), emitters=(inlet,))
    soft = softened(scene, 0.25)
    assert softened(scene, 1.0) is scene
    assert len(soft.materials) == 1
    stiff = [one.materials[0].to_native(one.potential_drop).sound_speed for one in (scene, soft)]
    assert stiff[1] == pytest.approx(stiff[0] / 2, rel=1e-3)


def test_notes_tell_where_a_scene_is_another() -> None:
    jelly = Scene(dim=3, resolution=32, bodies=(Box(material="elastic", lower=(0.3,) * 3, upper=(0.5,) * 3),))
    notes = " ".join(plan(jelly, budget_ms=1.0).notes)
    assert "nothing was calibrated for elastic" in notes
    assert "64 cells per metre, the scene has 32" in notes
    water = Box(material={"kind": "water", "max_compression": 1e-4}, lower=(0.2, 0.2), upper=(0.4, 0.4))  # type: ignore[arg-type]
    assert "times as fast" in " ".join(plan(Scene(dim=2, bodies=(water,)), budget_ms=1.0).notes)


def times(**changes: object) -> str:
    return store.shipped().times.model_copy(update=changes).model_dump_json()


def test_times_of_the_user_are_taken(tmp_path: Path) -> None:
    scene = scenarios.water_2d(SEED)
    file = tmp_path / "mine.json"
    slow = [
        one.model_copy(update={"particle_substep": 100 * one.particle_substep})
        for one in store.shipped().times.materials
    ]
    file.write_text(times(machine=store.cpu_model(), materials=tuple(slow)))
    slower = plan(scene, max_error=0.5, calibration=file)
    assert slower.ms_per_frame > 2 * plan(scene, max_error=0.5).ms_per_frame
    assert str(file) in slower.notes[0]


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("{", "missing or damaged"),
        (None, "missing or damaged"),
        ('{"version": 1}', "missing or damaged"),
        (times(machine="another"), "was made for machine another, this machine has"),
        (times(machine=store.cpu_model(), version=0), "was made for version 0, this machine has"),
        (times(machine=store.cpu_model(), solver_version=SOLVER_VERSION - 1), "solver version"),
    ],
)
def test_a_calibration_that_does_not_fit(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, text: str | None, said: str
) -> None:
    scene, file = scenarios.water_2d(SEED), tmp_path / "times.json"
    if text is not None:
        file.write_text(text)
    with pytest.raises(DataError, match=said) as refused:
        plan(scene, budget_ms=1.0, calibration=file)
    assert "hybridmpm calibrate --out" in str(refused.value)
    if text is not None:
        monkeypatch.setenv("HYBRIDMPM_CALIBRATION", str(file))
        with pytest.warns(CalibrationWarning, match=said):
            found = plan(scene, budget_ms=1.0)
        assert "times of the library" in found.notes[0]


def test_the_command() -> None:
    result = CliRunner().invoke(cli, ["plan", "water_2d", "--budget-ms", "0.2"])
    assert result.exit_code == 0, result.output
    assert "most accurate within 0.2 ms" in result.output
    result = CliRunner().invoke(cli, ["plan", "docs/examples/wave-maker.yaml", "--max-error", "1", "--json"])
    assert result.exit_code == 0, result.output
    assert json.loads(result.output)["feasible"] is True
    assert CliRunner().invoke(cli, ["plan", "nowhere", "--max-error", "1"]).exit_code == 2


def test_simulate_keeps_a_budget_and_tells_its_level() -> None:
    command = ["simulate", "water_2d", "--frames", "4", "--budget-ms", "0.2"]
    result = CliRunner().invoke(cli, command)
    assert result.exit_code == 0, result.output
    assert f"; method {plan(scenarios.water_2d(0), budget_ms=0.2).name}" in result.output
    for more, said in ((["--coarse", "1/16"], "drop '--coarse'"), (["--save", "a.hmpm"], "--out")):
        result = CliRunner().invoke(cli, [*command, *more])
        assert result.exit_code == 2
        assert said in result.output


def test_the_shipped_calibration_is_of_this_solver() -> None:
    known = store.shipped()
    assert known.solver_version == known.times.solver_version == SOLVER_VERSION
    assert isinstance(known.times, MachineTimes)
    for scenario in scenarios.NAMES:
        there = {one.name for one in known.errors if one.scenario == scenario}
        assert there >= set(candidates(scenario)) | {"jitter"}
