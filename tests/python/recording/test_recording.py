"""Recordings hold the states that the solver went through."""

import numpy as np
import pytest

from hybridmpm import ConfigError, MpmSolver, Scene
from hybridmpm.recording import record
from hybridmpm.recording.recording import MAX_BYTES


def test_states_now_at_each_stride_and_at_the_end(splash: Scene) -> None:
    solver, twin = MpmSolver(splash), MpmSolver(splash)
    solver.advance(2)
    steps: list[int] = []
    recording = record(solver, 7, every=3, on_progress=steps.append)
    assert recording.frames.tolist() == [2, 5, 8, 9]
    assert steps == [3, 3, 1]
    for row, frame in enumerate(recording.frames.tolist()):
        twin.advance(frame - twin.frame)
        np.testing.assert_array_equal(recording.positions[row], twin.positions)
        np.testing.assert_array_equal(recording.velocities[row], twin.velocities)


def test_no_frames_is_one_state(splash: Scene) -> None:
    recording = record(MpmSolver(splash), 0)
    assert recording.frames.tolist() == [0]
    assert recording.positions.shape[0] == 1


def test_too_large_or_senseless(solver: MpmSolver) -> None:
    per_state = 2 * 4 * 2 * solver.particle_count
    with pytest.raises(ConfigError, match=r"must fit in 4 GiB.*raise `every` or lower `frames`"):
        record(solver, min(MAX_BYTES // per_state + 1, 1_000_000))
    with pytest.raises(ConfigError, match=r"every must be in \[1, 1000000\], got 0"):
        record(solver, 1, every=0)
    with pytest.raises(ConfigError, match=r"frames must be in \[0, 1000000\], got -1"):
        record(solver, -1)
    assert solver.frame == 0
