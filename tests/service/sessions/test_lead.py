"""Sessions whose frames a viewer's tab computes first: the same bits, nothing lost, a way back at any time.

A solver of the library stands for that of the tab, which tests/browser compares with it.
"""

import contextlib
import json
import shutil
import struct
from collections.abc import AsyncIterator, Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from tests.service.conftest import ARROW, OPEN_SCENE, OVAL, SCENE, SOURCE, Service, problem, until

from hybridmpm import Box, DomainError, MpmSolver, Scene, _core
from hybridmpm.control import Keyframe, push
from hybridmpm.control.laws import Tracked
from hybridmpm.force import total_force
from hybridmpm_service import Settings
from hybridmpm_service.errors import FieldError, LeadRefusedError
from hybridmpm_service.sessions import lead as leads
from hybridmpm_service.sessions import session as sessions
from hybridmpm_service.sessions.inputs import Hand, PushInput, hand_input
from hybridmpm_service.sessions.manager import SessionManager
from hybridmpm_service.sessions.scene_work import SceneSource
from hybridmpm_service.sessions.session import Session
from hybridmpm_service.sessions.solvers import SolverChoice
from hybridmpm_service.sessions.viewers import Mailbox

pytestmark = pytest.mark.anyio
FINE = Scene(dim=2, resolution=128, bodies=(Box(lower=(0.4, 0.4), upper=(0.45, 0.45), material="water"),))


@pytest.fixture(autouse=True)
def patient(monkeypatch: pytest.MonkeyPatch) -> None:
    """However busy the machine is, no tab counts as silent."""
    monkeypatch.setattr(sessions, "SILENT_SECONDS", 1e9)


class Tab:
    """A tab that computes the frames of a session."""

    def __init__(self, session: Session, mailbox: Mailbox, solver: MpmSolver) -> None:
        self.session, self.mailbox, self.solver = session, mailbox, solver
        self.hand: Any = None
        self.inputs: list[Any] = []
        self.law: tuple[Any, int, int] = (None, 0, 0)
        self.steered_until = 0

    async def text(self, kind: str) -> dict[str, Any]:
        """Return the next text of a kind that the mailbox gets."""
        while True:
            message = await self.mailbox.take()
            if isinstance(message, str) and (found := json.loads(message))["type"] == kind:
                return dict(found)

    async def lead(self) -> None:
        """Take over in the state of the session."""
        self.session.play()
        await self.session.lead(self.mailbox)
        begun = await self.text("lead")
        frame, digest, _ = await self.session.start_file()
        assert (begun["frame"], begun["digest"]) == (frame, digest)
        # A start file has what a snapshot has; tests/browser open it with the tab's own solver.
        self.solver.restore(self.session.simulation.checkpoint().state)
        assert self.solver.digest() == digest
        await self.take_law()
        self.steered_until = begun["steered_until"] or 0
        self.hand = None if begun["push"] is None else Hand(**begun["push"]).force()

    async def take_law(self) -> None:
        """Follow the law of the sketch that steers, if one does."""
        data = await self.session.ways()
        first, frames, laws = struct.unpack_from("<III", data)
        law = None
        if laws:
            assert struct.unpack_from("<II", data, 8) == (1, 0)
            law = Tracked(_core.Ways.from_bytes(data[16:], self.solver.dim))
        self.law = law, first, first + frames

    async def follow(self, frames: int) -> None:
        """Compute frames under sketch and hand; report all of them at each goal, for the next law."""
        for _ in range(frames):
            law, first, end = self.law
            if self.solver.frame == end < self.steered_until:
                await self.report()
                await self.take_law()
                law, first, end = self.law
            forces = [] if self.hand is None else [self.hand(self.solver)]
            if law is not None and self.solver.frame < end:
                forces.insert(0, law.force(self.solver, self.solver.frame - first))
            self.solver.advance(1, total_force(forces, self.solver.ids, self.solver.dim) if forces else None)

    def push(self, force: Any) -> None:
        """Push from the next frame on."""
        self.hand = force
        self.inputs.append(hand_input(self.solver.frame, force))

    def advance(self, frames: int) -> None:
        """Compute frames."""
        self.solver.advance(frames, self.hand)

    async def report(self) -> dict[str, Any]:
        """Report all that was computed."""
        made, self.inputs = self.inputs, []
        await self.session.follow(self.solver.frame, made, self.mailbox)
        return await self.text("led")

    async def swirl(self) -> None:
        """Compute frames with a hand that turns, and report them in pieces."""
        for turn in range(6):
            self.push(push((0.5, 0.4), (np.cos(turn), np.sin(turn)), 0.12))
            self.advance(3)
            if turn % 2:
                await self.report()
        self.push(None)
        self.advance(4)
        await self.report()


