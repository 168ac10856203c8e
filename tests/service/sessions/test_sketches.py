"""Sketches of a session without a server: prepared beside it while it goes on, dropped when it has to be."""

import asyncio
import threading
import time
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from tests.service.conftest import SCENE, SOURCE

from hybridmpm import DomainError, MpmSolver, SketchError
from hybridmpm.control import Arrow, ControlledTrajectory, Ellipse, Guidance, prepare, push
from hybridmpm.simulator import Simulator
from hybridmpm_service.errors import SessionNotFoundError, SketchDroppedError
from hybridmpm_service.sessions.manager import SessionManager
from hybridmpm_service.sessions.session import Session
from hybridmpm_service.sessions.work import traced

pytestmark = pytest.mark.anyio
ARROW = Arrow(np.array([[0.5, 0.5], [0.53, 0.5]]))


class _Gate:
    """Holds the first preparation of a sketch until it is opened."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.inside, self._opened = threading.Event(), threading.Event()
        self.frames = 0

        def held(*arguments: Any, on_frame: Callable[[], object], **settings: Any) -> Any:
            if self.inside.is_set():
                return prepare(*arguments, on_frame=on_frame, **settings)
            self.inside.set()
            assert self._opened.wait(60)

            def counted() -> None:
                on_frame()
                self.frames += 1

            return prepare(*arguments, on_frame=counted, **settings)

        monkeypatch.setattr("hybridmpm_service.sessions.work.prepare", held)

    async def reached(self) -> None:
        assert await asyncio.to_thread(self.inside.wait, 60)

    def open(self) -> None:
        self._opened.set()


def _phase(session: Session) -> str | None:
    return None if session.control is None else session.control.phase


async def test_a_session_goes_on_while_a_sketch_is_prepared(
    monkeypatch: pytest.MonkeyPatch, manager: SessionManager
) -> None:
    session = await manager.create(SOURCE)
    gate = _Gate(monkeypatch)
    steering = asyncio.create_task(session.steer(ARROW, most=400, frames=20))
    await gate.reached()
    assert _phase(session) == "preparing"
    await session.advance(8)
    assert session.view.frame == 8
    gate.open()
    steered = await steering
    assert (steered.first_frame, steered.guidance.first_frame) == (8, 0)
    assert _phase(session) == "steering"
    await session.advance(20)
    assert _phase(session) == "done"


async def test_an_older_sketch_steers_until_the_newer_one_does(
    monkeypatch: pytest.MonkeyPatch, manager: SessionManager
) -> None:
    session = await manager.create(SOURCE)
    first = await session.steer(ARROW, most=400, frames=20)
    gate = _Gate(monkeypatch)
    steering = asyncio.create_task(session.steer(ARROW, most=400, frames=30))
    await gate.reached()
    await session.advance(5)
    gate.open()
    second = await steering
    await session.advance(30)
    positions = (await session.particles()).positions
    solver = MpmSolver(SCENE)
    solver.advance(5, first.guidance)
    for index in range(30):
        solver.advance(1, second.guidance.law.force(solver, index))
    assert np.array_equal(positions, solver.positions)


@pytest.mark.parametrize(
    ("interfere", "message"),
    [
        (lambda session: session.steer(ARROW, most=400, frames=20), "a newer sketch has replaced"),
        (lambda session: session.release(), "taken back"),
        (lambda session: session.reset(), "back to its start"),
    ],
)
async def test_a_sketch_that_is_being_prepared_is_dropped(
    monkeypatch: pytest.MonkeyPatch,
    interfere: Callable[[Session], Any],
    message: str,
    manager: SessionManager,
) -> None:
    gate = _Gate(monkeypatch)

    session = await manager.create(SOURCE)
    dropped = asyncio.create_task(session.steer(ARROW, most=400, frames=100, method="constant"))
    await gate.reached()
    interfering = asyncio.create_task(interfere(session))
    await asyncio.sleep(0)
    gate.open()
    with pytest.raises(SketchDroppedError, match=message):
        await dropped
    steered = await interfering
    assert _phase(session) == (None if steered is None else "steering")
    assert gate.frames == 0


async def _trace(session: Session, sketch: Arrow, **settings: Any) -> tuple[Guidance, ControlledTrajectory]:
    return await session.on_copy(lambda twin, check: traced(twin, check, sketch, **settings))


@pytest.mark.parametrize("plan", [Session.steer, _trace])
@pytest.mark.parametrize("stop", ["delete", "close", "cancel"])
async def test_a_plan_ends_with_its_frame_when_nobody_wants_it_any_more(
    monkeypatch: pytest.MonkeyPatch, plan: Callable[..., Any], stop: str, manager: SessionManager
) -> None:
    gate = _Gate(monkeypatch)
    session = await manager.create(SOURCE)
    planning = asyncio.create_task(plan(session, ARROW, most=400, frames=100, method="constant"))
    await gate.reached()
    if stop == "cancel":
        planning.cancel()
    ending = asyncio.create_task(manager.delete(session.id) if stop == "delete" else manager.close())
    await asyncio.sleep(0.05)
    gate.open()
    await ending
    with pytest.raises(asyncio.CancelledError if stop == "cancel" else SessionNotFoundError):
        await planning
    assert gate.frames == 0
    assert session.control is None


async def test_whoever_cancels_work_beside_a_session_finds_it_ended(manager: SessionManager) -> None:
    session = await manager.create(SOURCE)
    begun, notes = threading.Event(), []

    def work(_twin: Simulator, check: Callable[[], None]) -> None:
        begun.set()
        try:
            while True:
                time.sleep(0.005)
                check()
        finally:
            time.sleep(0.05)
            notes.append("ended")

    working = asyncio.create_task(session.on_copy(work))
    assert await asyncio.to_thread(begun.wait, 60)
    working.cancel()
    with pytest.raises(asyncio.CancelledError):
        await working
    assert notes == ["ended"]


async def test_a_sketch_that_is_refused_leaves_the_older_one(manager: SessionManager) -> None:
    session = await manager.create(SOURCE)
    await session.steer(ARROW, most=400, frames=20)
    outside = Ellipse(np.array([0.03, 0.03]), np.array([0.02, 0.02]), 0.0)
    with pytest.raises(SketchError, match="no part of the oval is free"):
        await session.steer(outside, most=400)
    assert session.control is not None
    assert (session.control.number, session.control.phase) == (1, "steering")


async def test_frames_that_are_not_given_stay_within_the_limit(manager: SessionManager) -> None:
    session = await manager.create(SOURCE)
    far = Arrow(np.array([[0.5, 0.3], [0.5, 0.7]]))
    free = await session.steer(far, most=400)
    assert free.guidance.frames == free.guidance.needs().suggested_frames > 17
    limited = await session.steer(far, most=20, hold=3)
    assert (limited.guidance.frames, limited.guidance.hold) == (17, 3)


async def test_a_sketch_is_steered_by_while_a_trajectory_is_computed(
    monkeypatch: pytest.MonkeyPatch, manager: SessionManager
) -> None:
    session = await manager.create(SOURCE)
    gate = _Gate(monkeypatch)
    tracing = asyncio.create_task(_trace(session, ARROW, most=400, frames=20))
    await gate.reached()
    await session.steer(ARROW, most=400, frames=20)
    assert _phase(session) == "steering"
    gate.open()
    _, motion = await tracing
    await session.advance(20)
    assert np.array_equal((await session.particles()).positions, motion.positions[-1])


async def test_a_frame_that_fails_under_a_sketch_pauses_and_a_reset_helps(
    monkeypatch: pytest.MonkeyPatch, manager: SessionManager
) -> None:
    session = await manager.create(SOURCE)
    await session.steer(ARROW, most=400, frames=20)
    advance = MpmSolver.advance

    def fail_at_five(solver: MpmSolver, frames: int = 1, force: Any = None) -> None:
        if solver.frame == 5:
            raise DomainError("particle 1 left the box in frame 6")
        advance(solver, frames, force)

    with monkeypatch.context() as patch:
        patch.setattr(MpmSolver, "advance", fail_at_five)
        with pytest.raises(DomainError):
            await session.advance(20)
    assert session.control is not None
    assert (session.view.frame, session.control.frames_done) == (5, 5)
    await session.reset()
    assert session.control is None
    await session.advance(10)
    assert session.view.frame == 10


async def test_a_hand_lets_go_when_its_viewer_leaves(manager: SessionManager) -> None:
    session = await manager.create(SOURCE)
    hand = push((0.5, 0.5), (1, 0), 0.1)
    with session.viewer() as other:
        with session.viewer() as mailbox:
            session.push(hand, by=mailbox)
            assert session.simulation.hand is hand
        assert session.simulation.hand is None
        session.push(hand, by=other)
        with session.viewer():
            pass
        assert session.simulation.hand is hand
    assert session.simulation.hand is None
