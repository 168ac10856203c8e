"""Turns: the one place that says how much expensive work runs at once, and whose.

Whatever a client can make expensive has a turn: creation, checks, plans, replays, sketches, recordings, data
sets and large answers. Only as many turns run at once as there are cores. The others wait, or pause where
they are. Those run whose client has had the least time lately: counted by address first, by connection then.
One more runs among those that are short, so that short work does not wait for the long work of others.
Whether work is short is a matter of the time that a core computes for it: on a busy machine all work is slow.
"""

import asyncio
import contextlib
import copy
import itertools
import os
import signal
import threading
import time
from collections import Counter, defaultdict
from collections.abc import AsyncIterator, Callable
from concurrent.futures import Future, ThreadPoolExecutor
from contextvars import ContextVar
from typing import Any, NamedTuple, TypeVar

from hybridmpm import CancelFlag, FrameCancelledError
from hybridmpm_service.errors import UnavailableError, WorkTooLongError
from hybridmpm_service.sessions.apart import CPU_SECONDS, ApartError, run_apart

T = TypeVar("T")
_TICK_SECONDS = 0.05
"""Time between two decisions about what runs."""
_HALF_LIFE_SECONDS = 10.0
"""Time after which half of a client's use is forgotten."""
MAX_TURNS = 256
"""Largest number of short turns, and of others, those that wait among them."""
MAX_MEMORY = 1 << 30
"""Largest memory of all turns that have started, as they estimate it; an address may have three quarters,
and half of it for anything but scenes [bytes]."""
HEAVY = 24 << 20
"""Memory of a scene that is built, or of a process that checks one [bytes]; other work counts as nothing."""
SHORT_SECONDS = 0.1
"""Time of a core after which a turn is no longer among the short ones [s]."""
STUCK_SECONDS = 5.0
"""Time without a first start after which work that waits is stuck: the server is not ready."""


class Client(NamedTuple):
    """A client as the server sees it: the address, and the connection from there.

    All connections of an address that have sent no request before are connection 0.
    """

    address: str = ""
    connection: int = 0


CLIENT: ContextVar[Client] = ContextVar("client", default=Client())  # noqa: B039 - a tuple never changes
"""Client of the present request; tasks inherit it."""


class Turn:
    """The right of one piece of work to run, of `Turns.turn`."""

    def __init__(
        self,
        client: Client,
        number: int,
        pool: ThreadPoolExecutor,
        *,
        memory: int,
        background: bool,
        short: bool,
    ) -> None:
        self.client, self.number = client, number
        self.memory, self.background = memory, background
        self._begins_short = short
        self.flag = CancelFlag()
        """Set at the end: it ends what its threads build or compute."""
        self.spent = 0.0
        """Time that counts for its client: of a core while it is short, afterwards that of its run [s]."""
        self.started = asyncio.Event()
        self.threads = 0
        """Number of threads that work for it; they may outlive it until their next check."""
        self._pool = pool
        self._go = threading.Event()
        self._pid = 0
        self._error: Exception | None = None
        self._computed = 0.0
        self._working: dict[object, tuple[Callable[[], float], float]] = {}
        self._apart: asyncio.Task[Any] | None = None

    @property
    def running(self) -> bool:
        """Whether the turn may run now."""
        return self._go.is_set()

    @property
    def short(self) -> bool:
        """Whether the work is expected to be short, and has been so far."""
        return self._begins_short and self.computed < SHORT_SECONDS

    @property
    def computed(self) -> float:
        """Time for which a core has computed for it [s]."""
        working = list(self._working.values())
        return self._computed + sum(clock() - start for clock, start in working)

    def count(self, passed: float) -> float:
        """Count some time for which it ran [s]; return what of it counts for its client."""
        if self._apart is not None:
            self._computed += passed
        counts = max(0.0, self.computed - self.spent) if self.short else passed
        self.spent += counts
        return counts

    def check(self) -> None:
        """Wait while others have precedence. Called between pieces of work, in its thread.

        Raises
        ------
        UnavailableError
            The work is to end, e.g. since its client has gone.
        """
        self.wait()
        self.raise_if_ended()

    def wait(self) -> None:
        """Wait, in a thread, while others have precedence."""
        self._go.wait()

    async def in_thread(self, work: Callable[[], T]) -> T:
        """Return the result of work in a thread. A cancelled call ends the work, and waits until then."""

        def checked() -> T:
            self.check()
            clock = thread_clock()
            self._working[checked] = clock, (start := clock())
            try:
                with self.flag:
                    return work()
            except FrameCancelledError:
                self.check()
                raise
            finally:
                del self._working[checked]
                self._computed += clock() - start

        def ended(_: Future[T]) -> None:
            self.threads -= 1

        self.threads += 1
        future = self._pool.submit(checked)
        future.add_done_callback(ended)
        working = asyncio.wrap_future(future)
        try:
            return await asyncio.shield(working)
        except asyncio.CancelledError:
            self.end(_gone())
            await asyncio.gather(working, return_exceptions=True)
            raise

    async def apart(self, function: Callable[..., T], *arguments: Any) -> T:
        """Return the result of a function in a process of its own; see `run_apart`."""

        def start(pid: int) -> None:
            self._pid = pid
            self._signal()

        self._apart = asyncio.ensure_future(run_apart(function, *arguments, on_start=start))
        try:
            return await asyncio.shield(self._apart)
        except ApartError as error:
            text = (
                f"the work took more than {CPU_SECONDS} s of a core, or too much memory: send a smaller scene"
            )
            raise WorkTooLongError(text) from error
        except asyncio.CancelledError:
            self._apart.cancel()
            self.raise_if_ended()
            raise
        finally:
            self._pid, self._apart = 0, None

    def allow(self, *, running: bool) -> None:
        """Let the work run, or pause."""
        if running == self.running or self._error is not None:
            return
        (self._go.set if running else self._go.clear)()
        if running:
            self.started.set()
        self._signal()

    def end(self, error: Exception) -> None:
        """End the work: a process at once, a thread within some milliseconds."""
        if self._error is None:
            self._error = error
        self.flag.set()
        self._go.set()
        self.started.set()
        if self._apart is not None:
            self._apart.cancel()

    def raise_if_ended(self) -> None:
        """Raise the error of `end`, if it was called."""
        if self._error is not None:
            # A copy: several threads and tasks raise it, and each adds to its traceback.
            raise copy.copy(self._error)

    def _signal(self) -> None:
        if self._pid:
            with contextlib.suppress(ProcessLookupError):
                os.kill(self._pid, signal.SIGCONT if self.running else signal.SIGSTOP)


