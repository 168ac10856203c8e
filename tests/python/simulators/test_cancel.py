"""A flag ends the frame that another thread computes, and nothing is lost by it."""

import threading
from collections.abc import Callable

import numpy as np
import pytest

from hybridmpm import (
    Box,
    CancelFlag,
    Elastic,
    FrameCancelledError,
    MpmSolver,
    Scene,
    Simulator,
    scenarios,
)


@pytest.mark.filterwarnings("ignore::hybridmpm.CostlyMaterialWarning")
def test_a_frame_of_many_substeps_ends_amid_them_with_the_state_before_it() -> None:
    """Uncancelled, the frame takes many seconds: 19 000 substeps of 13 000 particles."""
    stiff = Elastic(density=1000.0, youngs_modulus=2.5e9, poisson_ratio=0.2)
    block = Box(material=stiff, lower=(0.3, 0.3), upper=(0.6, 0.6), velocity=(1.0, -0.5))
    solver = MpmSolver(Scene(dim=2, resolution=190, frame_dt=0.015, bodies=(block,)))
    before, flag = solver.snapshot(), CancelFlag()
    solver.cancel_by(flag)
    timer = threading.Timer(0.05, flag.set)
    timer.start()
    with pytest.raises(FrameCancelledError, match="frame 0 was cancelled"):
        solver.advance()
    timer.join()
    assert flag.is_set
    assert solver.snapshot() == before


def test_a_set_flag_ends_all_frames_until_another_takes_its_place(make: Callable[[], Simulator]) -> None:
    simulator, twin, flag = make(), make(), CancelFlag()
    simulator.cancel_by(flag)
    simulator.advance(30)
    flag.set()
    for _ in range(2):
        with pytest.raises(FrameCancelledError, match="frame 30 was cancelled"):
            simulator.advance(5)
    simulator.cancel_by(CancelFlag())
    simulator.advance(5)
    twin.advance(35)
    assert simulator.snapshot() == twin.snapshot()


def test_copies_obey_the_flag_until_they_get_their_own(make: Callable[[], Simulator]) -> None:
    simulator, flag = make(), CancelFlag()
    simulator.cancel_by(flag)
    copy, free = simulator.copy(), simulator.copy()
    free.cancel_by(CancelFlag())
    flag.set()
    with pytest.raises(FrameCancelledError):
        copy.advance()
    free.advance()
    assert free.frame == 1
    np.testing.assert_array_equal(copy.positions, simulator.positions)


def test_a_cancelled_frame_of_a_level_is_not_done_again_at_the_safe_step() -> None:
    solver, flag = MpmSolver(scenarios.water_2d(0), coarse="1/16"), CancelFlag()
    solver.cancel_by(flag)
    solver.advance(6)
    before = solver.snapshot()
    flag.set()
    with pytest.raises(FrameCancelledError, match="frame 6 was cancelled"):
        solver.advance(5)
    assert solver._stepper._safe is None  # nor is the solver made that would do it
    assert solver.redone_frames == ()
    assert solver.snapshot() == before
