"""All sessions of a process: creation, limits, expiry and revival."""

import asyncio
import logging
import time
from collections import Counter
from collections.abc import Awaitable, Callable
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

from hybridmpm import CancelFlag, Scene, SimulationError, checking, usable_cores
from hybridmpm.checking import Finding, SceneCheck
from hybridmpm.planner import Estimate, Plan
from hybridmpm_service.errors import (
    ServiceError,
    SessionNotFoundError,
    StorageError,
    TooManySessionsError,
    UnavailableError,
)
from hybridmpm_service.keys.callers import CALLER, Quotas
from hybridmpm_service.sessions import names, scene_work
from hybridmpm_service.sessions.admission import estimated_frame_seconds, without_errors
from hybridmpm_service.sessions.inputs import Inputs, Origin
from hybridmpm_service.sessions.journal import Folder
from hybridmpm_service.sessions.player import DEFAULT_SPEED, Clock, Machine
from hybridmpm_service.sessions.revival import Revived, SessionLog, revived_from_file, revived_from_log
from hybridmpm_service.sessions.scene_work import SceneSource
from hybridmpm_service.sessions.session import CLOSE_DELETED, Session
from hybridmpm_service.sessions.session_file import SessionFile, size_of
from hybridmpm_service.sessions.simulation import Simulation
from hybridmpm_service.sessions.solvers import ChosenSolver, SolverChoice, SolverFactory
from hybridmpm_service.sessions.turns import HEAVY, Turn, Turns
from hybridmpm_service.settings import Settings

CLOSE_GOING_AWAY = 1001
"""WebSocket close code of a server that stops."""
_ENDING_SECONDS = 0.5
"""Longest time that a call waits for the threads of an ended session; they need some milliseconds."""

_log = logging.getLogger(__name__)


