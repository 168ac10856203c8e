"""A simulation that several clients watch and command: threads that compute, a player, viewers."""

import asyncio
import contextlib
import logging
from collections.abc import Callable, Iterator, Sequence
from typing import Any, TypeVar

from hybridmpm import CancelFlag, SimulationError
from hybridmpm.checking import Finding
from hybridmpm.control import Led, Pull, Push
from hybridmpm.recording import Recording
from hybridmpm.simulator import Simulator
from hybridmpm_service.errors import LeadRefusedError, ServiceError, SessionNotFoundError
from hybridmpm_service.sessions.inputs import Goals, HandInput, Origin
from hybridmpm_service.sessions.journal import Kept
from hybridmpm_service.sessions.lead import SILENT_SECONDS, Lead, hand_of, note
from hybridmpm_service.sessions.player import Clock, Machine, Player
from hybridmpm_service.sessions.revival import SessionLog, log_of
from hybridmpm_service.sessions.simulation import Simulation
from hybridmpm_service.sessions.steering import Steered
from hybridmpm_service.sessions.turns import Turns
from hybridmpm_service.sessions.view import CellMeans, Control, Particles, View
from hybridmpm_service.sessions.viewers import Audience, Mailbox
from hybridmpm_service.sessions.work import Check, Planner, Worker

CLOSE_DELETED = 4404
"""WebSocket close code of a session that is unknown, deleted or expired."""
_STATUS_SECONDS = 0.25
"""Time between two status messages."""

_log = logging.getLogger(__name__)
T = TypeVar("T")


