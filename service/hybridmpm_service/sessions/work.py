"""Work of a session: jobs in order; sketches, motions and recordings on copies of the simulator."""

import asyncio
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from pathlib import Path
from typing import Any, TypeAlias, TypeVar

from hybridmpm import CancelFlag, FrameCancelledError, export, recording
from hybridmpm.control import ControlledTrajectory, Following, Led, plan_motion
from hybridmpm.simulator import Simulator
from hybridmpm_service.errors import ServiceError, SessionBusyError, SketchDroppedError
from hybridmpm_service.sessions.inputs import Goals
from hybridmpm_service.sessions.turns import Turn, Turns
from hybridmpm_service.sessions.view import Control

MAX_WAITING = 32
"""Largest number of jobs that may wait for the thread of a session."""

T = TypeVar("T")


class Worker:
    """The thread of a session; it starts with the first job. Belongs to the event loop.

    Parameters
    ----------
    session : str
        Name of the session.
    check_open : callable
        Called before and after each job; it raises once the session is closed.
    cancel : CancelFlag
        Ends the frame that is being computed, but not the last job.
    """

    def __init__(self, session: str, check_open: Callable[[], None], cancel: CancelFlag) -> None:
        self._session = session
        self._check_open, self._cancel = check_open, cancel
        self._thread = ThreadPoolExecutor(max_workers=1, thread_name_prefix=f"session-{session[:8]}")
        self._unfinished: set[Future[Any]] = set()
        self._queued: set[object] = set()

    @property
    def busy(self) -> bool:
        """Whether a job runs or waits."""
        return bool(self._unfinished)

    @property
    def in_demand(self) -> bool:
        """Whether a job waits that does not run yet. Safe to read from the thread."""
        return bool(self._queued)

    async def run(self, job: Callable[[], T]) -> T:
        """Run a job after those that wait; return its result.

        A cancelled call removes a job that waits. One that runs already is run to its end.

        Raises
        ------
        SessionBusyError
            Too many jobs wait.
        SessionNotFoundError
            The session was closed.
        """
        if len(self._unfinished) >= MAX_WAITING:
            raise SessionBusyError(f"{MAX_WAITING} calls already wait for session {self._session!r}")
        self._check_open()

        place = object()

        def checked() -> T:
            self._queued.discard(place)
            self._check_open()
            try:
                with self._cancel:
                    return job()
            finally:
                # A closed session takes precedence over any other outcome.
                self._check_open()

        self._queued.add(place)
        future = self._thread.submit(checked)
        self._unfinished.add(future)
        future.add_done_callback(self._unfinished.discard)
        try:
            return await asyncio.wrap_future(future)
        finally:
            self._queued.discard(place)

    def end(self, last: Callable[[], object] | None = None) -> None:
        """Take no more jobs; run those that were taken, and then the `last` one."""
        if last is not None:
            future = self._thread.submit(last)
            self._unfinished.add(future)
            future.add_done_callback(self._unfinished.discard)
        self._thread.shutdown(wait=False)

    async def ended(self) -> None:
        """Wait until the jobs that were taken before `end` have been run."""
        unfinished = [asyncio.wrap_future(future) for future in list(self._unfinished)]
        await asyncio.gather(*unfinished, return_exceptions=True)
        # Nothing is left to wait for but the thread's last instructions, which a busy machine may delay.
        await asyncio.to_thread(self._thread.shutdown)


Check: TypeAlias = Callable[[], None]
"""Raises where work is to end early."""


class Errand:
    """Work on a copy, which may be dropped. Safe to use from several threads.

    Parameters
    ----------
    check_open : callable
        Raises once the session is closed.
    control : Control, optional
        The sketch that is being prepared; None for other work.
    """

    def __init__(self, check_open: Check, control: Control | None = None) -> None:
        self.control = control
        self.turn: Turn | None = None
        """Its turn, from the time on at which it waits for one."""
        self._check_open = check_open
        self._why_dropped: str | None = None

    def join(self, turn: Turn) -> None:
        """Note the turn of the work, which may still wait."""
        self.turn = turn

    def drop(self, why: str) -> None:
        """End the work at its next check or substep."""
        self._why_dropped = why
        self.end()

    def end(self) -> None:
        """End work that was dropped, or whose session is closed."""
        try:
            self._raise_if_dropped()
        except ServiceError as error:
            if self.turn is not None:
                self.turn.end(error)

    def check(self) -> None:
        """Wait for the turn; raise if the work was dropped or the session is closed."""
        if self.turn is not None:
            self.turn.wait()
        self._raise_if_dropped()
        if self.turn is not None:
            self.turn.raise_if_ended()

    def _raise_if_dropped(self) -> None:
        self._check_open()
        if self._why_dropped is not None:
            raise SketchDroppedError(self._why_dropped)


