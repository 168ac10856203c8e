"""A simulation that several people watch and command: a thread that computes, a player, viewers."""

import asyncio
import contextlib
import logging
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from typing import Self, TypeVar

from hybridmpm import SimulationError
from hybridmpm.control import ControlledTrajectory, Sketch
from hybridmpm_service.errors import ServiceError, SessionBusyError, SessionNotFoundError
from hybridmpm_service.sessions.mailbox import Mailbox
from hybridmpm_service.sessions.pace import Pace
from hybridmpm_service.sessions.simulation import Clock, Particles, Simulation, View
from hybridmpm_service.sessions.solvers import ChosenSolver, Kind

DEFAULT_SPEED = 0.25
"""Simulated seconds per second: the eye can follow a splash at a quarter of real time."""
MIN_SPEED = 0.01
MAX_SPEED = 1.0
MAX_WAITING = 32
"""Calls that may wait for one session."""
CLOSE_DELETED = 4404
"""WebSocket close code of a session that is unknown, deleted or expired."""
_STATUS_SECONDS = 0.25
_TICK_SECONDS = 1 / 60
_TURN_SECONDS = 0.025
"""The player gives way to waiting commands after this."""

_log = logging.getLogger(__name__)
T = TypeVar("T")


class Session:
    """Made by `open`. Belongs to the event loop, which never computes.

    All work on the simulation runs on the session's own thread, in the order it was asked for. After
    each piece the thread hands a `View` to the loop, and from there it goes to the viewers.

    Attributes
    ----------
    id : str
    scenario : str or None
        None where the session was made from a scene.
    seed : int or None
    scene : Scene
    solver : Kind
        Who simulates: "mpm", "hybrid" or "neural".
    model : str or None
        Name of the network, None where there is none.
    simulation : Simulation
        Only its unchanging properties and `timing` may be used outside of this class.
    view : View
        The newest.
    last_used : float
        On the session's clock.
    """

    def __init__(self, name: str, simulation: Simulation, clock: Clock) -> None:
        self.id = name
        self.scenario: str | None = None
        self.seed: int | None = None
        self.solver: Kind = "mpm"
        self.model: str | None = None
        self.scene = simulation.scene
        self.simulation = simulation
        self.view = simulation.look()
        self.last_used = clock()
        self._clock = clock
        self._pace = Pace(self.scene.frame_dt, DEFAULT_SPEED)
        self._mailboxes: set[Mailbox] = set()
        self._playing = asyncio.Event()
        self._waiting = 0
        self._calls = 0
        self._closed = False
        self._loop = asyncio.get_running_loop()
        self._worker = ThreadPoolExecutor(max_workers=1, thread_name_prefix=f"session-{name[:8]}")
        self._tasks = [self._loop.create_task(self._play()), self._loop.create_task(self._report())]

    @classmethod
    async def open(cls, name: str, make: Callable[[], ChosenSolver], *, clock: Clock) -> Self:
        """Build scene and solver off the loop.

        Raises
        ------
        ConfigError, FieldError
            The scene or the model is refused.
        """

        def build() -> tuple[ChosenSolver, Simulation]:
            chosen = make()
            return chosen, Simulation(chosen, clock=clock)

        chosen, simulation = await asyncio.to_thread(build)
        session = cls(name, simulation, clock)
        session.solver, session.model = chosen.simulator.kind, chosen.model
        return session

    @property
    def watched(self) -> bool:
        """Whether a viewer is there."""
        return bool(self._mailboxes)

    @property
    def needed(self) -> bool:
        """Whether a viewer is there, or a call that has not been answered yet."""
        return self.watched or self._calls > 0

    @property
    def playing(self) -> bool:
        """Whether frames come by themselves."""
        return self._playing.is_set()

    @property
    def speed(self) -> float:
        """Simulated seconds per second that the player aims at."""
        return self._pace.speed

    def touch(self) -> None:
        """Note that somebody uses the session."""
        self.last_used = self._clock()

    async def advance(self, frames: int) -> None:
        """Compute frames; on failure pause at the last good one and tell the viewers.

        Raises
        ------
        SimulationError
            The frame that failed did not happen.
        SessionNotFoundError
            The session was deleted meanwhile.
        SessionBusyError
            Too many calls wait.
        """
        with self._in_use():
            await self._compute(lambda: self.simulation.advance(frames, lambda: not self._closed))

    async def steer(self, sketch: Sketch, frames: int) -> ControlledTrajectory:
        """Plan from the present state and follow the plan from there; errors as in `advance`."""
        with self._in_use():
            # A deleted session, or a server that stops, does not wait for the plan's end.
            plan = await self._on_worker(lambda: self.simulation.steer(sketch, frames, self._check_open))
        # The time that planning took is not owed to the player.
        self._pace.start(self._clock())
        return plan

    async def particles(self) -> Particles:
        """Take the state of all particles; errors as in `advance`."""
        with self._in_use():
            return await self._on_worker(self.simulation.particles)

    async def reset(self) -> None:
        """Go back to frame 0; a running player goes on from there. Errors as in `advance`."""
        with self._in_use():
            await self._on_worker(self.simulation.reset)

    def play(self) -> None:
        """Compute frames at the chosen speed until `pause`."""
        if not self.playing:
            self._pace.start(self._clock())
            self._playing.set()
            self._tell_status()

    def pause(self) -> None:
        """Stop playing after the frame that is being computed."""
        if self.playing:
            self._playing.clear()
            self._tell_status()

    def set_speed(self, speed: float) -> None:
        """Choose simulated seconds per second, in [0.01, 1]."""
        self._pace.set_speed(speed, self._clock())
        self._tell_status()

    @contextlib.contextmanager
    def viewer(self) -> Iterator[Mailbox]:
        """Lend a mailbox for frames, status and problems; it holds the newest frame at once."""
        mailbox = Mailbox()
        if self._closed:
            mailbox.close(CLOSE_DELETED, "the session has been deleted")
        mailbox.put_frame(self.view.message)
        self._mailboxes.add(mailbox)
        try:
            yield mailbox
        finally:
            self._mailboxes.discard(mailbox)
            self.touch()

    def end_streams(self, code: int, reason: str) -> None:
        """Send all viewers away with a WebSocket close code."""
        for mailbox in self._mailboxes:
            mailbox.close(code, reason)

    async def close(self, code: int, reason: str, *, wait: bool = False) -> None:
        """End the player and all streams; calls that wait fail with SessionNotFoundError.

        With `wait` the thread has ended afterwards.
        """
        self._closed = True
        self._playing.clear()
        for task in self._tasks:
            task.cancel()
        self.end_streams(code, reason)
        if wait:
            await asyncio.to_thread(self._worker.shutdown, wait=True)
        else:
            self._worker.shutdown(wait=False)

    @contextlib.contextmanager
    def _in_use(self) -> Iterator[None]:
        """Keep the session from expiring while a call that came from outside is worked on."""
        self._calls += 1
        try:
            yield
        finally:
            self._calls -= 1
            self.touch()

    async def _compute(self, job: Callable[[], int]) -> int:
        try:
            return await self._on_worker(job)
        except SimulationError as err:
            self._stop_with(err)
            raise

    def _stop_with(self, problem: Exception) -> None:
        self._playing.clear()
        for mailbox in self._mailboxes:
            mailbox.put_problem(problem)
        self._tell_status()

    async def _on_worker(self, job: Callable[[], T]) -> T:
        if self._waiting >= MAX_WAITING:
            raise SessionBusyError(f"{MAX_WAITING} calls already wait for session {self.id!r}")
        self._check_open()

        def run() -> T:
            self._check_open()
            try:
                result = job()
            finally:
                # Also after a failure, and when nobody awaits the result any more.
                self._loop.call_soon_threadsafe(self._show, self.simulation.look())
            self._check_open()
            return result

        self._waiting += 1
        try:
            return await self._loop.run_in_executor(self._worker, run)
        finally:
            self._waiting -= 1

    def _check_open(self) -> None:
        if self._closed:
            raise SessionNotFoundError(f"session {self.id!r} has been deleted")

    def _show(self, view: View) -> None:
        turned = (self.view.control is None, self.view.mode) != (view.control is None, view.mode)
        self.view = view
        for mailbox in self._mailboxes:
            mailbox.put_frame(view.message)
        # A player changes the view all the time; its status comes from `_report`.
        if turned or not self.playing:
            self._tell_status()

    def _tell_status(self) -> None:
        for mailbox in self._mailboxes:
            mailbox.put_status()

    async def _report(self) -> None:
        while True:
            await asyncio.sleep(_STATUS_SECONDS)
            self._tell_status()

    async def _play(self) -> None:
        while True:
            await self._playing.wait()
            next_tick = self._clock() + _TICK_SECONDS
            try:
                self._pace.count(await self._turn(self._pace.due(self._clock())))
            except (SimulationError, SessionBusyError):
                # The first is told and has paused the player; after the second it tries again.
                pass
            except Exception:  # noqa: BLE001 - told to the viewers; the player must live on
                _log.exception("the player of session %s failed", self.id)
                self._stop_with(
                    ServiceError("the player failed and is paused; the cause is in the server's log")
                )
            now = self._clock()
            await asyncio.sleep(max(0.0, next_tick - now, self._pace.wait(now)))

    async def _turn(self, frames: int) -> int:
        if frames == 0:
            return 0

        def turn() -> int:
            # Counted from when the thread is free: else a player that had to queue would get no frame.
            deadline = self._clock() + _TURN_SECONDS
            return self.simulation.advance(frames, lambda: self.playing and self._clock() < deadline)

        return await self._compute(turn)