class Session:
    """A simulation with a thread, a player and viewers. Belongs to the event loop.

    The event loop never computes. All work on the simulation runs on the session's own thread, in the order
    of the calls. After each piece of work the thread passes a `View` to the loop, which sends it to the
    viewers. Sketches are prepared on copies of the simulator, in turns with all expensive work of the
    service, as is other work on copies. A flag that is read in every substep ends a frame when the session is
    closed.

    Parameters
    ----------
    name : str
        Its `id`.
    simulation : Simulation
        It may not be used elsewhere from now on.
    origin : Origin
        Scene and simulator at frame 0.
    clock : Clock
        Clock of the player and of `last_used`.
    machine : Machine
        Limits the load of the sessions that play.
    turns : Turns
        Limit the work on copies.
    estimate : float
        Estimated time of a frame [s], before one has been measured.
    notice : str, optional
        Remark on a simulation that was computed again.
    findings : tuple of Finding
        Static findings of the scene.
    owner : str
        Key that the session belongs to; empty without keys.

    Attributes
    ----------
    scene : Scene
        Scene that is simulated.
    simulation : Simulation
        Outside of this class only its unchanging properties, `frame_seconds` and `timing` may be used.
    view : View
        The newest view.
    audience : Audience
        Viewers; only those that join by `viewer` can keep the session alive.
    last_used : float
        Time of the latest use, on the session's clock [s].
    ends_at : float or None
        Time at which the session ends, on its clock [s]; None where its client has not left it.
    """

    def __init__(
        self,
        name: str,
        simulation: Simulation,
        origin: Origin,
        clock: Clock,
        *,
        machine: Machine,
        turns: Turns,
        estimate: float,
        notice: str | None = None,
        findings: tuple[Finding, ...] = (),
        owner: str = "",
    ) -> None:
        self.id, self.owner = name, owner
        self.origin = origin
        self.notice = notice
        self.findings = findings
        self.scene = simulation.scene
        self.simulation = simulation
        self.view = simulation.view()
        self.audience = Audience()
        self.last_used = clock()
        self.ends_at: float | None = None
        self._clock = clock
        self._estimate = estimate
        self._player = Player(
            self.scene.frame_dt,
            clock,
            machine=machine,
            frame_seconds=lambda: self.frame_seconds,
            compute=self._compute,
            behind=self._behind,
            hurried=lambda: self._worker.in_demand,
            on_fault=self._on_player_fault,
            owner=owner,
        )
        self._pusher: Mailbox | None = None
        self._lead: Lead | None = None
        self._calls = 0
        self._closed = False
        self._cancel = CancelFlag()
        self._loop = asyncio.get_running_loop()
        self._worker = Worker(name, self._check_open, self._cancel)
        self._planner = Planner(
            turns=turns,
            number=simulation.journal.sketches,
            check_open=self._check_open,
            on_change=self.audience.post_status,
        )
        self._tasks = [self._loop.create_task(self._player.run()), self._loop.create_task(self._report())]

    @property
    def watched(self) -> bool:
        """Whether the session has a viewer."""
        return bool(self.audience)

    @property
    def needed(self) -> bool:
        """Whether the session has a viewer, or a call that has not been answered yet."""
        return self.watched or self._calls > 0

    @property
    def kept(self) -> Kept:
        """Storage of the session."""
        return self.simulation.journal.kept

    @property
    def links(self) -> int:
        """Number of times that links to the session were taken back."""
        return self.simulation.journal.links

    @property
    def control(self) -> Control | None:
        """The newest sketch and its progress; None where there was none since frame 0."""
        return self._planner.control or self.view.control

    @property
    def playing(self) -> bool:
        """Whether the player computes frames."""
        return self._player.playing

    @property
    def led(self) -> bool:
        """Whether the tab of a viewer computes the frames first."""
        return self._lead is not None

    @property
    def speed(self) -> float:
        """Target speed of the player: simulated seconds per second."""
        return self._player.speed

    @property
    def frame_seconds(self) -> float:
        """Time of a frame [s]: measured, or estimated before the first frame."""
        measured = self.simulation.frame_seconds
        return self._estimate if measured is None else measured

    @property
    def load(self) -> float:
        """Load of the session on the machine if it plays at its speed [cores]."""
        return self._player.load_at(self.speed)

    def touch(self) -> None:
        """Note a use of the session by a client."""
        self.last_used = self._clock()

    async def advance(self, frames: int) -> View:
        """Compute frames, and return the view after them, which survives a crash.

        If a frame fails, the player pauses and the viewers get the problem. A cancelled call ends the
        computation after the current frame.

        Raises
        ------
        SimulationError
            A frame failed; the state is the one before it.
        SessionNotFoundError
            The session was deleted meanwhile.
        SessionBusyError
            Too many calls wait for the session.
        """
        self.end_lead("frames were asked for")
        abandoned = False

        def compute() -> View:
            self.simulation.advance(frames, lambda: not abandoned)
            return self._reported(self.simulation.view())

        with self._in_use():
            try:
                return await self._computed(compute)
            except asyncio.CancelledError:
                abandoned = True
                raise

    async def steer(self, sketch: Goals, *, most: int, **settings: Any) -> Steered:
        """Prepare a sketch on a copy of the simulator, and let it steer from the next frame on.

        The session goes on meanwhile, steered by an older sketch. A preparation before this one is dropped.

        Parameters
        ----------
        sketch : Arrow, Ellipse, Shape or list of Keyframe
        most : int
            Largest number of frames, above that of `hold`.
        **settings
            As `hybridmpm.control.plan_motion` takes them.

        Raises
        ------
        SketchDroppedError
            A newer sketch, `release` or `reset` came before the preparation had ended.
        ConfigError, SketchError, SimulationError
            As `prepare`; nothing has changed.
        SessionNotFoundError, SessionBusyError
            As in `advance`.
        """
        self.end_lead("a sketch is planned")
        preparation, number = self._planner.begin(sketch)

        def take_over(guidance: Led) -> Steered:
            preparation.check()
            return self.simulation.steer(guidance, number, settings | {"most": most})

        try:
            with self._in_use():
                twin = await self._on_worker(self.simulation.copy)
                guidance = await self._planner.prepare(preparation, twin, sketch, most=most, **settings)
                return await self._on_worker(lambda: take_over(guidance))
        except asyncio.CancelledError:
            preparation.drop("its client has gone")
            raise
        finally:
            self._planner.end(preparation)

    async def on_copy(self, work: Callable[[Simulator, Check], T], *, memory: int | None = None) -> T:
        """Do work on a copy of the simulator while the session goes on; see `Planner.on_copy`."""
        with self._in_use():
            twin = await self._on_worker(self.simulation.copy)
            return await self._planner.on_copy(lambda check: work(twin, check), memory=memory)

    async def release(self) -> None:
        """End the sketch that steers; drop one that is being prepared. Errors as in `advance`."""
        self.end_lead("the sketch was taken back")
        self._planner.drop("the sketch was taken back before it began to steer")
        await self._call(self.simulation.release)

    def push(self, force: Push | Pull | None, by: Mailbox) -> None:
        """Let a viewer's hand act from the next frame on, until the next call or the viewer leaves.

        Parameters
        ----------
        force : Push, Pull or None
            Force on the fluid near it, or on a rigid body, which replaces the one before; None ends it.
        by : Mailbox
            Mailbox of the viewer.
        """
        self.simulation.hand = force
        self._pusher = None if force is None else by

    async def lead(self, by: Mailbox) -> None:
        """Let the tab of a viewer compute the frames from now on; its mailbox gets the state to begin with.

        The session goes on playing, and computes what `follow` notes. Whatever else changes it ends the lead.

        Parameters
        ----------
        by : Mailbox
            Mailbox of the viewer.

        Raises
        ------
        LeadRefusedError
            The session is paused, a network moves the particles, a sketch is planned or steers by a law that
            tabs do not have, or another viewer leads or pushes.
        SessionNotFoundError, SessionBusyError
            As in `advance`.
        """
        if self.simulation.kind != "mpm":
            raise LeadRefusedError("a tab computes frames of MPM alone: networks run on servers only")
        if not self.playing:
            raise LeadRefusedError("the session is paused: send play first")
        if self._lead is not None and self._lead.by is not by:
            raise LeadRefusedError("another viewer's tab computes the frames: watch them, or try again later")
        if self._pusher not in (None, by):
            raise LeadRefusedError("another viewer's hand pushes: try again when it has let go")
        if self._planner.control is not None:
            raise LeadRefusedError("a sketch is planned: try again when it steers")
        self._lead = lead = Lead(by)

        def begin() -> None:
            frame, digest = self.simulation.frame, self.simulation.particles().digest()
            self.simulation.ways()  # refuses a sketch that the tab cannot follow
            hand, until = self.simulation.note_hand(), self.simulation.steered_until
            self._reported(frame)
            told = {"digest": digest, "steered_until": until, **hand_of(hand)}
            self._loop.call_soon_threadsafe(begun, frame, told)

        def begun(frame: int, told: dict[str, Any]) -> None:
            if self._lead is lead:
                lead.upto, lead.silent = frame, 0
                types = [material.type_id for material in self.scene.materials]
                by.put_text(note("lead", frame=frame, types=types, **told))

        try:
            await self._call(begin)
        except BaseException:
            self._lead = None if self._lead is lead else self._lead
            raise
        self.audience.post_status()

    async def follow(self, upto: int, inputs: Sequence[HandInput], by: Mailbox) -> None:
        """Note the frames that the leading tab has computed; the player computes them as well.

        Parameters
        ----------
        upto : int
            Latest frame of the tab.
        inputs : sequence of PushInput and PullInput
            Those of these frames.
        by : Mailbox
            Mailbox of the viewer, which gets an answer once nothing of it can be lost.

        Raises
        ------
        LeadRefusedError
            The viewer does not lead, or no longer.
        FieldError
            Frames are not in order, or too far ahead.
        SessionNotFoundError, SessionBusyError
            As in `advance`.
        """
        lead = self._led_by(by)
        lead.check(upto, inputs, self.view.frame)
        lead.upto, lead.silent = upto, 0
        if inputs:
            self.push(inputs[-1].force(), by)

        def promise() -> None:
            self.simulation.promise(upto, inputs)

        await self._worker.run(promise)
        by.put_text(note("led", upto=upto, frame=self.view.frame))

    async def unlead(self, by: Mailbox, digest: str | None, *, pause: bool = False) -> None:
        """Let the session go on alone from the latest frame of the leading tab.

        Parameters
        ----------
        by : Mailbox
            Mailbox of the viewer, which gets the session's own digest.
        digest : str or None
            Digest of the tab's state in that frame. Where it is another, the session's state counts.
        pause : bool
            Whether the player stops at that frame.

        Raises
        ------
        LeadRefusedError
            The viewer does not lead, or no longer.
        SimulationError, SessionNotFoundError, SessionBusyError
            As in `advance`.
        """
        lead = self._led_by(by)
        lead.ends = True
        if pause:
            self._player.stop()
        particles = await self.particles()
        own = particles.digest()
        if digest not in (None, own):
            _log.warning(
                "session %s: a tab computed another state of frame %s, %s instead of %s",
                self.id,
                particles.frame,
                digest,
                own,
            )
        if self._lead is lead:
            self._end_lead("asked for", frame=particles.frame, digest=own)

    def _led_by(self, by: Mailbox) -> Lead:
        """Return the lead of a viewer who has got the state to begin with."""
        lead = self._lead
        if lead is None or lead.by is not by or lead.upto is None:
            raise LeadRefusedError("this viewer's tab does not compute the frames: send lead first")
        return lead

    def end_lead(self, why: str) -> None:
        """Let the session go on alone from the latest frame that a leading tab has reported, if one leads."""
        if self._lead is not None:
            self._end_lead(why)

    def _end_lead(self, why: str, **content: Any) -> None:
        lead, self._lead = self._lead, None
        if lead is None:
            return
        content.setdefault("frame", lead.upto)
        lead.by.put_text(note("unlead", reason=why, **content))
        self.audience.post_status()
        if not self.simulation.behind:
            lead.by.put_frame(self.view.message)
        else:
            task = self._loop.create_task(self._catch_up())
            self._tasks.append(task)
            task.add_done_callback(self._tasks.remove)

    async def _catch_up(self) -> None:
        """Compute what a tab has computed that leads no longer, where nothing else does so."""
        with contextlib.suppress(SimulationError, ServiceError):
            await self._computed(lambda: None)

    def _behind(self) -> int | None:
        """Return how many frames a tab is ahead; None where the session goes on alone."""
        behind = self.simulation.behind
        return behind if behind or self._lead is not None else None

    async def start_file(self) -> tuple[int, str, bytes]:
        """Return the frame, the digest and the start file of the present state; errors as in `advance`.

        Raises
        ------
        LeadRefusedError
            A network moves the particles, or may.
        """
        return await self._call(self.simulation.start_file)

    async def ways(self) -> bytes:
        """Return what a tab follows from the present frame on; errors as in `advance`.

        Raises
        ------
        LeadRefusedError
            The law of the sketch is none of those that tabs have.
        """
        return await self._call(self.simulation.ways)

    async def particles(self) -> Particles:
        """Return the state of all particles; errors as in `advance`."""
        return await self._call(lambda: self._reported(self.simulation.particles()))

    async def recording(self) -> Recording:
        """Return a recording of the present state alone; errors as in `advance`."""
        return await self._call(self.simulation.recording)

    async def force(self) -> CellMeans:
        """Return the force of sketch and hand in the next frame; errors as in `advance`."""
        return await self._call(self.simulation.force)

    async def pressure(self) -> CellMeans:
        """Return the pressure; errors as in `advance` and of `Simulation.pressure`."""
        return await self._call(self.simulation.pressure)

    async def log(self) -> SessionLog:
        """Return the log of the session; errors as in `advance` and `log_of`."""
        return await self._call(lambda: self._reported(log_of(self.origin, self.simulation)))

    async def fork(self) -> Simulation:
        """Return an independent simulation in the present state; errors as in `advance`."""
        return await self._call(self.simulation.fork)

    async def reset(self) -> None:
        """Return to frame 0; a running player continues from there. Errors as in `advance`."""
        self.end_lead("the session went back to its start")
        self._planner.drop("the session went back to its start before the sketch began to steer")
        await self._call(self.simulation.reset)

    async def take_links_back(self) -> None:
        """Let no link to the session be valid that was made before. Errors as in `advance`."""
        await self._call(self.simulation.journal.take_links_back)

    def play(self) -> None:
        """Compute frames at the chosen speed until `pause`, or until the last viewer leaves.

        Raises
        ------
        MachineFullError
            Other sessions leave too little of the machine's time.
        """
        if not self.playing:
            self._player.start()
            self.audience.post_status()

    def pause(self) -> None:
        """Stop playing after the current frame."""
        if self.playing:
            self._player.stop()
            self.end_lead("the session is paused")
            self.audience.post_status()

    def set_speed(self, speed: float) -> None:
        """Choose simulated seconds per second, in [0.01, 1].

        Raises
        ------
        MachineFullError
            The session plays, and other sessions leave too little time for it to play faster.
        """
        self._player.set_speed(speed)
        self.audience.post_status()

    @contextlib.contextmanager
    def viewer(self) -> Iterator[Mailbox]:
        """Return a mailbox of frames, status and problems; at first it contains the newest frame."""
        mailbox = self.audience.join()
        if self._closed:
            mailbox.close(CLOSE_DELETED, "the session has been deleted")
        mailbox.put_frame(self.view.message)
        try:
            yield mailbox
        finally:
            self.audience.leave(mailbox)
            if self._lead is not None and self._lead.by is mailbox:
                self.end_lead("its viewer left")
            if self._pusher is mailbox:
                self.push(None, mailbox)
            if not self.watched:
                self.pause()
            self.touch()

    def close(self, code: int, reason: str, *, keep: bool) -> None:
        """End the player and all streams; calls that wait fail with SessionNotFoundError.

        The threads end within a substep of their frames: see `ended`. The file is brought up to date then,
        or, unless `keep` is set, deleted at once; a StorageError says that it cannot be, and changes nothing.
        """
        if self._closed:
            return
        journal = self.simulation.journal
        if not keep:
            journal.discard()
        self._closed = True
        self._cancel.set()
        self._player.end()
        for task in self._tasks:
            task.cancel()
        self.audience.close(code, reason)
        self._planner.stop()

        def last() -> None:
            if keep:
                journal.check(self.simulation.computed_seconds, self.simulation.checkpoint)
            journal.close()

        self._worker.end(last)

    async def ended(self) -> None:
        """Wait until the threads of a closed session have ended."""
        await asyncio.gather(self._planner.ended(), self._worker.ended())

    @contextlib.contextmanager
    def _in_use(self) -> Iterator[None]:
        """Keep the session from expiring while a client's call is worked on."""
        self._calls += 1
        try:
            yield
        finally:
            self._calls -= 1
            self.touch()

    async def _compute(self, frames: int, go_on: Callable[[], bool]) -> int:
        """Compute frames as long as `go_on()` is true before each; return their number."""
        return await self._computed(lambda: self.simulation.advance(frames, go_on), catches_up=False)

    async def _computed(self, job: Callable[[], T], *, catches_up: bool = True) -> T:
        """Run a job that computes frames; if one fails, the player stops."""
        try:
            return await self._on_worker(job, catches_up=catches_up)
        except SimulationError as err:
            self._stop_with(err)
            raise

    def _reported(self, answer: T) -> T:
        """Return an answer, and note its frame: what a client has seen survives a crash."""
        self.simulation.journal.mark(self.simulation.frame)
        return answer

    def _on_player_fault(self) -> None:
        _log.exception("the player of session %s failed", self.id)
        self._stop_with(ServiceError("the player failed and is paused; the cause is in the server's log"))

    def _stop_with(self, problem: Exception) -> None:
        """Pause the player and send a problem to the viewers."""
        self._player.stop()
        self.end_lead("a frame failed")
        self.audience.post_problem(problem)
        self.audience.post_status()

    async def _call(self, job: Callable[[], T]) -> T:
        """Run a job of a client's call on the session's thread; return its result."""
        with self._in_use():
            return await self._on_worker(job)

    async def _on_worker(self, job: Callable[[], T], *, catches_up: bool = True) -> T:
        """Run a job on the session's thread after earlier ones; return its result.

        Before, the session computes all frames that a leading tab has computed, unless `catches_up` is unset.
        """

        def run() -> T:
            try:
                if catches_up:
                    self.simulation.catch_up()
                return job()
            finally:
                # Viewers see the state after a failure, too, and after a cancelled call.
                self._loop.call_soon_threadsafe(self._publish, self.simulation.view())

        return await self._worker.run(run)

    def _check_open(self) -> None:
        if self._closed:
            raise SessionNotFoundError(f"session {self.id!r} has been deleted")

    def _publish(self, view: View) -> None:
        """Take a new view and post it to the viewers."""
        before, self.view = self.view, view
        self.audience.post_frame(view.message, but=None if self._lead is None else self._lead.by)
        other_control = _phase(before) != _phase(view)
        # While the player changes the view all the time, `_report` posts the status.
        if other_control or before.mode != view.mode or not self.playing:
            self.audience.post_status()

    async def _report(self) -> None:
        """Post the status regularly, and keep a session that rests, until this task is cancelled."""
        before = 0.0
        while True:
            await asyncio.sleep(_STATUS_SECONDS)
            self.audience.post_status()
            if self._lead is not None and not self._lead.ends:
                # Counted in turns of this loop: while the loop is late, messages wait unread.
                self._lead.silent += 1
                if self._lead.silent * _STATUS_SECONDS > SILENT_SECONDS:
                    self.end_lead(f"its tab was silent for {SILENT_SECONDS:g} s")
            now = self.simulation.computed_seconds
            rests = now == before and not self._worker.busy
            before = now
            if rests and self.simulation.journal.is_behind(now, resting=True):
                await self._keep()

    async def _keep(self) -> None:
        """Write what a session that rests has computed to its file."""
        simulation = self.simulation

        def settle() -> None:
            simulation.journal.settle(simulation.computed_seconds, simulation.checkpoint, resting=True)

        try:
            await self._worker.run(settle)
        except ServiceError:
            pass  # It was closed meanwhile, and is kept then, or calls wait.
        except Exception:  # noqa: BLE001 - the next attempt may succeed, and reports must go on
            _log.exception("session %s cannot be kept", self.id)


def _phase(view: View) -> tuple[int, str] | None:
    return None if view.control is None else (view.control.number, view.control.phase)
