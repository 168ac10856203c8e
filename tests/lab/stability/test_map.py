"""The stability map: what its measures notice, a few of its cells, and what the command writes."""

import dataclasses
import json
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from hybridmpm import MpmSolver
from hybridmpm.scene import BoxObstacle, Motion
from hybridmpm_lab.commands import cli
from hybridmpm_lab.stability import map as stability_map
from hybridmpm_lab.stability.map import STRESSES, Cell, trial_of
from hybridmpm_lab.stability.outcome import Look, Outcome, Run, judged, look
from hybridmpm_lab.stability.stresses.trial import METHODS, Method, block, scene
from hybridmpm_lab.stability.trials import attempt, truth

CALM = Look(finite=True, outside=0, energy=1.0, work=0.0, crowding=1.0, volume=0.04)


def _run(**changed: object) -> Run:
    return Run(looks=(CALM, *[dataclasses.replace(CALM, **changed)] * 8), mass=1.0)


@pytest.mark.parametrize(
    ("changed", "outcome", "fault"),
    [
        ({}, "survived", None),
        ({"energy": 1.04}, "survived", None),
        ({"energy": 1.06}, "degraded", "energy"),
        ({"energy": 1.9, "work": 1.0}, "survived", None),
        ({"energy": 2.2, "work": 1.0}, "degraded", "energy"),
        ({"crowding": 1.09}, "survived", None),
        ({"crowding": 1.2}, "degraded", "density"),
        ({"volume": 0.0415}, "survived", None),
        ({"volume": 0.0425}, "degraded", "volume"),
        ({"volume": 0.0375}, "degraded", "volume"),
        ({"outside": 1}, "failed", "outside"),
        ({"finite": False}, "failed", "not finite"),
    ],
)
def test_each_measure_decides_at_its_bound(
    changed: dict[str, object], outcome: Outcome, fault: str | None
) -> None:
    faults = [] if fault is None else [fault]
    assert judged(_run(**changed), _run(), carries=False) == (outcome, faults)


def test_what_is_carried_may_be_denser_and_nothing_may_pass_a_solid() -> None:
    assert judged(_run(crowding=1.2), _run(), carries=True) == ("survived", [])
    through = dataclasses.replace(_run(), passed=0.01)
    assert judged(through, None, carries=False) == ("degraded", ["passed a solid"])
    other = dataclasses.replace(_run(), same=False)
    assert judged(other, None, carries=False)[0] == "degraded"


@pytest.mark.parametrize("stretch", [0.93, 1.0, 1.07])
def test_volume_follows_matter_that_grows_and_shrinks(stretch: float) -> None:
    solver = MpmSolver(scene(2, block("water", 2, height=0.3)))
    x = solver.positions.copy()
    start = look(solver, 0.0)
    middle = x.mean(axis=0)
    solver.prescribe(middle + (x - middle) * np.array([1, stretch], np.float32), np.zeros_like(x), 0)
    now = look(solver, 0.0)
    assert now.volume / start.volume == pytest.approx(stretch, abs=0.02)
    assert now.crowding / start.crowding == pytest.approx(1 / stretch, abs=0.03)


def test_a_moving_obstacle_is_paid_for() -> None:
    paddle = BoxObstacle(
        lower=(0.1, 0.1), upper=(0.14, 0.9), motion=Motion(velocity=(0.4, 0.0)), contact="separating"
    )
    pool = block("water", 2, side=0.2, height=0.0).model_copy(
        update={"lower": (0.15, 0.1), "upper": (0.9, 0.2)}
    )
    one, two = (MpmSolver(scene(2, pool, obstacles=(paddle,)), threads=n) for n in (1, 2))
    start = look(one, 0.0).energy
    work = 0.0
    for _ in range(120):
        one.advance(1)
        two.advance(1)
        assert one.last_frame is not None
        assert two.last_frame is not None
        assert one.last_frame.obstacle_work == two.last_frame.obstacle_work
        work += one.last_frame.obstacle_work
    gained = look(one, work).energy - start
    # Nothing else does work; what is missing has become heat.
    assert 0 < gained <= work
    assert gained > 0.8 * work


SURVIVED: tuple[Cell, ...] = (
    Cell("mpm", "sand", 2, "resumed", 1),
    Cell("mpm", "water", 2, "one particle", 3),
    Cell("coarse", "water", 2, "corner", 3),
    Cell("hybrid", "water", 2, "broken network", 3),
)


@pytest.mark.parametrize("cell", SURVIVED, ids=str)
def test_some_cells_that_survive(cell: Cell) -> None:
    trial = trial_of(cell)
    made = attempt(trial, cell.method)
    assert made.run is not None
    assert judged(made.run, truth(trial), carries=cell.method != "mpm") == ("survived", [])


@pytest.mark.parametrize(
    ("method", "stress", "step", "error"),
    [
        ("mpm", "substep", 3, "StepSizeError"),
        ("neural", "moving obstacle", 1, "ConfigError"),
        ("hybrid", "stiffness", 1, "ConfigError"),
    ],
)
def test_what_is_refused_is_refused_before_any_frame(
    method: Method, stress: str, step: int, error: str
) -> None:
    made = attempt(trial_of(Cell(method, "water", 2, stress, step)), method)
    assert made.refused
    assert made.signals == (error,)


def test_every_stress_has_three_trials_of_valid_scenes() -> None:
    for stress in STRESSES.values():
        for material, dim in stress.settings:
            trials = stress.trials(material, dim)
            assert len({trial.level for trial in trials}) == stability_map.LEVELS, stress.name
            assert {trial.scene.dim for trial in trials} == {dim}
    assert {method for stress in STRESSES.values() for method in stress.methods} == set(METHODS)


def test_the_command_goes_on_with_its_file_and_draws_the_map(tmp_path: Path) -> None:
    runs, rows_file, picture = tmp_path / "runs", tmp_path / "rows.json", tmp_path / "map.svg"
    command = ["stability", "--map", "--stress", "one particle", "--runs", str(runs)]
    result = CliRunner().invoke(cli, [*command, "--json", str(rows_file), "--chart", str(picture)])
    assert result.exit_code == 0, result.output
    rows = json.loads(rows_file.read_text())
    assert len(rows) == 2 * stability_map.LEVELS * len(METHODS)
    assert {"method", "stress", "level", "outcome", "signalled", "machine", "commit"} <= set(rows[0])
    assert "Degraded or failed, and nobody is told: 0" in result.stdout
    assert picture.with_suffix(".png").stat().st_size > 10_000
    before = runs.read_text()
    again = CliRunner().invoke(cli, command)
    assert again.exit_code == 0
    assert runs.read_text() == before


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (["--map", "--level", "0.4"], "--level is not for --map"),
        (["--stress", "pool"], "add --map"),
    ],
)
def test_options_that_do_not_go_together(options: list[str], said: str) -> None:
    result = CliRunner().invoke(cli, ["stability", *options])
    assert result.exit_code == 2
    assert said in result.output
