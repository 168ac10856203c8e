"""Ctrl-C and flags end any call that takes long, and leave the state after the last whole frame."""

import os
import signal
import sys
import threading
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from contextlib import AbstractContextManager
from types import FrameType

import numpy as np
import numpy.typing as npt
import pytest

from hybridmpm import (
    BallObstacle,
    Box,
    CancelFlag,
    Elastic,
    FrameCancelledError,
    HybridSimulator,
    MpmBatch,
    MpmSolver,
    NeuralPhysics,
    Scene,
    Simulator,
    Water,
    radius_graph,
    scenarios,
)
from hybridmpm._native import match_to_region
from hybridmpm._support import signals
from hybridmpm.force import Force

SCENE = scenarios.water_2d(seed=3)
FRAMES = 1_000_000


def _nothing(_: object) -> None:
    return None


SIMULATORS: dict[str, tuple[Callable[[], Simulator], Force]] = {
    "mpm": (lambda: MpmSolver(SCENE), None),
    "mpm on threads": (lambda: MpmSolver(SCENE, threads=2), None),
    "by frames": (lambda: MpmSolver(SCENE), _nothing),
    "coarse": (lambda: MpmSolver(SCENE, coarse="1/4"), None),
    "neural": (lambda: NeuralPhysics(SCENE, "zero"), None),
    "hybrid": (lambda: HybridSimulator(SCENE, "zero"), None),
}
RNG = np.random.default_rng(0)


def _neighbours(threads: int) -> None:
    x = RNG.random((400_000, 3)).astype(np.float32)
    while True:
        radius_graph(x, 0.03, threads=threads)


def _places() -> None:
    while True:
        match_to_region(RNG.random((60_000, 2)), RNG.random((500_000, 2)))


def _batch() -> None:
    MpmBatch([scenarios.water_2d(seed=seed) for seed in range(3)], threads=2).advance(FRAMES)


CALLS: dict[str, Callable[[], None]] = {
    "batch": _batch,
    "neighbours": lambda: _neighbours(1),
    "neighbours on threads": lambda: _neighbours(2),
    "places": _places,
}


class Pressed(AbstractContextManager[None]):
    """Sends a signal to this process, some time after a block begins."""

    def __init__(self, number: int = signal.SIGINT, after: float = 0.3) -> None:
        self._over = threading.Event()
        self._number, self._after = number, after

    def __enter__(self) -> None:
        threading.Thread(target=self._press, daemon=True).start()

    def _press(self) -> None:
        if not self._over.wait(self._after):
            os.kill(os.getpid(), self._number)

    def __exit__(self, *_: object) -> None:
        self._over.set()


@pytest.mark.parametrize("kind", SIMULATORS)
def test_ctrl_c_ends_a_call_after_a_whole_frame(kind: str) -> None:
    make, force = SIMULATORS[kind]
    simulator, reference = make(), make()
    with pytest.raises(KeyboardInterrupt), Pressed():
        simulator.advance(FRAMES, force)
    assert 0 < simulator.frame < FRAMES
    for one in range(reference.frame, simulator.frame):
        del one
        reference.advance(1, force)
    assert np.array_equal(simulator.positions, reference.positions)
    assert simulator.snapshot() == reference.snapshot()
    simulator.advance(5, force)
    reference.advance(5, force)
    assert simulator.snapshot() == reference.snapshot()
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


@pytest.mark.parametrize("name", CALLS)
def test_ctrl_c_ends_calls_without_a_state(name: str) -> None:
    with pytest.raises(KeyboardInterrupt), Pressed():
        CALLS[name]()


def test_a_rollout_ends_too_and_other_threads_hear_nothing() -> None:
    solver, other = MpmSolver(SCENE), MpmSolver(SCENE)
    thread = threading.Thread(target=other.advance, args=(60,))
    thread.start()
    with pytest.raises(KeyboardInterrupt), Pressed():
        solver.rollout(10_000)
    thread.join()
    assert other.frame == 60


def test_a_handler_that_raises_nothing_runs_within_the_call_and_may_not_use_the_simulator() -> None:
    solver = MpmSolver(SCENE)
    heard: list[object] = []

    def handler(number: int, _frame: FrameType | None) -> None:
        heard.append(number)
        try:
            heard.append(solver.frame)
        except RuntimeError as error:
            heard.append(str(error))

    before = signal.signal(signal.SIGINT, handler)
    try:
        with Pressed(after=0.05):
            while not heard:
                solver.advance(200)
    finally:
        signal.signal(signal.SIGINT, before)
    assert solver.frame % 200 == 0
    assert heard[0] == signal.SIGINT
    assert isinstance(heard[1], int) or "after the call" in str(heard[1])


def test_a_whole_block_ends_before_its_signal_and_a_second_one_ends_it() -> None:
    done: list[int] = []

    def press(times: int) -> None:
        with signals.whole():
            for _ in range(times):
                signal.raise_signal(signal.SIGINT)
            done.append(times)

    for times in (1, 2):
        with pytest.raises(KeyboardInterrupt):
            press(times)
    assert done == [1]


