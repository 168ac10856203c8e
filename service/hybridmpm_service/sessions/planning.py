"""Planning beside a session that goes on: on copies of its simulator, in threads of their own."""

import asyncio
import contextlib
import threading
from collections.abc import Callable
from typing import Any, TypeAlias, TypeVar

from hybridmpm.control import Guidance, Sketch, prepare
from hybridmpm.simulator import Simulator
from hybridmpm_service.errors import SketchDroppedError
from hybridmpm_service.sessions.view import Control
from hybridmpm_service.sessions.worker import Worker

T = TypeVar("T")
Check: TypeAlias = Callable[[], None]
"""Raises where work is to end early."""


class Errand:
    """Work beside a session, which may be dropped. Safe to use from several threads.

    Parameters
    ----------
    check_open : callable
        Raises once the session is closed.
    """

    def __init__(self, check_open: Check) -> None:
        self._check_open = check_open
        self._why_dropped: str | None = None

    def drop(self, why: str) -> None:
        """Let the work end at its next check."""
        self._why_dropped = why

    def check(self) -> None:
        """Raise if the work was dropped or the session is closed: neither waits for its end."""
        self._check_open()
        if self._why_dropped is not None:
            raise SketchDroppedError(self._why_dropped)


class Preparation(Errand):
    """A sketch that is being prepared.

    Parameters
    ----------
    number : int
        Number of the sketch in its session.
    sketch : Arrow or Ellipse
    check_open : callable
    """

    def __init__(self, number: int, sketch: Sketch, check_open: Check) -> None:
        super().__init__(check_open)
        self.control = Control(number=number, kind=sketch.kind, phase="preparing")
        """What the session says of the sketch meanwhile."""


class Planner:
    """Plans the sketches of one session, one at a time, and does other work on copies.

    Belongs to the event loop.

    Parameters
    ----------
    session : str
        Name of the session.
    number : int
        Number of the latest sketch of the session; 0 before the first.
    check_open : callable
        Raises once the session is closed.
    on_change : callable
        Called when a preparation begins or ends.
    """

    def __init__(
        self,
        session: str,
        *,
        number: int,
        check_open: Callable[[], None],
        on_change: Callable[[], None],
    ) -> None:
        self._check_open = check_open
        self._on_change = on_change
        self._sketches = Worker("sketches", session, check_open)
        self._copies = Worker("copies", session, check_open)
        self._count = number
        self._preparation: Preparation | None = None

    @property
    def control(self) -> Control | None:
        """The sketch that is being prepared; None without one."""
        return None if self._preparation is None else self._preparation.control

    def begin(self, sketch: Sketch) -> Preparation:
        """Begin with a sketch in the place of one that is being prepared; end it with `end`."""
        self.drop("a newer sketch has replaced this one before it began to steer")
        self._count += 1
        self._preparation = Preparation(self._count, sketch, self._check_open)
        self._on_change()
        return self._preparation

    def end(self, preparation: Preparation) -> None:
        """Note that a sketch is no longer being prepared."""
        if self._preparation is preparation:
            self._preparation = None
            self._on_change()

    def drop(self, why: str) -> None:
        """Give up the sketch that is being prepared, if there is one."""
        if self._preparation is not None:
            self._preparation.drop(why)
            self._preparation = None

    async def prepare(
        self, preparation: Preparation, twin: Simulator, sketch: Sketch, *, most: int, **settings: Any
    ) -> Guidance:
        """Plan a sketch on a copy of the simulator.

        Parameters
        ----------
        preparation : Preparation
            From `begin`.
        twin : Simulator
            In the state that the sketch was drawn on; it does not change.
        sketch : Arrow or Ellipse
        most : int
            Largest number of frames if none is asked for, `hold` included.
        **settings
            The others of `hybridmpm.control.prepare`.

        Raises
        ------
        SketchDroppedError
            The preparation was dropped.
        ConfigError, SketchError, SimulationError
            As `hybridmpm.control.prepare`.
        """

        def plan() -> Guidance:
            preparation.check()
            return prepare(twin, sketch, most=most, on_frame=preparation.check, **settings)

        return await self._sketches.run(plan)

    async def beside(self, work: Callable[[Check], T]) -> T:
        """Do work on a copy of the simulator, after that which was asked for before.

        A caller that is cancelled ends it at its next check, and waits until then: files that the work writes
        may be taken away afterwards.

        Parameters
        ----------
        work : callable
            Called in a thread, with a check that it makes in each frame.

        Raises
        ------
        SessionBusyError, SessionNotFoundError
            As `Worker.run`; otherwise what the work raises.
        """
        errand = Errand(self._check_open)
        loop, ended = asyncio.get_running_loop(), asyncio.Event()
        begun = threading.Event()

        def do() -> T:
            begun.set()
            try:
                errand.check()
                return work(errand.check)
            finally:
                with contextlib.suppress(RuntimeError):  # The event loop may be closed by now.
                    loop.call_soon_threadsafe(ended.set)

        try:
            return await self._copies.run(do)
        except asyncio.CancelledError:
            errand.drop("its client has gone")
            if begun.is_set():
                await ended.wait()
            raise

    def stop(self) -> None:
        """Take no more plans."""
        self._sketches.end()
        self._copies.end()

    async def ended(self) -> None:
        """Wait until the threads have ended after `stop`."""
        await asyncio.gather(self._sketches.ended(), self._copies.ended())
