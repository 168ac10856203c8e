"""All sessions of a process: how many may exist, and when an unused one ends."""

import asyncio
import time
import uuid
from collections.abc import Callable
from pathlib import Path
from typing import TypeVar

from hybridmpm import Scene
from hybridmpm._support.machine import usable_cores
from hybridmpm.physics.manifest import WEIGHTS
from hybridmpm_service.errors import SessionNotFoundError, TooManySessionsError, UnavailableError
from hybridmpm_service.sessions.admission import Machine, estimated_frame_seconds, within_limits
from hybridmpm_service.sessions.pace import Clock
from hybridmpm_service.sessions.player import DEFAULT_SPEED
from hybridmpm_service.sessions.session import CLOSE_DELETED, Session
from hybridmpm_service.sessions.simulation import Simulation
from hybridmpm_service.sessions.solvers import ChosenSolver, SolverChoice, SolverFactory
from hybridmpm_service.settings import Settings

CLOSE_GOING_AWAY = 1001
"""WebSocket close code of a server that stops."""
_ENDING_SECONDS = 0.5
"""Longest time that a call waits for the threads of a session that it ends; they need some milliseconds."""

T = TypeVar("T")


class SessionManager:
    """Creates, finds and ends sessions. Belongs to the event loop.

    Parameters
    ----------
    settings : Settings
    clock : Clock
        Clock for idle times, players and rates of messages; a test hands in its own.

    Attributes
    ----------
    clock : Clock
    draining : asyncio.Event
        Set once the server stops: no session can be created then, and all have been closed.

    Raises
    ------
    DataError
        The folder of models has no manifest, or a damaged one.
    """

    def __init__(self, settings: Settings, clock: Clock = time.perf_counter) -> None:
        self._settings = settings
        self.clock = clock
        self.draining = asyncio.Event()
        self._solvers = SolverFactory(
            threads=settings.threads, folder=Path(settings.models) if settings.models else WEIGHTS
        )
        self._machine = Machine(settings.max_load or usable_cores(), settings.threads)
        self._sessions: dict[str, Session] = {}
        self._ending: set[asyncio.Task[None]] = set()
        self._being_made = 0

    @property
    def solvers(self) -> SolverFactory:
        """Factory that makes the simulators of sessions and knows the models."""
        return self._solvers

    async def create(
        self,
        make_scene: Callable[[], Scene],
        *,
        scenario: str | None = None,
        seed: int | None = None,
        choice: SolverChoice | None = None,
    ) -> Session:
        """Start a session.

        Parameters
        ----------
        make_scene : callable
            Returns the scene. It is called off the event loop, since drawing a scene takes time.
        scenario, seed : optional
            Where the scene comes from, if it is drawn.
        choice : SolverChoice, optional
            Simulator of the session; MPM if absent.

        Raises
        ------
        TooManySessionsError
            All sessions that the settings allow are in use.
        MachineFullError
            The sessions that play leave too little time for it, by the estimate of its frames.
        UnavailableError
            The server is shutting down.
        ConfigError, FieldError, ModelDamagedError
            The scene, the rung or the model is refused.
        """
        await self._check_room()

        def make() -> tuple[ChosenSolver, Simulation, float]:
            scene = within_limits(make_scene(), self._settings)
            chosen = self._solvers.make(choice or SolverChoice(), scene, scenario)
            estimate = estimated_frame_seconds(scene)
            if chosen.simulator.kind == "mpm":
                estimate *= chosen.simulator.r_p
            load = self._machine.load_of(estimate, scene.frame_dt, DEFAULT_SPEED)
            self._machine.check(load, "a new session of this scene")
            return chosen, Simulation(chosen, clock=self.clock), estimate

        making = asyncio.get_running_loop().run_in_executor(None, make)
        chosen, simulation, estimate = await self._made(making)
        session = self._begin(simulation, estimate)
        session.solver, session.rung, session.model = chosen.simulator.kind, chosen.rung, chosen.model
        session.scenario, session.seed = scenario, seed
        return session

    async def fork(self, name: str) -> Session:
        """Start a session that goes on from the present state of another, by itself.

        It is paused, at the speed of the other, and a sketch that steers the other steers it too: the same
        inputs give the same bits from then on. A hand that pushes stays with the viewer that it belongs to,
        and a sketch that is still being prepared with the session that it was drawn in.

        Raises
        ------
        SessionNotFoundError, SessionBusyError
            As `get` and `Session.advance`.
        TooManySessionsError, MachineFullError, UnavailableError
            As `create`; the load of the other session is the estimate of the fork's.
        """
        origin = self.get(name)
        await self._check_room()
        self._machine.check(origin.load, "a fork of this session")
        simulation = await self._made(asyncio.ensure_future(origin.fork()))
        session = self._begin(simulation, origin.frame_seconds)
        session.solver, session.rung, session.model = origin.solver, origin.rung, origin.model
        session.scenario, session.seed = origin.scenario, origin.seed
        session.set_speed(origin.speed)
        return session

    def get(self, name: str) -> Session:
        """Return a session and note that it is used.

        Raises
        ------
        SessionNotFoundError
            The session does not exist, or no longer.
        UnavailableError
            The server is shutting down.
        """
        if self.draining.is_set():
            raise UnavailableError("the server is shutting down")
        session = self._sessions.get(name)
        if session is None or self._is_idle(session):
            raise SessionNotFoundError(
                f"there is no session {name[:64]!r}; it may have been deleted, or have expired after "
                f"{self._settings.idle_seconds:g} s without use"
            )
        session.touch()
        return session

    def all(self) -> list[Session]:
        """Return the sessions, oldest first."""
        return [session for session in self._sessions.values() if not self._is_idle(session)]

    async def delete(self, name: str) -> None:
        """End a session, and wait until its threads have ended, but not for long.

        Raises
        ------
        SessionNotFoundError
            The session does not exist, or no longer.
        """
        session = self.get(name)
        del self._sessions[session.id]
        await _soon([self._end(session, CLOSE_DELETED, "the session has been deleted")])

    async def expire(self) -> None:
        """End the sessions that no client has watched or called for `idle_seconds`; wait as `delete` does."""
        idle = [session for session in self._sessions.values() if self._is_idle(session)]
        for session in idle:
            del self._sessions[session.id]
        await _soon([self._end(session, CLOSE_DELETED, "the session has expired") for session in idle])

    def why_full(self) -> UnavailableError | None:
        """Return why no session can be created now; None if one can."""
        if self.draining.is_set():
            return UnavailableError("the server is shutting down")
        limit = self._settings.max_sessions
        # Sessions that end hold memory and a processor as long as their threads run.
        if len(self.all()) + self._being_made + len(self._ending) >= limit:
            return TooManySessionsError(
                f"all {limit} sessions are in use; delete one, or wait until one expires"
            )
        return self._machine.full()

    @property
    def watched(self) -> bool:
        """Whether any session has a viewer."""
        return any(session.watched for session in self._sessions.values())

    def drain(self) -> None:
        """Create no more sessions, and close all, their streams with code 1001; a stop begins with this."""
        self.draining.set()
        for session in self._sessions.values():
            session.close(CLOSE_GOING_AWAY, "the server stops")

    async def close(self) -> None:
        """End all sessions, and wait for their threads and for those of sessions that ended before."""
        self.drain()
        while self._sessions:
            _, session = self._sessions.popitem()
            self._end(session, CLOSE_GOING_AWAY, "the server stops")
        await asyncio.gather(*self._ending)

    async def _check_room(self) -> None:
        """Raise if no session can be created now."""
        await self.expire()
        refusal = self.why_full()
        if refusal is not None:
            raise refusal

    def _begin(self, simulation: Simulation, estimate: float) -> Session:
        if self.draining.is_set():
            raise UnavailableError("the server is shutting down")
        session = Session(uuid.uuid4().hex, simulation, self.clock, machine=self._machine, estimate=estimate)
        self._sessions[session.id] = session
        return session

    async def _made(self, making: asyncio.Future[T]) -> T:
        """Wait for a simulation, and count it until it is made, also for a caller that has gone."""

        def end(making: asyncio.Future[T]) -> None:
            self._being_made -= 1
            # Asked for, so that nobody misses the error of a caller that has gone.
            making.exception()

        self._being_made += 1
        making.add_done_callback(end)
        return await asyncio.shield(making)

    def _end(self, session: Session, code: int, reason: str) -> asyncio.Task[None]:
        """Close a session, and remember it until its threads have ended."""
        session.close(code, reason)
        ending = asyncio.get_running_loop().create_task(session.ended())
        self._ending.add(ending)
        ending.add_done_callback(self._ending.discard)
        return ending

    def _is_idle(self, session: Session) -> bool:
        unused = self.clock() - session.last_used
        return not session.needed and unused > self._settings.idle_seconds


async def _soon(endings: list[asyncio.Task[None]]) -> None:
    """Wait for sessions that end, but not for long: what takes longer goes on, and is counted."""
    if endings:
        await asyncio.wait(endings, timeout=_ENDING_SECONDS)
