"""The loss of transfers as a rate per time: `Scene.transfer_loss`."""

import warnings

import numpy as np
import pytest

from hybridmpm import Ball, Box, BoxObstacle, CoarseWarning, MpmSolver, Scene, SceneError, SnapshotError
from hybridmpm.checking.check import findings
from hybridmpm.scene import Walls
from hybridmpm.scene.gaps import narrow_gaps
from hybridmpm.scene.scene import ADVISED_LOSS

COLUMN = {"shape": "box", "material": "water", "lower": [0.1, 0.1], "upper": [0.3, 0.5]}


def column(**settings: object) -> Scene:
    return Scene.parse({"dim": 2, "resolution": 64, "bodies": [COLUMN], **settings})


def plate(cells: float, **settings: object) -> Scene:
    """Return water above a plate with a slot of so many cells of 1/128 m."""
    side = cells / 256
    obstacles = (
        BoxObstacle(lower=(0.1, 0.4), upper=(0.5 - side, 0.44)),
        BoxObstacle(lower=(0.5 + side, 0.4), upper=(0.9, 0.44)),
    )
    body = Box(material="water", lower=(0.1, 0.44), upper=(0.9, 0.7))
    return Scene.parse({"dim": 2, "bodies": [body], "obstacles": obstacles, **settings})


@pytest.mark.parametrize("rate", [-1.0, 2e6, "much"])
def test_a_rate_out_of_range_is_refused(rate: object) -> None:
    with pytest.raises(SceneError, match="transfer_loss"):
        column(transfer_loss=rate)


def test_documents_keep_the_rate() -> None:
    scene = column(transfer_loss=500)
    assert Scene.from_json(scene.to_json()) == scene
    assert "transfer_loss" in Scene.model_json_schema()["properties"]


def test_less_is_lost_and_no_energy_is_gained() -> None:
    """A column of water that collapses: more of its energy is left, never more than at the start."""
    left = []
    for loss in (None, 500.0):
        solver = MpmSolver(column(transfer_loss=loss), substeps=24)
        start, energies = solver.diagnostics(), []
        floor = start.mass * 9.81 * 0.1
        for _ in range(60):
            solver.advance(5)
            now = solver.diagnostics()
            energies.append(now.kinetic_energy + now.potential_energy + now.elastic_energy - floor)
        before = start.kinetic_energy + start.potential_energy + start.elastic_energy - floor
        assert max(energies) < 1.001 * before
        left.append(energies[-1] / before)
    assert left[1] > left[0]


def test_a_snapshot_belongs_to_its_rate() -> None:
    solver = MpmSolver(column(transfer_loss=500))
    solver.advance(5)
    snapshot = solver.snapshot()
    again = MpmSolver(column(transfer_loss=500))
    again.restore(snapshot)
    solver.advance(5)
    again.advance(5)
    assert np.array_equal(solver.positions, again.positions)
    for other in (None, 400.0):
        with pytest.raises(SnapshotError, match="other settings"):
            MpmSolver(column(transfer_loss=other)).restore(snapshot)


def test_bodies_still_part_in_3d() -> None:
    discs = tuple(
        Ball(material="elastic", center=(0.5 + at, 0.5, 0.5), radius=0.08, velocity=(-5 * at, 0, 0))
        for at in (-0.1, 0.1)
    )
    walls = Walls(lower=(0.0,) * 3, upper=(1.0,) * 3)
    parted = []
    for loss in (None, ADVISED_LOSS):
        scene = Scene(dim=3, resolution=32, gravity=(0, 0, 0), walls=walls, bodies=discs, transfer_loss=loss)
        solver = MpmSolver(scene)
        solver.advance(120)
        v, first = solver.velocities[:, 0], scene.sample().body == 0
        parted.append(v[~first].mean() - v[first].mean())
        assert solver.diagnostics().momentum == pytest.approx([0, 0, 0], abs=1e-4)
    assert parted[0] < parted[1] < 1.0


def test_the_check_tells_what_it_costs_and_what_a_gap_passes() -> None:
    with_loss = plate(2, transfer_loss=ADVISED_LOSS)
    (note,) = (one for one in findings(with_loss) if one.field == "transfer_loss")
    assert note.severity == "note"
    assert "1.2 times as long" in note.problem
    (gap,) = (one for one in findings(plate(2)) if "gap" in one.problem)
    assert "35% of a flow" in gap.problem
    assert "transfer_loss to 100" in gap.advice
    assert not any("gap" in one.problem for one in findings(with_loss))
    (flow,) = (gap.flow(128) for gap in narrow_gaps(plate(1, transfer_loss=ADVISED_LOSS)))
    assert flow == pytest.approx(0.52, abs=0.05)


def test_coarse_levels_warn_of_it_and_simulate_it() -> None:
    with pytest.warns(CoarseWarning, match="transfer_loss is given in this scene"):
        solver = MpmSolver(column(transfer_loss=500), coarse="1/4")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        plain = MpmSolver(column(), coarse="1/4")
    solver.advance(60)
    plain.advance(60)
    assert not np.array_equal(solver.positions, plain.positions)