class Planner:
    """Planner of one session's sketches, one at a time; it does other work on copies, too.

    Belongs to the event loop.

    Parameters
    ----------
    number : int
        Number of the latest sketch of the session; 0 before the first.
    turns : Turns
    check_open : callable
        Raises once the session is closed.
    on_change : callable
        Called when a preparation begins or ends.
    """

    def __init__(self, *, number: int, turns: Turns, check_open: Check, on_change: Check) -> None:
        self._turns = turns
        self._check_open = check_open
        self._on_change = on_change
        self._count = number
        self._preparation: Errand | None = None
        self._errands: dict[Errand, asyncio.Event] = {}

    @property
    def control(self) -> Control | None:
        """The sketch that is being prepared; None without one."""
        return None if self._preparation is None else self._preparation.control

    def begin(self, sketch: Goals) -> tuple[Errand, int]:
        """Begin a preparation, and drop the one before; return it with the number of its sketch."""
        self.drop("a newer sketch has replaced this one before it began to steer")
        self._count += 1
        first = sketch[0].goal if isinstance(sketch, list) else sketch
        control = Control(number=self._count, kind=first.kind, phase="preparing")
        self._preparation = Errand(self._check_open, control)
        self._on_change()
        return self._preparation, self._count

    def end(self, preparation: Errand) -> None:
        """Note that a sketch is no longer being prepared."""
        if self._preparation is preparation:
            self._preparation = None
            self._on_change()

    def drop(self, why: str) -> None:
        """Drop the sketch that is being prepared, if there is one."""
        if self._preparation is not None:
            self._preparation.drop(why)
            self._preparation = None

    async def prepare(
        self, preparation: Errand, twin: Simulator, sketch: Goals, *, most: int, **settings: Any
    ) -> Led:
        """Plan a sketch, or several in turn, on a copy of the simulator.

        Parameters
        ----------
        preparation : Errand
            From `begin`.
        twin : Simulator
            In the state that the sketch was drawn on; it does not change.
        sketch : Arrow, Ellipse, Shape or list of Keyframe
        most : int
            Largest number of frames if none is given, `hold` included.
        **settings
            The others of `hybridmpm.control.plan_motion`.

        Raises
        ------
        SketchDroppedError
            The preparation was dropped.
        ConfigError, SketchError, SimulationError
            As `hybridmpm.control.plan_motion`.
        """
        return await self._do(
            preparation,
            lambda check: plan_motion(twin, sketch, most=most, on_frame=check, **settings),
        )

    async def on_copy(self, work: Callable[[Check], T], *, memory: int | None = None) -> T:
        """Do work on a copy of the simulator.

        A cancelled call ends the work, and waits until then: files that the work writes may be deleted
        afterwards.

        Parameters
        ----------
        work : callable
            Called in a thread, with a check to make in each frame.
        memory : int, optional
            Estimate of its memory [bytes] where it is a job in the background.

        Raises
        ------
        UnavailableError, SessionNotFoundError
            Too much work waits, or the session was closed; otherwise the exception of the work.
        """
        return await self._do(Errand(self._check_open), work, memory=memory)

    async def _do(self, errand: Errand, work: Callable[[Check], T], *, memory: int | None = None) -> T:
        self._check_open()
        self._errands[errand] = ended = asyncio.Event()
        try:
            async with self._turns.turn(
                memory=memory or 0, background=memory is not None, on_join=errand.join
            ) as turn:

                def checked() -> T:
                    errand.check()
                    try:
                        return work(errand.check)
                    except FrameCancelledError:
                        errand.check()
                        raise

                return await turn.in_thread(checked)
        finally:
            errand.turn = None
            del self._errands[errand]
            ended.set()

    def stop(self) -> None:
        """End all work."""
        for errand in self._errands:
            errand.end()

    async def ended(self) -> None:
        """Wait until the work has ended after `stop`."""
        await asyncio.gather(*(ended.wait() for ended in list(self._errands.values())))


Report: TypeAlias = Callable[[int, int], object]
"""Called with the number of parts done and that of all parts."""


def traced(
    twin: Simulator,
    check: Check,
    sketch: Goals,
    *,
    most: int,
    on_frame: Report = lambda _done, _total: None,
    **settings: Any,
) -> tuple[Led, ControlledTrajectory]:
    """Let a copy of a simulator follow a sketch to the end.

    Parameters
    ----------
    twin : Simulator
        In the state that the sketch was drawn on.
    check : callable
        Raises where the work is to end early.
    sketch : Arrow, Ellipse, Shape or list of Keyframe
    most : int
        Largest number of frames if none is given, `hold` included.
    on_frame : callable
        Called at the start and after each frame.
    **settings
        The others of `hybridmpm.control.plan_motion`.

    Raises
    ------
    ConfigError, SketchError, SimulationError
        As `hybridmpm.control.plan_motion`; a frame failed.
    """
    guidance = plan_motion(twin, sketch, most=most, on_frame=check, **settings)
    following = Following(twin, guidance)
    total = guidance.total_frames
    on_frame(0, total)
    for done, _ in enumerate(following, start=1):
        check()
        on_frame(done, total)
    return guidance, following.result


def recorded(
    twin: Simulator,
    check: Check,
    file: Path,
    style: export.Style,
    *,
    frames: int,
    every: int,
    on_part: Report,
) -> None:
    """Compute frames with a copy of a simulator, and write them to a file in the format of its suffix.

    Parameters
    ----------
    twin : Simulator
    check : callable
        Raises where the work is to end early.
    file : Path
    style : Style
        Look of films and pictures.
    frames, every : int
        As in `hybridmpm.recording.record`.
    on_part : callable
        Called after some frames, and again after some pictures.

    Raises
    ------
    ConfigError, SimulationError
        As `hybridmpm.recording.record`.
    ExportError
        The file cannot be written.
    """
    done = 0

    def note(more: int) -> None:
        nonlocal done
        check()
        done += more
        on_part(done, frames)

    def drawn(pictures: int, total: int) -> None:
        check()
        on_part(frames + pictures, frames + total)

    on_part(0, frames)
    states = recording.record(twin, frames, every=every, on_progress=note)
    export.save(file, states, style, on_progress=drawn)
