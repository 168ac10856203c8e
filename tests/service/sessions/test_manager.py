"""Sessions and their sketches without a server: limits, expiry on a clock that tests turn, an orderly end."""

import asyncio
import threading
import time
from collections.abc import Callable
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from tests.service.conftest import SCENE, SOURCE, Hold, until
from tests.service.sessions.conftest import Clock, Manage

from hybridmpm import Ball, Box, DomainError, Elastic, MpmSolver, Scene, SceneError, SketchError, Water
from hybridmpm.control import Arrow, ControlledTrajectory, Ellipse, Guidance, prepare, push
from hybridmpm.simulator import Simulator
from hybridmpm_service.errors import (
    SessionBusyError,
    SessionNotFoundError,
    SketchDroppedError,
    TooManySessionsError,
    UnavailableError,
)
from hybridmpm_service.sessions.manager import SessionManager
from hybridmpm_service.sessions.scene_work import SceneSource
from hybridmpm_service.sessions.session import Session
from hybridmpm_service.sessions.simulation import Simulation
from hybridmpm_service.sessions.work import MAX_WAITING, traced

pytestmark = pytest.mark.anyio


async def test_a_session_that_nobody_uses_expires(manage: Manage, clock: Clock) -> None:
    manager = manage(idle_seconds=100)
    unused, used = (
        await manager.create(SOURCE),
        await manager.create(SOURCE),
    )
    clock.now = 90
    manager.get(used.id)
    clock.now = 101
    with pytest.raises(SessionNotFoundError, match="expired after 100 s"):
        manager.get(unused.id)
    assert [session.id for session in manager.all()] == [used.id]
    await manager.expire()
    assert manager.get(used.id) is used


async def test_a_session_that_is_watched_does_not_expire_before_its_viewer_has_left(
    manage: Manage, clock: Clock
) -> None:
    manager = manage(idle_seconds=100)
    session = await manager.create(SOURCE)
    with session.viewer():
        clock.now = 1000
        await manager.expire()
        assert manager.all() == [session]
    clock.now = 1099
    await manager.expire()
    assert manager.all() == [session]
    clock.now = 1101
    await manager.expire()
    assert manager.all() == []


async def test_a_session_that_was_left_ends_unless_it_is_commanded(manage: Manage, clock: Clock) -> None:
    manager = manage()
    left, back = await manager.create(SOURCE), await manager.create(SOURCE)
    with left.viewer() as mailbox:
        manager.end_later(left.id, 60)
        manager.end_later(back.id, 60)
        clock.now = 59
        await manager.expire()
        assert len(manager.all()) == 2
        back.ends_at = None
        clock.now = 60
        await manager.expire()
        assert manager.all() == [back]
        assert (await mailbox.closed()).code == 4404


async def test_a_session_that_was_left_makes_room_for_a_new_one(manage: Manage, clock: Clock) -> None:
    manager = manage(max_sessions=2)
    first, second = await manager.create(SOURCE), await manager.create(SOURCE)
    manager.end_later(second.id, 60)
    clock.now = 1
    manager.end_later(first.id, 60)
    assert manager.why_full() is None
    third = await manager.create(SOURCE)
    assert manager.all() == [first, third]


async def test_there_is_room_for_so_many_sessions_and_for_one_more_after_a_delete(manage: Manage) -> None:
    manager = manage(max_sessions=2)
    first = await manager.create(SOURCE)
    await manager.create(SOURCE)
    with pytest.raises(TooManySessionsError, match="all 2 sessions"):
        await manager.create(SOURCE)
    await manager.delete(first.id)
    assert manager.why_full() is None
    await manager.create(SOURCE)


async def test_many_who_ask_at_once_do_not_get_more_than_the_limit(manage: Manage) -> None:
    manager = manage(max_sessions=2)
    tries = [manager.create(SOURCE) for _ in range(6)]
    results = await asyncio.gather(*tries, return_exceptions=True)
    assert sum(isinstance(result, TooManySessionsError) for result in results) == 4


async def test_a_refused_scene_takes_no_room(manage: Manage) -> None:
    manager = manage(max_particles=10, max_sessions=1)
    with pytest.raises(SceneError, match="max_particles"):
        await manager.create(SOURCE)
    assert manager.all() == []
    assert manager.why_full() is None


async def test_a_grid_beyond_the_servers_memory_is_refused_with_what_fits(manage: Manage) -> None:
    manager = manage(max_grid_nodes=31 * 31)
    with pytest.raises(SceneError, match="resolution: must be at most 30 in 2D"):
        await manager.create(SOURCE)


