"""The stability map: what its measures notice, a few of its cells, and what the command writes."""

import dataclasses
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from hybridmpm import MpmSolver, metrics, scenarios
from hybridmpm.hybrid import HybridSimulator
from hybridmpm.physics import NeuralModel
from hybridmpm.physics.free_fall import FreeFall
from hybridmpm.scene import BoxObstacle, Motion
from hybridmpm_lab.commands import cli
from hybridmpm_lab.harness.rows import read_rows
from hybridmpm_lab.stability.map import Cell, Look, Outcome, Run, attempt, judged, look, truth
from hybridmpm_lab.stability.stresses import (
    CORRUPTIONS,
    METHODS,
    STRESSES,
    Corrupted,
    Method,
    block,
    scene,
)

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
    assert judged(_run(**changed), _run(), all_simulated=True) == (outcome, faults)


def test_shown_particles_may_be_denser_and_nothing_may_pass_a_solid() -> None:
    assert judged(_run(crowding=1.2), _run(), all_simulated=False) == ("survived", [])
    # A single particle is crowded by its place within its cell alone.
    apart = dataclasses.replace(_run(crowding=0.9), looks=_run(crowding=0.9).looks[1:])
    assert judged(apart, _run(crowding=0.5), all_simulated=True) == ("survived", [])
    through = dataclasses.replace(_run(), passed=0.01)
    assert judged(through, None, all_simulated=True) == ("degraded", ["passed a solid"])
    other = dataclasses.replace(_run(), same=False)
    assert judged(other, None, all_simulated=True)[0] == "degraded"


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
    # Nothing else does work; the rest has become heat.
    assert 0 < gained <= work
    assert gained > 0.8 * work


SURVIVED: tuple[Cell, ...] = (
    Cell("mpm", "sand", 2, "resumed", "at frame 60"),
    Cell("mpm", "water", 2, "one particle", "thrown at 5 m/s"),
    Cell("coarse", "water", 2, "corner", "10 m/s"),
    Cell("hybrid", "water", 2, "broken network", "nan"),
)


@pytest.mark.parametrize("cell", SURVIVED, ids=str)
def test_some_cells_that_survive(cell: Cell) -> None:
    trial = cell.trial
    made = attempt(trial, cell.method)
    assert made.run is not None
    assert judged(made.run, truth(trial), all_simulated=cell.method == "mpm") == ("survived", [])


@pytest.mark.parametrize(
    ("method", "stress", "level", "error"),
    [
        ("mpm", "substep", "above the limit", "StepSizeError"),
        ("neural", "moving obstacle", "2 rad/s", "ConfigError"),
        ("hybrid", "stiffness", "1e+02 Pa", "ConfigError"),
    ],
)
def test_what_is_refused_is_refused_before_any_frame(
    method: Method, stress: str, level: str, error: str
) -> None:
    made = attempt(Cell(method, "water", 2, stress, level).trial, method)
    assert made.refused
    assert made.signals == (error,)


def test_a_warning_of_the_check_is_a_signal() -> None:
    trial = Cell("mpm", "sand", 2, "one particle", "on the floor").trial
    brief = dataclasses.replace(trial, frames=4)
    assert attempt(brief, "mpm").signals == ("check",)
    assert attempt(brief, "neural").signals == ()


@pytest.mark.parametrize("kind", CORRUPTIONS)
def test_a_corrupted_network_does_no_harm(kind: str) -> None:
    """The hybrid ends as near the truth as with free fall in the network's place, and without the network."""
    frames, falling = 160, scenarios.get("water_2d", 1_000_000)
    truth = MpmSolver(falling, substeps="reference")
    truth.advance(frames)
    true = metrics.grid_mass(truth.positions, truth.mass, falling.resolution)
    errors = []
    for network in (
        FreeFall(falling.frame_dt, r_p=1 / 8, r_t=4),
        Corrupted(NeuralModel.load("fluids_2d"), CORRUPTIONS[kind], falling),
    ):
        hybrid = HybridSimulator(falling, network)
        hybrid.advance(frames)
        mass = metrics.grid_mass(hybrid.positions, hybrid.mass, falling.resolution)
        errors.append(float(metrics.grid_rmse(mass, true)))
    assert errors[1] <= 1.05 * errors[0]
    assert hybrid.step_counts.network <= 0.1 * frames


def test_every_stress_has_three_trials_of_valid_scenes() -> None:
    for name, stress in STRESSES.items():
        assert len({stress.unit.format(value) for value in stress.levels}) == 3, name
        for material, dim in stress.settings:
            assert {stress.trial(material, dim, value).scene.dim for value in stress.levels} == {dim}
    assert {method for stress in STRESSES.values() for method in stress.methods} == set(METHODS)


@pytest.mark.long
def test_the_command_resumes_its_file_and_draws_the_map(tmp_path: Path) -> None:
    runs, rows_file, picture = tmp_path / "runs", tmp_path / "rows.json", tmp_path / "map.svg"
    command = ["stability", "--stress", "one particle", "--runs", str(runs)]
    result = CliRunner().invoke(cli, [*command, "--json", str(rows_file), "--chart", str(picture)])
    assert result.exit_code == 0, result.output
    rows = read_rows(rows_file)
    assert len(rows) == 2 * 3 * len(METHODS)
    assert {"method", "stress", "level", "outcome", "signalled", "machine", "threads"} <= set(rows[0])
    assert rows[2]["ingredients"].startswith("fluids_2d=")
    assert "one particle  water 2D" in result.stdout
    assert picture.stat().st_size > 5_000
    before = runs.read_text()
    again = CliRunner().invoke(cli, command)
    assert again.exit_code == 0
    assert runs.read_text() == before
