"""Many scenes at once: through the compiled module alone, and as `MpmBatch`."""

import pickle

import numpy as np
import pytest
from tests.python.conftest import native_solver

from hybridmpm import (
    BatchError,
    Box,
    ConfigError,
    DomainError,
    MpmBatch,
    MpmSolver,
    Scene,
    SceneError,
    _native,
    scenarios,
)


def block(height: float) -> _native.Solver:
    """Return a solver with a block of water at some height, in two substeps a frame."""
    axis = np.arange(0.4, 0.6, 1 / 32)
    x = np.stack(np.meshgrid(axis, axis + height, indexing="ij"), axis=-1).reshape(-1, 2)
    water = _native.Material.water(density=1000.0, bulk_modulus=1e5)
    return native_solver(x, 0.0, water, resolution=16, gravity=[0.0, -9.81], substeps=2)


def test_one_solver_twice_advances_twice() -> None:
    solver = block(0.0)
    _native.advance_all([solver, solver], 3)
    assert solver.frame == 6


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"threads": 0}, "threads must be at least 1, got 0"),
        ({"force": [None]}, "force must have one entry a solver, 2, got 1"),
        ({"force": [None, np.zeros((1, 2), np.float32)]}, r"force\[1\] must be of shape \[\d+, 2\] or \[1, "),
        ({"force": [None, np.zeros(3, np.float32)]}, r"force\[1\] must be .* or \[2\] for all .*, got \[3\]"),
        ({"force": [None, "up"]}, r"force\[1\] must be float32, got 'up'"),
    ],
)
def test_bad_arguments_move_nothing(arguments: dict[str, object], message: str) -> None:
    solvers = [block(0.0), block(0.1)]
    with pytest.raises(_native.ConfigError, match=message):
        _native.advance_all(solvers, 1, **arguments)
    assert [solver.frame for solver in solvers] == [0, 0]


@pytest.mark.parametrize("threads", [1, 2, 3])
def test_members_have_the_bits_of_solvers_alone(
    drop: Scene, splash: Scene, cube: Scene, threads: int
) -> None:
    scenes = [drop, splash, cube, scenarios.water_2d(3), drop]
    batch = MpmBatch(scenes, threads=threads)
    alone = [MpmSolver(scene) for scene in scenes]
    steady = np.full((alone[0].particle_count, 2), 3.0)
    changing = np.random.default_rng(0).normal(size=(20, alone[2].particle_count, 3))
    force = [steady, None, changing, None, None]
    batch.advance(20, force)
    batch.advance(5)
    for one, single, push in zip(batch, alone, force, strict=True):
        single.advance(20, push)
        single.advance(5)
        assert one.snapshot() == single.snapshot()
    # The same scene under another force: members share nothing.
    assert not np.array_equal(batch[0].positions, batch[4].positions)


def test_a_batch_is_a_sequence_of_solvers(drop: Scene, splash: Scene) -> None:
    batch = MpmBatch([drop, splash], substeps="reference")
    assert len(batch) == 2
    assert [member.scene.name for member in batch] == ["drop", "splash"]
    assert batch[-1] is batch[1:][0]
    batch[0].advance(2)
    batch.advance(3)
    assert [member.frame for member in batch] == [5, 3]
    with pytest.raises(IndexError):
        batch[2]
    MpmBatch([]).advance()


def test_failing_scenes_are_named_and_the_others_advance(drop: Scene) -> None:
    crash = Scene(
        dim=2,
        resolution=64,
        bodies=(
            Box(material="water", lower=(0.3, 0.3), upper=(0.5, 0.5), velocity=(45.0, 0.0)),
            Box(material="water", lower=(0.52, 0.3), upper=(0.7, 0.5), velocity=(-45.0, 0.0)),
        ),
    )
    batch = MpmBatch([crash, drop, crash], substeps=1, allow_unstable=True)
    with pytest.raises(BatchError, match=r"^scene 0: particle .*; scene 2: particle ") as caught:
        batch.advance(3)
    failures = caught.value.failures
    assert {index: type(error) for index, error in failures.items()} == {0: DomainError, 2: DomainError}
    assert batch[1].frame == 3
    # The state is the one before the failed frame, and the batch goes on from there, to fail again.
    assert batch[0].frame == batch[2].frame < 3
    before = batch[0].snapshot()
    with pytest.raises(BatchError, match="scene 0"):
        batch.advance(1)
    assert batch[0].snapshot() == before
    assert batch[1].frame == 4
    again = pickle.loads(pickle.dumps(caught.value))  # noqa: S301 - bytes of our own
    assert str(again) == str(caught.value)
    assert list(again.failures) == [0, 2]


@pytest.mark.parametrize(
    ("frames", "force", "message"),
    [
        (-1, None, r"frames must be in \[0, 1000000\], got -1"),
        (1, [None], "one entry for each of 2 scenes, got 1"),
        (1, [None, [1.0]], r"force\[1\] must have shape \(2,\), \(177, 2\) or"),
        (1, [None, [[1.0, 2.0]]], r"force\[1\] must have shape"),
        (1, lambda _: None, "one entry for each of 2 scenes, got function"),
    ],
)
def test_bad_calls_move_no_member(drop: Scene, frames: int, force: object, message: str) -> None:
    batch = MpmBatch([drop, drop])
    with pytest.raises(ConfigError, match=message):
        batch.advance(frames, force)
    assert [member.frame for member in batch] == [0, 0]


def test_bad_batches_are_refused(drop: Scene) -> None:
    with pytest.raises(ConfigError, match=r"threads must be in \[1, 1024\], got 0"):
        MpmBatch([drop], threads=0)
    crowded = drop.model_copy(update={"max_particles": 10})
    with pytest.raises(SceneError, match="max_particles"):
        MpmBatch([drop, crowded])