async def test_work_is_done_in_the_order_in_which_it_was_asked_for(manager: SessionManager) -> None:
    session = await manager.create(SOURCE)
    forward, back, state = session.advance(5), session.reset(), session.particles()
    _, _, particles = await asyncio.gather(forward, back, state)
    assert particles.frame == 0


async def test_calls_do_not_pile_up_without_end_and_a_delete_answers_those_that_wait(
    manager: SessionManager,
) -> None:
    session = await manager.create(SOURCE)
    gate = threading.Event()
    session.simulation.advance = lambda *_: gate.wait(60) and 1  # type: ignore[method-assign]
    waiting = [asyncio.create_task(session.advance(1)) for _ in range(MAX_WAITING)]
    await asyncio.sleep(0)
    with pytest.raises(SessionBusyError, match=str(MAX_WAITING)):
        await session.advance(1)
    await manager.delete(session.id)
    gate.set()
    results = await asyncio.gather(*waiting, return_exceptions=True)
    assert all(isinstance(result, SessionNotFoundError) for result in results)


async def test_a_cancelled_call_ends_after_its_frame_and_still_reaches_the_viewers(
    manager: SessionManager,
) -> None:
    session = await manager.create(SOURCE)
    hold = Hold(session)
    calling = asyncio.create_task(session.advance(1000))
    queued = asyncio.create_task(session.advance(1000))
    assert await asyncio.to_thread(hold.reached.wait, 60)
    calling.cancel()
    queued.cancel()
    await asyncio.gather(calling, queued, return_exceptions=True)
    hold.gate.set()
    await session.particles()
    assert session.view.frame == 1


@pytest.mark.filterwarnings("ignore::hybridmpm.CostlyMaterialWarning")
async def test_a_delete_ends_the_frame_that_is_being_computed(manage: Manage) -> None:
    """Uncancelled, the frame takes many seconds, and many follow."""
    stiff = Elastic(density=1000.0, youngs_modulus=2.5e9, poisson_ratio=0.2)
    block = Box(material=stiff, lower=(0.3, 0.3), upper=(0.6, 0.6))
    slow = Scene(dim=2, resolution=190, frame_dt=0.015, bodies=(block,))

    manager = manage(max_frame_cost=10**9)
    session = await manager.create(SceneSource(data=slow))
    arrow = Arrow(points=((0.5, 0.5), (0.6, 0.5)))
    calls = [
        asyncio.create_task(call)
        for call in (session.advance(1000), _trace(session, arrow, most=400, method="constant", frames=300))
    ]
    await until(lambda: session._worker._unfinished)
    await asyncio.sleep(0.05)
    await manager.delete(session.id)
    async with asyncio.timeout(60):
        await asyncio.gather(*manager._ending)
    assert session.view.frame == 0
    results = await asyncio.gather(*calls, return_exceptions=True)
    assert all(isinstance(result, SessionNotFoundError) for result in results), results


async def test_sessions_that_still_end_take_room(manage: Manage) -> None:
    manager = manage(max_sessions=1)
    session = await manager.create(SOURCE)
    hold = Hold(session)
    calling = asyncio.create_task(session.advance(1))
    assert await asyncio.to_thread(hold.reached.wait, 60)
    await manager.delete(session.id)
    with pytest.raises(TooManySessionsError):
        await manager.create(SOURCE)
    hold.gate.set()
    with pytest.raises(SessionNotFoundError):
        await calling
    await asyncio.gather(*manager._ending)
    await manager.create(SOURCE)


async def test_a_cancelled_creation_takes_room_until_it_is_done_and_makes_no_session(
    manage: Manage, monkeypatch: pytest.MonkeyPatch
) -> None:
    manager = manage(max_sessions=1)
    inside, gate = threading.Event(), threading.Event()

    def make(*arguments: Any, **settings: Any) -> Simulation:
        inside.set()
        assert gate.wait(60)
        return Simulation(*arguments, **settings)

    monkeypatch.setattr("hybridmpm_service.sessions.manager.Simulation", make)
    making = asyncio.create_task(manager.create(SOURCE))
    assert await asyncio.to_thread(inside.wait, 60)
    making.cancel()
    with pytest.raises(asyncio.CancelledError):
        await making
    assert manager.why_full() is not None
    gate.set()
    await until(lambda: manager.why_full() is None)
    assert manager.all() == []


