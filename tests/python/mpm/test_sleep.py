"""Sleeping regions in the library; what falls asleep and wakes is tested beside the core."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from hybridmpm import Box, ConfigError, MpmBatch, MpmSolver, Scene, Sleep

HEAP = Scene(
    dim=2, resolution=32, bodies=(Box(material="sand", lower=(0.4, 0.1), upper=(0.6, 0.2)),), frames=10
)


def test_nobody_sleeps_unless_asked() -> None:
    solver = MpmSolver(HEAP)
    solver.advance(200)
    assert solver.asleep.dtype == bool
    assert solver.asleep.shape == (solver.particle_count,)
    assert not solver.asleep.any()


def test_a_heap_sleeps_and_a_force_wakes_it() -> None:
    solver = MpmSolver(HEAP, sleep=Sleep(speed=0.05, frames=5))
    solver.advance(200)
    assert solver.asleep.all()
    before = solver.positions
    solver.advance(10)
    np.testing.assert_array_equal(solver.positions, before)
    solver.advance(2, force=np.full(before.shape, 3.0, dtype=np.float32))
    assert not solver.asleep.any()
    assert np.abs(solver.positions - before).max() > 0


def test_files_and_batches_keep_who_sleeps(tmp_path: Path) -> None:
    sleep = Sleep(speed=0.05, frames=5)
    solver = MpmSolver(HEAP, sleep=sleep)
    solver.advance(58)
    solver.save(tmp_path / "state")
    again = MpmSolver.load(tmp_path / "state", threads=2)
    (member,) = batch = MpmBatch([HEAP], sleep=sleep)
    batch.advance(98)
    for twin in (solver, again):
        twin.advance(40)
    assert solver.asleep.any()
    np.testing.assert_array_equal(again.asleep, solver.asleep)
    assert again.snapshot() == solver.snapshot() == member.snapshot()


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"speed": 0.0}, r"speed.*must be in \(0, 1000\] m/s, got 0"),
        ({"frames": 0}, r"frames.*must be in \[1,"),
    ],
)
def test_bad_settings(settings: dict[str, Any], message: str) -> None:
    with pytest.raises(ConfigError, match=message):
        Sleep(**settings)


def test_a_switch_is_no_sleep() -> None:
    with pytest.raises(ConfigError, match=r"sleep must be Sleep\(\.\.\.\), or None .*, got True"):
        MpmSolver(HEAP, sleep=True)  # type: ignore[arg-type]