class Turns:
    """All turns of a service. Belongs to the event loop.

    Parameters
    ----------
    slots : int >= 1
        Number of turns that run at once, beside one of the short ones.
    """

    def __init__(self, slots: int) -> None:
        self._slots = slots
        self._turns: list[Turn] = []
        self._numbers = itertools.count()
        self._spent: defaultdict[str | Client, float] = defaultdict(float)
        self._pool = ThreadPoolExecutor(2 * MAX_TURNS, "work")
        self._latest = time.monotonic()
        self._waiting: dict[Turn, float] = {}
        self._begun = {True: self._latest, False: self._latest}
        """When a turn has last begun, among the short ones and the others."""
        self._timer: asyncio.TimerHandle | None = None
        self._closed = False

    @contextlib.asynccontextmanager
    async def turn(
        self,
        *,
        memory: int = 0,
        background: bool = False,
        short: bool = True,
        on_join: Callable[[Turn], object] = lambda _turn: None,
    ) -> AsyncIterator[Turn]:
        """Wait for a turn of the present client, and keep it while the block runs.

        Parameters
        ----------
        memory : int
            Estimate of the memory that it takes, if that is much [bytes].
        background : bool
            Nobody waits for an answer: other work of the same connection goes first, older work next.
        short : bool
            The work is expected to take less than `SHORT_SECONDS`.
        on_join : callable
            Called with the turn before it waits.

        Raises
        ------
        UnavailableError
            Too much work waits, or the server stops.
        """
        turn = self._join(memory=memory, background=background, short=short and not background)
        try:
            on_join(turn)
            await turn.started.wait()
            self._waiting.pop(turn, None)
            turn.raise_if_ended()
            yield turn
            turn.raise_if_ended()
        finally:
            self._waiting.pop(turn, None)
            turn.end(_gone())
            self._decide()

    async def run(self, work: Callable[[], T], *, short: bool = True) -> T:
        """Return the result of work in a thread, in a turn of its own."""
        async with self.turn(short=short) as turn:
            return await turn.in_thread(work)

    async def apart(self, function: Callable[..., T], *arguments: Any) -> T:
        """Return the result of a function in a process of its own, in a turn of its own."""
        async with self.turn(memory=HEAVY, short=False) as turn:
            return await turn.apart(function, *arguments)

    def why_stuck(self) -> UnavailableError | None:
        """Return why new work would wait for long; None if work begins one after the other."""
        now = time.monotonic()
        for short, begun in self._begun.items():
            waiting = (
                since for one, since in self._waiting.items() if one.short == short and not one.background
            )
            longest = now - max(begun, min(waiting, default=now))
            if longest > STUCK_SECONDS:
                return UnavailableError(f"work has been waiting for {longest:.0f} s, and none has begun")
        return None

    def counts(self) -> dict[str, int]:
        """Return the numbers of turns that run and that wait."""
        running = sum(turn.running for turn in self._turns)
        return {"running": running, "waiting": len(self._turns) - running}

    def close(self, error: Exception) -> None:
        """End all work, and begin none."""
        self._closed = True
        for turn in self._turns:
            turn.end(error)
        self._pool.shutdown(wait=False, cancel_futures=True)

    async def ended(self) -> None:
        """Wait until all threads have ended after `close`."""
        await asyncio.to_thread(self._pool.shutdown)

    def _join(self, **settings: Any) -> Turn:
        client = CLIENT.get()
        if self._closed:
            raise UnavailableError("the server is shutting down")
        turn = Turn(client, next(self._numbers), self._pool, **settings)
        alike = [one for one in self._turns if one.short == turn.short and not one.flag.is_set]
        if len(alike) >= MAX_TURNS:
            self._make_room(client, alike)
        self._turns.append(turn)
        self._waiting[turn] = time.monotonic()
        self._decide()
        return turn

    def _make_room(self, client: Client, active: list[Turn]) -> None:
        """End the newest turn of the address that has most, unless that is the one that wants another."""
        full = UnavailableError(f"{MAX_TURNS} pieces of work wait already: try again later")
        counts = Counter(one.client.address for one in active)
        address, most = counts.most_common(1)[0]
        if counts[client.address] + 1 >= most:
            raise full
        next(one for one in reversed(active) if one.client.address == address).end(full)

    def _decide(self) -> None:
        """Count the time of those that run, and choose those that run next."""
        self._count()
        self._turns = [one for one in self._turns if not one.flag.is_set or one.threads]
        active = [one for one in self._turns if not one.flag.is_set]
        taken = Counter[str]()
        for turn in self._turns:
            if turn.started.is_set():
                taken[turn.client.address] += turn.memory
        chosen, free = set[Turn](), {True: 1, False: self._slots}
        for turn in sorted(active, key=self._precedence):
            if not free[turn.short]:
                continue
            if not turn.started.is_set():
                if not _fits(turn, taken):
                    continue
                taken[turn.client.address] += turn.memory
                self._begun[turn.short] = self._latest
            chosen.add(turn)
            free[turn.short] -= 1
        for turn in active:
            turn.allow(running=turn in chosen)
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None
        if self._turns and not self._closed:
            self._timer = asyncio.get_running_loop().call_later(_TICK_SECONDS, self._decide)

    def _count(self) -> None:
        """Count the time since the last decision."""
        now = time.monotonic()
        passed, self._latest = now - self._latest, now
        kept = 0.5 ** (passed / _HALF_LIFE_SECONDS)
        faded = {key: kept * spent for key, spent in self._spent.items() if spent > 1e-3}
        self._spent = defaultdict(float, faded)
        for turn in self._turns:
            if not turn.running or turn.flag.is_set:
                continue
            counts = turn.count(passed)
            for key in (turn.client.address, turn.client):
                self._spent[key] += counts

    def _precedence(self, turn: Turn) -> tuple[float, float, bool, float, int]:
        client, age = turn.client, 0.0 if turn.background else turn.spent
        spent = (self._spent.get(client.address, 0.0), self._spent.get(client, 0.0))
        return *spent, turn.background, age, turn.number


def thread_clock() -> Callable[[], float]:
    """Return the clock of what this thread computes [s], to be read in any thread."""
    try:
        number = time.pthread_getcpuclockid(threading.get_ident())
    except AttributeError:  # a system without such clocks
        return time.monotonic
    return lambda: time.clock_gettime(number)


def _fits(turn: Turn, taken: Counter[str]) -> bool:
    """Return whether there is memory for a turn beside what was `taken` for each address."""
    # What is left beside one large piece of work is for scenes.
    most = MAX_MEMORY * (0.75 if turn.memory <= HEAVY else 0.5)
    own, all_of_them = taken[turn.client.address] + turn.memory, taken.total() + turn.memory
    # One that takes more than there is has to be alone.
    return not turn.memory or not taken.total() or (own <= most and all_of_them <= MAX_MEMORY)


def _gone() -> UnavailableError:
    return UnavailableError("the client of this work has gone")