@contextlib.asynccontextmanager
async def _manager(folder: Path | None = None) -> AsyncIterator[SessionManager]:
    manager = SessionManager(Settings(max_load=64.0, state_folder="" if folder is None else str(folder)))
    try:
        await manager.revive()
        yield manager
    finally:
        await manager.close()


CASES: dict[str, tuple[Any, SolverChoice | None]] = {
    "mpm": (SCENE, None),
    "open": (OPEN_SCENE, None),
    "coarse": (SCENE, SolverChoice(coarse="1/4")),
}


@pytest.mark.parametrize("case", CASES)
async def test_a_led_session_has_the_states_of_its_tab(case: str) -> None:
    scene, choice = CASES[case]
    async with _manager() as manager:
        session = await manager.create(SceneSource(data=scene), choice=choice)
        await session.advance(20)
        with session.viewer() as mailbox, session.viewer() as other:
            solver = MpmSolver(scene, coarse=None if choice is None else choice.coarse)
            tab = Tab(session, mailbox, solver)
            await tab.lead()
            assert session.led
            assert session.playing
            await tab.swirl()
            # Whoever asks gets the state that the tab has reported, and the log of it.
            assert (await session.particles()).digest() == solver.digest()
            log = await session.log()
            assert (log.frame, log.digest, len(log.inputs)) == (solver.frame, solver.digest(), 7)
            fork = await manager.fork(session.id)
            assert (await fork.log()).digest == solver.digest()
            tab.push(push((0.5, 0.4), (0.0, 1.0), 0.12))
            tab.advance(5)
            await tab.report()
            await session.unlead(mailbox, solver.digest())
            assert (await tab.text("unlead"))["digest"] == solver.digest()
            assert not session.led
            # The session plays on alone, and the hand pushes until it lets go.
            await until(lambda: session.view.frame > 60)
            session.pause()
            await session.advance(1)
            alone = session.view.frame
            solver.advance(alone - solver.frame, tab.hand)
            assert (await session.particles()).digest() == solver.digest()
            # And back again, in mid-splash, under the hand.
            await tab.lead()
            assert tab.hand is not None
            tab.advance(10)
            await tab.report()
            session.pause()
            assert (await session.particles()).digest() == solver.digest()
            del other
        replayed = await manager.replay(await session.log())
        assert replayed.notice is None


async def test_a_tab_that_leaves_loses_nothing_that_was_answered(tmp_path: Path) -> None:
    async with _manager(tmp_path / "live") as manager:
        session = await manager.create(SOURCE)
        await session.advance(10)
        with session.viewer() as mailbox:
            tab = Tab(session, mailbox, MpmSolver(SCENE))
            await tab.lead()
            await tab.swirl()
            tab.push(push((0.5, 0.4), (0.0, 1.0), 0.12))
            tab.advance(8)
            hold = session._worker.run(lambda: shutil.copytree(tmp_path / "live", tmp_path / "killed"))
            await tab.report()
            shutil.copytree(tmp_path / "live", tmp_path / "answered")
            await hold
        # The viewer has left: its hand lets go, and the session rests.
        assert not session.playing
        assert (await session.particles()).digest() == tab.solver.digest()
        log = await session.log()
        assert log.frame == tab.solver.frame
        await session.advance(5)
        tab.solver.advance(5)
        assert (await session.particles()).digest() == tab.solver.digest()
    # The process was killed right after the answer.
    async with _manager(tmp_path / "answered") as manager:
        (session,) = manager.all()
        assert (session.view.frame, session.notice) == (log.frame, None)
        assert (await session.particles()).digest() == log.digest
        await session.advance(5)
        assert (await session.particles()).digest() == tab.solver.digest()


async def test_a_silent_tab_leads_no_longer(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sessions, "SILENT_SECONDS", 0.0)
    async with _manager() as manager:
        session = await manager.create(SOURCE)
        with session.viewer() as mailbox:
            tab = Tab(session, mailbox, MpmSolver(SCENE))
            session.play()
            await session.lead(mailbox)
            assert "silent" in (await tab.text("unlead"))["reason"]
            await until(lambda: session.view.frame > 3)
            with pytest.raises(LeadRefusedError, match="send lead first"):
                await session.follow(1, [], mailbox)


async def test_whatever_changes_the_session_ends_the_lead() -> None:
    async with _manager() as manager:
        session = await manager.create(SOURCE)
        with session.viewer() as mailbox:
            tab = Tab(session, mailbox, MpmSolver(SCENE))
            changes: list[Callable[[], Any]] = [
                lambda: session.advance(2),
                session.reset,
                session.release,
                lambda: session.steer(ARROW, most=400, frames=500, method="constant"),
            ]
            for change in changes:
                await tab.lead()
                tab.advance(4)
                await tab.report()
                before = tab.solver.frame
                await change()
                assert (await tab.text("unlead"))["frame"] == before
                assert not session.led
            with pytest.raises(LeadRefusedError, match="steers by the method constant"):
                await session.lead(mailbox)
            assert not session.led