@pytest.mark.parametrize("stop", ["cancel", "close"])
async def test_a_build_ends_with_its_client_and_with_the_server(
    monkeypatch: pytest.MonkeyPatch, stop: str, manage: Manage
) -> None:
    """The work after that is counted: tests of points of a body, one for each of 400 earlier ones."""
    manager = manage()
    balls = [
        Ball(material=Water(), center=(0.15 + 0.03 * (i % 20), 0.2 + 0.03 * (i // 20)), radius=0.005)
        for i in range(400)
    ]
    bodies = (*balls, Box(material=Water(), lower=(0.1, 0.1), upper=(0.9, 0.9)))
    scene = Scene(dim=2, resolution=64, bodies=bodies)
    contains, calls, inside, gate = Ball.contains, 0, threading.Event(), threading.Event()

    def count(ball: Ball, x: npt.NDArray[np.float64]) -> npt.NDArray[np.bool_]:
        nonlocal calls
        calls += 1
        if calls == 500:  # of 2000
            inside.set()
            assert gate.wait(60)
        return contains(ball, x)

    monkeypatch.setattr(Ball, "contains", count)
    making = asyncio.create_task(manager.create(SceneSource(data=scene)))
    assert await asyncio.to_thread(inside.wait, 60)
    if stop == "cancel":
        making.cancel()
    else:
        manager.drain()
    await until(lambda: all(turn.flag.is_set for turn in manager.turns._turns))
    gate.set()
    with pytest.raises(asyncio.CancelledError if stop == "cancel" else UnavailableError):
        await making
    await until(lambda: not manager._being_made)
    assert calls == 500
    assert manager.all() == []


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"resolution": 256}, r"bodies: make a frame of about 10486 particles x 34 substeps = 356524"),
        (
            {"frame_dt": 0.1, "particles_per_cell": 64},
            r"this server takes up to 200000 \(setting max_frame_cost\)",
        ),
    ],
)
@pytest.mark.filterwarnings("ignore::hybridmpm.CostlyMaterialWarning")
async def test_a_scene_whose_frames_are_too_dear_is_refused_with_the_figure_and_the_limit(
    change: dict[str, Any], message: str, manage: Manage
) -> None:
    manager = manage(max_frame_cost=200_000)
    dear = SCENE.model_copy(update=change)
    with pytest.raises(SceneError, match=message):
        await manager.create(SceneSource(data=dear))
    await manager.create(SOURCE)


async def test_wide_emitters_are_refused_before_they_are_built(manage: Manage) -> None:
    """A hundred of these would take 10 s of a core and 2.6 GB."""
    manager = manage()
    wide = {"shape": "round", "material": "water", "center": [0.5, 0.8, 0.5], "radius": 0.38}
    scene = {"dim": 3, "resolution": 100, "bodies": [], "emitters": [wide | {"velocity": [0, -1, 0]}] * 2}
    with pytest.raises(
        SceneError, match=r"emitters: have room for about 36292 particles side by side, .* 12500"
    ):
        await manager.create(SceneSource(data=scene))


async def test_a_session_pauses_when_its_last_viewer_leaves(manager: SessionManager) -> None:
    session = await manager.create(SOURCE)
    with session.viewer():
        with session.viewer():
            session.play()
        assert session.playing
    assert not session.playing


async def test_a_session_does_not_expire_while_a_call_is_worked_on(manage: Manage, clock: Clock) -> None:
    manager = manage(idle_seconds=100)
    session = await manager.create(SOURCE)
    gate = threading.Event()
    session.simulation.advance = lambda *_: gate.wait(60) and 1  # type: ignore[method-assign]
    calling = asyncio.create_task(session.advance(1))
    await asyncio.sleep(0)
    clock.now = 1000
    await manager.expire()
    assert manager.all() == [session]
    gate.set()
    await calling
    clock.now = 1099
    assert manager.get(session.id) is session
    clock.now = 1200
    await manager.expire()
    assert manager.all() == []


async def test_a_player_that_had_to_queue_still_gets_its_turn(manager: SessionManager, clock: Clock) -> None:
    session = await manager.create(SOURCE)
    gate = threading.Event()
    holding = asyncio.create_task(session._on_worker(lambda: gate.wait(60)))
    # Its own turns would queue too, and a player gives way to whoever waits.
    session._tasks[0].cancel()
    session._player.start()
    turn = asyncio.create_task(session._player.take_turn(3))
    await asyncio.sleep(0)
    clock.now = 10
    gate.set()
    await holding
    assert await turn == 3


async def test_a_player_gives_way_to_commands_after_a_frame(manager: SessionManager) -> None:
    session = await manager.create(SOURCE)
    gate = threading.Event()
    holding = asyncio.create_task(session._on_worker(lambda: gate.wait(60)))
    session._player.start()
    turn = asyncio.create_task(session._player.take_turn(100))
    await asyncio.sleep(0)
    looking = asyncio.create_task(session.particles())
    await asyncio.sleep(0)
    gate.set()
    await holding
    assert await turn == 1
    assert (await looking).frame == 1


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

        monkeypatch.setattr("hybridmpm_service.sessions.work.plan_motion", held)

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