def test_a_signal_while_handlers_are_given_back_leaves_none_behind(monkeypatch: pytest.MonkeyPatch) -> None:
    """The signal comes after the first handler is back, and before the others are."""
    give, heard = sys.modules["_signal"].signal, []

    def give_and_press(number: int, handler: object) -> object:
        before = give(number, handler)  # type: ignore[arg-type]
        if (number, handler) == (signal.SIGINT, signal.default_int_handler):
            signal.raise_signal(signal.SIGINT)
        return before

    before = give(signal.SIGTERM, lambda number, _frame: heard.append(number))
    try:
        with monkeypatch.context() as patch:
            patch.setattr("_signal.signal", give_and_press)
            with pytest.raises(KeyboardInterrupt), signals.whole():
                pass
        signal.raise_signal(signal.SIGTERM)
        assert heard == [signal.SIGTERM]
        with signals.whole():
            signal.raise_signal(signal.SIGTERM)
            assert heard == [signal.SIGTERM]
        assert heard == [signal.SIGTERM] * 2
    finally:
        give(signal.SIGTERM, before)


@pytest.mark.filterwarnings("ignore::hybridmpm.CostlyMaterialWarning")
def test_a_frame_of_many_substeps_ends_amid_them_with_the_state_before_it() -> None:
    """Uncancelled, the frame takes many seconds: 19 000 substeps of 13 000 particles."""
    stiff = Elastic(density=1000.0, youngs_modulus=2.5e9, poisson_ratio=0.2)
    block = Box(material=stiff, lower=(0.3, 0.3), upper=(0.6, 0.6), velocity=(1.0, -0.5))
    solver = MpmSolver(Scene(dim=2, resolution=190, frame_dt=0.015, bodies=(block,)))
    before, flag = solver.snapshot(), CancelFlag()
    timer = threading.Timer(0.05, flag.set)
    timer.start()
    with flag, pytest.raises(FrameCancelledError, match="frame 0 was cancelled"):
        solver.advance()
    timer.join()
    assert flag.is_set
    assert solver.snapshot() == before


def test_a_set_flag_ends_all_frames_in_its_block_and_in_no_other(make: Callable[[], Simulator]) -> None:
    simulator, twin, flag, inner = make(), make(), CancelFlag(), CancelFlag()
    with flag:
        simulator.advance(30)
        flag.set()
        for _ in range(2):
            with inner, pytest.raises(FrameCancelledError, match="was cancelled before it was done"):
                simulator.advance(5)
        with ThreadPoolExecutor(1) as other:
            other.submit(simulator.advance, 2).result()
    with inner:
        simulator.advance(3)
    twin.advance(35)
    assert simulator.snapshot() == twin.snapshot()


@pytest.mark.parametrize("r_p", [1.0, 0.25])
def test_a_build_ends_at_its_next_look_at_the_flag(monkeypatch: pytest.MonkeyPatch, r_p: float) -> None:
    """The flag is set in one test of points after the other; each is the last but one."""
    still = [
        BallObstacle(center=(0.15 + 0.05 * (i % 14), 0.2 + 0.1 * (i // 14)), radius=0.01) for i in range(70)
    ]
    blocks = [
        Box(material=Water(), lower=(0.1, y), upper=(0.9, y + 0.3), seed=index)
        for index, y in enumerate((0.1, 0.35, 0.6))
    ]
    scene = Scene(dim=2, resolution=64, bodies=tuple(blocks), obstacles=tuple(still))
    contains, calls = Box.contains, 0

    def count(body: Box, x: npt.NDArray[np.float64]) -> npt.NDArray[np.bool_]:
        nonlocal calls
        calls += 1
        if calls == last:
            flag.set()
        return contains(body, x)

    monkeypatch.setattr(Box, "contains", count)
    last, flag = 0, CancelFlag()
    with flag:
        expected = MpmSolver(scene, r_p=r_p).snapshot()
    every, ended = calls, 0
    assert every > 10
    for last in range(1, every + 1):
        calls, flag = 0, CancelFlag()
        with flag, pytest.raises(FrameCancelledError):
            MpmSolver(scene, r_p=r_p)
        ended += calls == last
        assert calls <= last + 1
    assert ended > every / 2
    assert MpmSolver(scene, r_p=r_p).snapshot() == expected


def test_a_cancelled_frame_of_a_level_is_not_done_again_at_the_safe_step() -> None:
    solver, flag = MpmSolver(scenarios.water_2d(0), coarse="1/16"), CancelFlag()
    solver.advance(6)
    before = solver.snapshot()
    flag.set()
    with flag, pytest.raises(FrameCancelledError, match="frame 6 was cancelled"):
        solver.advance(5)
    assert solver._stepper._safe is None  # nor is the solver made that would do it
    assert solver.redone_frames == ()
    assert solver.snapshot() == before
