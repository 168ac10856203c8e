"""All sessions of a process: how many may exist, and when an unused one ends."""

import asyncio
import time
import uuid
from collections.abc import Callable
from pathlib import Path

from hybridmpm import Scene, SceneError
from hybridmpm.physics.manifest import WEIGHTS
from hybridmpm_service.errors import SessionNotFoundError, TooManySessionsError, UnavailableError
from hybridmpm_service.sessions.pace import Clock
from hybridmpm_service.sessions.session import CLOSE_DELETED, Session
from hybridmpm_service.sessions.solvers import SolverChoice, SolverFactory
from hybridmpm_service.settings import Settings

CLOSE_GOING_AWAY = 1001
"""WebSocket close code of a server that stops."""


class SessionManager:
    """Creates, finds and ends sessions. Belongs to the event loop.

    Parameters
    ----------
    settings : Settings
    clock : Clock
        Clock for idle times and players; a test hands in its own.

    Raises
    ------
    DataError
        The folder of models has no manifest, or a damaged one.
    """

    def __init__(self, settings: Settings, clock: Clock = time.perf_counter) -> None:
        self._settings = settings
        self._clock = clock
        self._solvers = SolverFactory(
            threads=settings.threads, folder=Path(settings.models) if settings.models else WEIGHTS
        )
        self._sessions: dict[str, Session] = {}
        self._ending: set[asyncio.Task[None]] = set()
        self._being_made = 0
        self._draining = False

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
        UnavailableError
            The server is shutting down.
        ConfigError, FieldError, ModelDamagedError
            The scene or the model is refused.
        """
        await self.expire()
        reason = self.why_full()
        if reason is not None:
            raise (UnavailableError if self._draining else TooManySessionsError)(reason)
        self._being_made += 1
        try:
            session = await Session.open(
                uuid.uuid4().hex,
                lambda: self._solvers.make(
                    choice or SolverChoice(), self._within_limits(make_scene()), scenario
                ),
                clock=self._clock,
            )
        finally:
            self._being_made -= 1
        if self._draining:
            self._end(session, CLOSE_GOING_AWAY, "the server stops")
            raise UnavailableError("the server is shutting down")
        session.scenario, session.seed = scenario, seed
        self._sessions[session.id] = session
        return session

    def get(self, name: str) -> Session:
        """Return a session and note that it is used.

        Raises
        ------
        SessionNotFoundError
            The session does not exist, or no longer.
        """
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
        """End a session.

        Raises
        ------
        SessionNotFoundError
            The session does not exist, or no longer.
        """
        session = self.get(name)
        del self._sessions[session.id]
        self._end(session, CLOSE_DELETED, "the session has been deleted")

    async def expire(self) -> None:
        """End the sessions that no client has watched or called for `idle_seconds`."""
        for session in list(self._sessions.values()):
            if self._is_idle(session):
                del self._sessions[session.id]
                self._end(session, CLOSE_DELETED, "the session has expired")

    def why_full(self) -> str | None:
        """Return why no session can be created now; None if one can."""
        if self._draining:
            return "the server is shutting down"
        limit = self._settings.max_sessions
        if len(self.all()) + self._being_made >= limit:
            return f"all {limit} sessions are in use; delete one, or wait until one expires"
        return None

    @property
    def watched(self) -> bool:
        """Whether any session has a viewer."""
        return any(session.watched for session in self._sessions.values())

    def drain(self) -> None:
        """Create no more sessions, and close all streams with code 1001; a stop begins with this."""
        self._draining = True
        for session in self._sessions.values():
            session.end_streams(CLOSE_GOING_AWAY, "the server stops")

    async def close(self) -> None:
        """End all sessions, and wait for their threads and for those of sessions that ended before."""
        self.drain()
        while self._sessions:
            _, session = self._sessions.popitem()
            self._end(session, CLOSE_GOING_AWAY, "the server stops")
        await asyncio.gather(*self._ending)

    def _end(self, session: Session, code: int, reason: str) -> None:
        """Close a session, and remember it until its thread has ended."""
        session.close(code, reason)
        ending = asyncio.get_running_loop().create_task(session.ended())
        self._ending.add(ending)
        ending.add_done_callback(self._ending.discard)

    def _is_idle(self, session: Session) -> bool:
        unused = self._clock() - session.last_used
        return not session.needed and unused > self._settings.idle_seconds

    def _within_limits(self, scene: Scene) -> Scene:
        """Return the scene with the particle limit of this service; refuse a scene that it cannot serve."""
        for field in ("emitters", "sinks"):
            if getattr(scene, field):
                text = "are not served: a session has the same particles throughout; run `hybridmpm simulate`"
                raise SceneError.of([(field, text)])
        most = self._settings.max_grid_nodes
        nodes = (scene.resolution + 1) ** scene.dim
        if nodes > most:
            allowed = int(most ** (1 / scene.dim)) - 1
            text = f"must be at most {allowed} in {scene.dim}D on this server, got {scene.resolution}"
            raise SceneError.of([("resolution", text)])
        limit = min(scene.max_particles, self._settings.max_particles)
        return scene.model_copy(update={"max_particles": limit})