TURN = [Keyframe(OVAL, 24, hold=6), Keyframe(ARROW, 20)]


@pytest.mark.parametrize(
    ("scene", "goals"), [(SCENE, OVAL), (OPEN_SCENE, ARROW), (SCENE, TURN)], ids=["oval", "open", "turn"]
)
async def test_a_tab_follows_sketches_with_the_states_of_the_session(
    tmp_path: Path, scene: Scene, goals: Any
) -> None:
    async with _manager(tmp_path / "live") as manager:
        session = await manager.create(SceneSource(data=scene))
        await session.advance(10)
        settings = {} if isinstance(goals, list) else {"frames": 40, "hold": 4}
        with session.viewer() as mailbox:
            await session.steer(goals, most=400, **settings)
            # The server begins, and the tab goes on in mid-motion.
            await session.advance(7)
            tab = Tab(session, mailbox, MpmSolver(scene))
            await tab.lead()
            assert tab.steered_until - tab.solver.frame in range(20, 44)
            await tab.follow(12)
            tab.push(push((0.5, 0.5), (1.0, 0.5), 0.1))
            await tab.follow(6)
            await tab.report()
            shutil.copytree(tmp_path / "live", tmp_path / "answered")
            known = tab.solver.frame
            assert (await session.particles()).digest() == (digest := tab.solver.digest())
            tab.push(None)
            await tab.follow(30)
            await tab.report()
            await session.unlead(mailbox, tab.solver.digest())
            assert (await tab.text("unlead"))["digest"] == tab.solver.digest()
            assert session.view.control is not None
            assert session.view.control.phase == "done"
            assert tab.solver.frame > tab.steered_until
            session.pause()
            log = await session.log()
        assert (await manager.replay(log)).notice is None
    # The process was killed in mid-motion.
    async with _manager(tmp_path / "answered") as manager:
        (session,) = manager.all()
        assert (session.view.frame, session.notice) == (known, None)
        assert (await session.particles()).digest() == digest


async def test_one_tab_leads_and_in_order() -> None:
    async with _manager() as manager:
        session = await manager.create(SOURCE)
        with session.viewer() as mailbox, session.viewer() as other:
            with pytest.raises(LeadRefusedError, match="send play first"):
                await session.lead(mailbox)
            session.play()
            session.push(push((0.5, 0.4), (0.0, 1.0), 0.12), by=other)
            with pytest.raises(LeadRefusedError, match="another viewer's hand"):
                await session.lead(mailbox)
            session.push(None, by=other)
            tab = Tab(session, mailbox, MpmSolver(SCENE))
            await tab.lead()
            with pytest.raises(LeadRefusedError, match="another viewer's tab"):
                await session.lead(other)
            with pytest.raises(LeadRefusedError, match="send lead first"):
                await session.follow(tab.solver.frame, [], other)
            tab.advance(5)
            await tab.report()
            frame = tab.solver.frame
            late = PushInput(frame=frame - 1, push=None)
            for upto, inputs, field in (
                (frame - 1, [], "upto"),
                (frame + 2 * leads.MAX_AHEAD, [], "upto"),
                (frame + 1, [late], r"inputs\[0\]\.frame"),
                (frame, [PushInput(frame=frame + 1, push=None)], r"inputs\[0\]\.frame"),
            ):
                with pytest.raises(FieldError, match=field):
                    await session.follow(upto, inputs, mailbox)
            assert session.led
        network = await manager.create(
            SceneSource(data=FINE), choice=SolverChoice(solver="neural", model="fluids_2d")
        )
        with network.viewer() as mailbox:
            network.play()
            with pytest.raises(LeadRefusedError, match="networks run on servers"):
                await network.lead(mailbox)
            with pytest.raises(LeadRefusedError, match="networks run on servers"):
                await network.start_file()


async def test_another_state_of_the_tab_does_not_count(caplog: pytest.LogCaptureFixture) -> None:
    async with _manager() as manager:
        session = await manager.create(SOURCE)
        with session.viewer() as mailbox:
            tab = Tab(session, mailbox, MpmSolver(SCENE))
            await tab.lead()
            tab.advance(3)
            await tab.report()
            await session.unlead(mailbox, "0" * 64)
            assert (await tab.text("unlead"))["digest"] == tab.solver.digest()
            assert "a tab computed another state of frame" in caplog.text