class SessionManager:
    """The sessions of a process. Belongs to the event loop.

    Parameters
    ----------
    settings : Settings
    clock : Clock
        Clock for idle times, players and rates of messages.
    quotas : Quotas, optional
        Quotas of keys; none if absent.

    Attributes
    ----------
    clock : Clock
    machine : Machine
        Load of the sessions that play.
    draining : asyncio.Event
        Set once the server stops: no session can be created then, and all have been closed.
    retiring : bool
        Whether no session can be created, while those that there are go on.
    turns : Turns
        All expensive work of the service.

    Raises
    ------
    DataError
        The folder of models has no manifest, or a damaged one.
    ConfigError
        The folder of sessions cannot be used.
    """

    def __init__(
        self, settings: Settings, clock: Clock = time.perf_counter, quotas: Quotas | None = None
    ) -> None:
        self._settings = settings
        self.clock = clock
        self.draining = asyncio.Event()
        self.retiring = False
        self._solvers = SolverFactory(threads=settings.threads, folder=settings.models)
        self._folder = Folder(Path(settings.state_folder)) if settings.state_folder else None
        self._kept = {} if self._folder is None else self._folder.names()
        self._reviving = set(self._kept)
        self._refused: dict[str, str] = {}
        self._replaying: set[CancelFlag] = set()
        # One core is left to the event loop and the sessions that play.
        self.turns = Turns(max(1, usable_cores() - 1))
        self.machine = Machine(settings.max_load or usable_cores(), settings.threads)
        self._sessions: dict[str, Session] = {}
        self._ending: set[asyncio.Task[None]] = set()
        self._sweeps: set[asyncio.Task[None]] = set()
        self._being_made = Counter[str]()
        self._quotas = quotas or Quotas()
        self._quotas.stored.append(self._stored)
        self.machine.most = lambda owner: self._quotas.of(owner).load

    @property
    def solvers(self) -> SolverFactory:
        """Factory of the simulators of sessions, with the models."""
        return self._solvers

    async def create(self, source: SceneSource, choice: SolverChoice | None = None) -> Session:
        """Start a session.

        Parameters
        ----------
        source : SceneSource
        choice : SolverChoice, optional
            Simulator of the session; MPM if absent.

        Raises
        ------
        TooManySessionsError
            All sessions that the settings allow are in use.
        MachineFullError
            The estimated load of the session does not fit beside those that play.
        UnavailableError
            The server is shutting down.
        ConfigError, FieldError, ModelDamagedError
            The scene, the coarse level or the model is refused.
        """
        wanted = choice or SolverChoice()

        async def make(turn: Turn) -> Revived:
            scene, found = await self._examined(turn, source)
            left = without_errors(found, wanted)

            def build() -> Revived:
                chosen = self._admitted(wanted, scene, source.scenario)
                simulation = Simulation(chosen, clock=self.clock)
                return Revived(simulation, Origin.of(scene, chosen, source.scenario, source.seed), None, left)

            return await turn.in_thread(build)

        # Scenarios are small.
        return await self._create(make, memory=HEAVY if source.scenario is None else 0)

    async def check(self, source: SceneSource, choice: SolverChoice) -> SceneCheck:
        """Return the check of a scene; parameters as in `create`.

        Raises
        ------
        UnavailableError
            The server is shutting down, or too much work waits.
        WorkTooLongError
            The check takes too long.
        SceneError
            The scene is not valid, or beyond a limit of this server.
        ConfigError, FieldError, ModelDamagedError
            The coarse level or the model is refused.
        """
        return await self.turns.apart(scene_work.checked, source, self._settings, choice)

    async def plan(self, source: SceneSource, **demand: object) -> tuple[Plan, list[Estimate]]:
        """Return a plan for a scene, and the estimates of all methods.

        Parameters
        ----------
        source : SceneSource
        **demand
            The others of `hybridmpm.planner.plan`.

        Raises
        ------
        UnavailableError, WorkTooLongError, SceneError
            As `check`.
        """
        return await self.turns.apart(scene_work.planned, source, self._settings, demand)

    async def replay(self, log: SessionLog) -> Session:
        """Start a session from a log: it is computed again, then paused.

        Raises
        ------
        TooManySessionsError, MachineFullError, UnavailableError
            As `create`.
        ConfigError, FieldError, ModelDamagedError, SketchError, SimulationError
            The scene, the simulator or an input is refused, or a frame fails.
        """

        async def make(turn: Turn) -> Revived:
            scene, found = await self._examined(turn, SceneSource(data=log.origin.scene))
            origin = replace(log.origin, scene=scene)
            left = without_errors(found, origin.choice)

            def compute() -> Revived:
                chosen = self._admitted(origin.choice, scene, origin.scenario)
                limited = replace(log, origin=origin)
                return revived_from_log(limited, chosen, self.clock, turn.check)

            return replace(await turn.in_thread(compute), findings=left)

        return await self._create(make, memory=HEAVY, short=False)

    async def fork(self, name: str) -> Session:
        """Start an independent session in the present state of another.

        It is paused, at the speed of the other, and steered by the same sketch: the same inputs give the same
        bits from then on. A pushing hand stays with its viewer, and a sketch in preparation with its session.

        Raises
        ------
        SessionNotFoundError, SessionBusyError
            As `get` and `Session.advance`.
        TooManySessionsError, MachineFullError, UnavailableError
            As `create`; the load of the other session is the estimate of the fork's.
        """
        origin = self.get(name)
        await self._check_room()
        self.machine.check(origin.load, "a fork of this session")

        async def forked() -> Revived:
            return Revived(await origin.fork(), origin.origin, origin.notice, origin.findings)

        session = await self._begun(asyncio.create_task(forked()), origin.frame_seconds)
        session.set_speed(origin.speed)
        return session

    async def revive(self) -> None:
        """Start the sessions of the folder again; each is paused where it was.

        Those that have to be computed again from frame 0 come last, so that they delay no others.
        """
        if self._folder is None:
            return
        cores = asyncio.Semaphore(usable_cores())
        for patient in (False, True):
            waiting = {name: self._folder.path(name) for name in self._kept if name in self._reviving}
            await asyncio.gather(
                *(self._revive(name, path, cores, patient=patient) for name, path in waiting.items())
            )

    def get(self, name: str) -> Session:
        """Return a session and note its use.

        Raises
        ------
        SessionNotFoundError
            The session does not exist, or no longer; or it is of another key, which makes no difference.
        OtherNodeError
            It is of another node.
        KeyRefusedError
            The caller is a link that was taken back.
        UnavailableError
            The server is shutting down.
        """
        if self.draining.is_set():
            raise UnavailableError("the server is shutting down")
        caller = CALLER.get()
        if name in self._kept and caller.sees(_Known(name, self._kept[name])):
            if name in self._reviving:
                raise UnavailableError(
                    f"session {name!r} is being computed again after a restart of the server"
                )
            if name in self._refused:
                raise SessionNotFoundError(
                    f"session {name!r} could not be started again: {self._refused[name]}"
                )
        session = self._sessions.get(name)
        if session is None or self._is_idle(session) or not caller.sees(session):
            names.check_node(name, self._settings.node)
            raise SessionNotFoundError(
                f"there is no session {name[:64]!r}; it may have been deleted, or have expired after "
                f"{self._settings.idle_seconds:g} s without use"
            )
        caller.check_link(session.links)
        session.touch()
        return session

    def visible(self) -> list[Session]:
        """Return the sessions that the caller sees, oldest first."""
        caller = CALLER.get()
        return [one for one in self.all() if caller.sees(one)]

    def all(self) -> list[Session]:
        """Return the sessions, oldest first; a restart keeps the order."""
        places = {name: place for place, name in enumerate(self._kept)}
        found = [session for session in self._sessions.values() if not self._is_idle(session)]
        return sorted(found, key=lambda session: places.get(session.id, len(places)))

    async def delete(self, name: str) -> None:
        """End a session, and wait for its threads, but not for long.

        Raises
        ------
        SessionNotFoundError
            The session does not exist, or no longer.
        StorageError
            Its file cannot be deleted; the session goes on.
        """
        session = self.get(name)
        ending = self._end(session, CLOSE_DELETED, "the session has been deleted", keep=False)
        del self._sessions[session.id]
        await _soon([ending])

    def end_later(self, name: str, seconds: float) -> None:
        """End a session after a time, or earlier for a new one, unless a viewer commands it before.

        Raises
        ------
        SessionNotFoundError
            The session does not exist, or no longer.
        """
        session = self.get(name)
        session.ends_at = self.clock() + seconds

        async def end() -> None:
            await asyncio.sleep(seconds)
            await self.expire()

        sweep = asyncio.get_running_loop().create_task(end())
        self._sweeps.add(sweep)
        sweep.add_done_callback(self._sweeps.discard)

    async def expire(self) -> None:
        """End the sessions that were left, or not used for `idle_seconds`; wait as `delete` does."""
        endings = []
        for session in [session for session in self._sessions.values() if self._is_idle(session)]:
            try:
                endings.append(self._end(session, CLOSE_DELETED, "the session has expired", keep=False))
            except StorageError as err:
                _log.warning("session %s has expired, and its file cannot be deleted: %s", session.id, err)
            else:
                del self._sessions[session.id]
        await _soon(endings)

    def why_full(self) -> UnavailableError | None:
        """Return the refusal of a new session; None if one can be created."""
        if self.draining.is_set():
            return UnavailableError("the server is shutting down")
        if self.retiring:
            return UnavailableError("this node is being drained: it keeps its sessions and takes no new ones")
        limit = self._settings.max_sessions
        if self._taken() - len(self._left()) >= limit:
            return TooManySessionsError(
                f"all {limit} sessions are in use; delete one, or wait until one expires"
            )
        return self.machine.full()

    def _taken(self) -> int:
        # Sessions that end take memory and a core as long as their threads run.
        return len(self.all()) + len(self._reviving) + self._being_made.total() + len(self._ending)

    def _left(self) -> list[Session]:
        """Return the sessions that their clients have left, the one that ends first at the start."""
        left = [session for session in self.all() if session.ends_at is not None]
        return sorted(left, key=lambda session: session.ends_at or 0.0)

    @property
    def watched(self) -> bool:
        """Whether any session has a viewer."""
        return any(session.watched for session in self._sessions.values())

    def retire(self) -> None:
        """Take no new sessions from now on; those that there are go on."""
        self.retiring = True
        _log.warning("this node takes no new sessions any more, for it is to be drained")

    def drain(self) -> None:
        """Begin a stop: create no more sessions, and close all, their streams with code 1001."""
        self.draining.set()
        self.turns.close(UnavailableError("the server is shutting down"))
        for cancel in self._replaying:
            cancel.set()
        for session in self._sessions.values():
            session.close(CLOSE_GOING_AWAY, "the server stops", keep=True)

    async def close(self) -> None:
        """End all sessions, and wait for the threads of all that have ended."""
        self.drain()
        for sweep in self._sweeps:
            sweep.cancel()
        while self._sessions:
            _, session = self._sessions.popitem()
            self._end(session, CLOSE_GOING_AWAY, "the server stops", keep=True)
        await asyncio.gather(self.turns.ended(), *self._ending)
        if self._folder is not None:
            self._folder.close()

    async def _check_room(self) -> None:
        """Raise if no session can be created now."""
        await self.expire()
        refusal = self.why_full()
        if refusal is not None:
            raise refusal
        owner = CALLER.get().owner
        own = sum(one.owner == owner for one in self._sessions.values())
        own += sum(self._kept[name] == owner for name in self._reviving) + self._being_made[owner]
        left = [one for one in self._left() if one.owner == owner]
        self._quotas.check_number(owner, own - len(left), "sessions")
        self._quotas.check_bytes(owner)
        most = self._quotas.of(owner).sessions
        is_over = most is not None and own >= most
        if is_over or self._taken() >= self._settings.max_sessions:
            (left if is_over else self._left())[0].ends_at = self.clock()
            await self.expire()

    def _stored(self, owner: str) -> int:
        """Return the size of the files of a key's sessions [bytes]."""
        if self._folder is None:
            return 0
        return sum(
            size_of(self._folder.path(one.id)) for one in self._sessions.values() if one.owner == owner
        )

    def _admitted(self, choice: SolverChoice, scene: Scene, scenario: str | None) -> ChosenSolver:
        """Return the simulator of a new session whose estimated load fits."""
        chosen = self._solvers.make(choice, scene, scenario)
        seconds = _estimate(Origin.of(scene, chosen, scenario, None), chosen.simulator.r_p)
        load = self.machine.load_of(seconds, scene.frame_dt, DEFAULT_SPEED)
        self.machine.check(load, "a new session of this scene")
        return chosen

    async def _examined(self, turn: Turn, source: SceneSource) -> tuple[Scene, tuple[Finding, ...]]:
        """Return a scene and its static findings; one of a client is read in a process apart."""
        if source.data is not None:
            return await turn.apart(scene_work.examined, source, self._settings)
        return await turn.in_thread(lambda: scene_work.examined(source, self._settings))

    async def _create(
        self, make: Callable[[Turn], Awaitable[Revived]], *, memory: int, short: bool = True
    ) -> Session:
        await self._check_room()

        async def made() -> Revived:
            async with self.turns.turn(memory=memory, short=short) as turn:
                return await make(turn)

        return await self._begun(asyncio.create_task(made()))

    async def _begun(self, making: asyncio.Task[Revived], frame_seconds: float | None = None) -> Session:
        """Wait for a simulation, and start its session; where sessions are kept on disk, it has a file then.

        A cancelled call ends the making, and discards what is made. It is counted until then.
        """

        async def kept() -> Revived:
            made = await making
            if self._folder is not None:
                await asyncio.to_thread(_keep, self._folder.path(name), made, owner)
            return made

        def end(keeping: asyncio.Task[Revived]) -> None:
            # Those without any are left out.
            self._being_made -= Counter([owner])
            # Reading the exception keeps asyncio from logging that of a cancelled call.
            if not keeping.cancelled() and keeping.exception() is None and name not in self._sessions:
                journal = keeping.result().simulation.journal
                journal.discard()
                journal.close()

        name, owner = names.new(self._settings.node), CALLER.get().owner
        self._being_made[owner] += 1
        keeping = asyncio.get_running_loop().create_task(kept())
        try:
            return self._begin(name, await asyncio.shield(keeping), owner, frame_seconds)
        except asyncio.CancelledError:
            making.cancel()
            raise
        finally:
            if keeping.done():
                end(keeping)
            else:
                keeping.add_done_callback(end)

    def _begin(self, name: str, made: Revived, owner: str, frame_seconds: float | None = None) -> Session:
        if self.draining.is_set():
            raise UnavailableError("the server is shutting down")
        session = Session(
            name,
            made.simulation,
            made.origin,
            self.clock,
            machine=self.machine,
            turns=self.turns,
            estimate=frame_seconds or _estimate(made.origin, made.simulation.r_p),
            notice=made.notice,
            findings=made.findings,
            owner=owner,
        )
        self._sessions[session.id] = session
        return session

    async def _revive(self, name: str, path: Path, cores: asyncio.Semaphore, *, patient: bool) -> None:
        """Start the session of a file again; a failure is logged, and leaves the file alone.

        Unless `patient` is set, one that has to be computed again from frame 0 is left for later.
        """
        cancel = CancelFlag()
        self._replaying.add(cancel)
        try:
            async with cores:
                if not self.draining.is_set():
                    made = await asyncio.to_thread(self._revived, path, cancel, patient=patient)
                    if made is None:
                        return
                    try:
                        self._begin(name, made, self._kept[name])
                    except BaseException:
                        made.simulation.journal.close()
                        raise
        except Exception as err:  # noqa: BLE001 - one file costs its own session alone, whatever it contains
            if not self.draining.is_set():
                known = isinstance(err, ServiceError | SimulationError)
                text = str(err) if known else f"its file is damaged ({type(err).__name__}: {err})"
                self._refused[name] = " ".join(text.split())
                _log.error(
                    "session %s cannot be started again, and its file is left as it is: %s",
                    name,
                    self._refused[name],
                )
        finally:
            self._replaying.discard(cancel)
        self._reviving.discard(name)

    def _revived(self, path: Path, cancel: CancelFlag, *, patient: bool) -> Revived | None:
        file = SessionFile(path)
        try:
            with cancel:
                made = revived_from_file(file, self._solvers, self.clock, patient=patient)
            if made is not None:
                return replace(made, findings=checking.findings(made.origin.scene))
        except BaseException:
            file.close()
            raise
        file.close()
        return None

    def _end(self, session: Session, code: int, reason: str, *, keep: bool) -> asyncio.Task[None]:
        """Close a session, and count it until its threads have ended."""
        session.close(code, reason, keep=keep)
        ending = asyncio.get_running_loop().create_task(session.ended())
        self._ending.add(ending)
        ending.add_done_callback(self._ending.discard)
        return ending

    def _is_idle(self, session: Session) -> bool:
        now = self.clock()
        if session.ends_at is not None and now >= session.ends_at:
            return True
        return not session.needed and now - session.last_used > self._settings.idle_seconds


class _Known(NamedTuple):
    """A session of which only the name and the owner are known yet."""

    id: str
    owner: str


async def _soon(endings: list[asyncio.Task[None]]) -> None:
    """Wait for sessions that end, but not for long: the others go on, and are counted."""
    if endings:
        await asyncio.wait(endings, timeout=_ENDING_SECONDS)


def _estimate(origin: Origin, r_p: float) -> float:
    """Return the estimated time of a frame [s]."""
    return estimated_frame_seconds(origin.scene) * (r_p if origin.choice.solver == "mpm" else 1.0)


def _keep(path: Path, made: Revived, owner: str) -> None:
    """Write a simulation to a file of its own from now on."""
    simulation, journal = made.simulation, made.simulation.journal
    fresh = simulation.frame == 0 and journal.inputs == Inputs()
    checkpoint = None if fresh else simulation.checkpoint()
    journal.create(path, made.origin, made.notice, simulation.computed_seconds, checkpoint, owner=owner)