async def test_a_frame_that_fails_forgets_what_the_tab_did_later(tmp_path: Path) -> None:
    async with _manager(tmp_path / "live") as manager:
        session = await manager.create(SOURCE)
        with session.viewer() as mailbox:
            tab = Tab(session, mailbox, MpmSolver(SCENE))
            await tab.lead()
            tab.advance(5)
            solver, advance = session.simulation._solver, session.simulation._solver.advance

            def fails(frames: int = 1, force: Any = None) -> None:
                if solver.frame == 3:
                    raise DomainError("particle 7 left the box in frame 4")
                advance(frames, force)

            solver.advance = fails  # type: ignore[method-assign]
            tab.push(push((0.5, 0.4), (0.0, 1.0), 0.12))
            tab.advance(1)
            await session.follow(tab.solver.frame, tab.inputs, mailbox)
            assert (await tab.text("unlead"))["reason"] == "a frame failed"
            assert not session.playing
            solver.advance = advance  # type: ignore[method-assign]
            log = await session.log()
            assert (log.frame, len(log.inputs)) == (3, 0)
            shutil.copytree(tmp_path / "live", tmp_path / "killed")
    async with _manager(tmp_path / "killed") as manager:
        (session,) = manager.all()
        assert (session.view.frame, (await session.log()).digest) == (3, log.digest)


def test_a_stream_takes_the_commands(service: Service) -> None:
    path = service.create()
    with service.stream(path, "2") as stream, service.stream(path, "2") as other:
        stream.send(type="lead")
        assert "send play first" in stream.text("problem")["detail"]
        stream.send(type="play")
        stream.send(type="lead")
        begun = stream.text("lead")
        first = begun["frame"]
        assert (begun["push"], begun["types"]) == (None, [5])
        answer = service.http.get(f"{path}/start")
        assert answer.headers["content-type"] == "application/x-hybridmpm-start"
        assert answer.headers["etag"] == f'"{begun["digest"]}"'
        solver = MpmSolver(SCENE)
        solver.advance(first)
        assert answer.content.startswith(b"HMPMPLAY")
        assert begun["steered_until"] is None
        answer = service.http.get(f"{path}/ways")
        assert answer.headers["content-type"] == "application/x-hybridmpm-ways"
        assert answer.content == bytes(12)
        other.status(led=True, playing=True)
        hand = {"point": [0.5, 0.4], "velocity": [1, 0.5], "radius": 0.1, "cap": 15}
        inputs = [{"frame": first + 2, "push": hand}, {"frame": first + 5, "push": None}]
        stream.send(type="led", upto=first + 6, inputs=inputs)
        assert stream.text("led")["upto"] == first + 6
        solver.advance(2)
        solver.advance(3, push((0.5, 0.4), (1, 0.5), 0.1))
        solver.advance(1)
        assert other.reach(first + 6).number == first + 6
        far: dict[str, Any] = {"type": "led", "upto": first + 9}
        for bad, field in (
            ({"type": "led", "upto": -1}, "upto"),
            (
                far | {"inputs": [{"frame": first + 7, "push": hand | {"point": [0.5]}}]},
                "inputs[0].push.point",
            ),
            (far | {"inputs": [{"frame": first + 7, "push": hand | {"point": [0.5, 2]}}]}, "push.point[1]"),
            ({"type": "unlead", "digest": "x"}, "digest"),
        ):
            stream.send(**bad)
            assert field in stream.text("problem")["detail"]
        other.send(type="led", upto=first + 9)
        assert stream_problem(other) == "urn:hybridmpm:problem:lead-refused"
        stream.send(type="unlead", digest=solver.digest())
        ended = stream.text("unlead")
        assert (ended["frame"], ended["digest"]) == (first + 6, solver.digest())
        other.status(led=False, playing=True)
        stream.send(type="lead")
        stream.text("lead")
        other.send(type="push", **hand)
        assert stream.text("unlead")["reason"] == "a hand acted on the server"
        other.send(type="pause")
        other.status(playing=False)


def stream_problem(stream: Any) -> str:
    """Return the kind of the next problem."""
    return str(stream.text("problem")["problem"])


def test_the_page_gets_the_solver(service: Service) -> None:
    page = service.http.get("/")
    assert "script-src 'self' 'wasm-unsafe-eval';" in page.headers["content-security-policy"]
    answer = service.http.get("/modules/plane.wasm")
    assert (answer.headers["content-type"], answer.content[:4]) == ("application/wasm", b"\0asm")
    again = service.http.get("/modules/plane.wasm", headers={"If-None-Match": answer.headers["etag"]})
    assert again.status_code == 304
    problem(service.http.get("/modules/other.wasm"), 404)
