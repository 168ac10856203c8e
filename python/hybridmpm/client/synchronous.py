"""`Client`: the calls of `AsyncClient`, each of which waits for its answer.

The coroutines run on an event loop in a thread of their own, which all clients of the process share.
"""

import asyncio
import contextlib
import functools
import threading
from collections.abc import AsyncIterator, Callable, Coroutine, Iterator
from types import TracebackType
from typing import Any, Concatenate, Generic, ParamSpec, Self, TypeVar

from hybridmpm.client.asynchronous import (
    ADDRESS,
    TIMEOUT,
    AsyncClient,
    AsyncJob,
    AsyncSession,
    AsyncStream,
    Json,
)
from hybridmpm.client.messages import Message
from hybridmpm.stream_frames import Frame

A = TypeVar("A")
P = ParamSpec("P")
R = TypeVar("R")
T = TypeVar("T")
_starting = threading.Lock()


@functools.cache
def _event_loop() -> asyncio.AbstractEventLoop:
    loop = asyncio.new_event_loop()
    threading.Thread(target=loop.run_forever, name="hybridmpm client", daemon=True).start()
    return loop


def _wait(call: Coroutine[Any, Any, T]) -> T:
    """Return the result of a coroutine; an interruption by the user ends the call."""
    with _starting:
        loop = _event_loop()
    future = asyncio.run_coroutine_threadsafe(call, loop)
    try:
        return future.result()
    finally:
        future.cancel()


class _Waiting(Generic[A]):
    """The surface of an asynchronous object, for callers without asyncio."""

    def __init__(self, awaited: A) -> None:
        self._awaited = awaited

    def __repr__(self) -> str:
        return repr(self._awaited).removeprefix("Async")


def _waits(
    method: Callable[Concatenate[A, P], Coroutine[Any, Any, T]],
) -> Callable[Concatenate[_Waiting[A], P], T]:
    """Return the method that waits for the result of a coroutine."""

    @functools.wraps(method)
    def call(self: _Waiting[A], /, *args: P.args, **settings: P.kwargs) -> T:
        return _wait(method(self._awaited, *args, **settings))

    return call


def _makes(
    method: Callable[Concatenate[A, P], Coroutine[Any, Any, R]], wrap: Callable[[R], T]
) -> Callable[Concatenate[_Waiting[A], P], T]:
    """Return the method that waits for an asynchronous object and wraps it."""

    @functools.wraps(method)
    def call(self: _Waiting[A], /, *args: P.args, **settings: P.kwargs) -> T:
        return wrap(_wait(method(self._awaited, *args, **settings)))

    return call


async def _next(items: AsyncIterator[T]) -> T | None:
    return await anext(items, None)


class Stream(_Waiting[AsyncStream]):
    """Live frames of a session, and its player, as `AsyncStream`; iterate over it for frames and statuses."""

    receive = _waits(AsyncStream.receive)
    play = _waits(AsyncStream.play)
    pause = _waits(AsyncStream.pause)
    step = _waits(AsyncStream.step)
    reset = _waits(AsyncStream.reset)
    speed = _waits(AsyncStream.speed)
    push = _waits(AsyncStream.push)
    pull = _waits(AsyncStream.pull)
    let_go = _waits(AsyncStream.let_go)
    lead = _waits(AsyncStream.lead)
    led = _waits(AsyncStream.led)
    unlead = _waits(AsyncStream.unlead)

    @property
    def hello(self) -> Json:
        """Session, scene and types of the particles, as docs/reference/http-api.md describes them."""
        return self._awaited.hello

    def __iter__(self) -> Iterator[Message]:
        """Iterate over frames and statuses, as long as the stream is open."""
        while True:
            yield self.receive()

    def frames(self) -> Iterator[Frame]:
        """Iterate over frames alone."""
        return (message for message in self if isinstance(message, Frame))


class Job(_Waiting[AsyncJob]):
    """Work of a service in the background; see `AsyncJob`."""

    result = _waits(AsyncJob.result)
    delete = _waits(AsyncJob.delete)

    @property
    def id(self) -> str:
        """Id of the job."""
        return self._awaited.id

    @property
    def info(self) -> Json:
        """The latest description from the service: phase, done, total and more."""
        return self._awaited.info

    def events(self) -> Iterator[Json]:
        """Iterate over the job's `info` as it changes, until the job has ended."""
        events = self._awaited.events()
        try:
            while (info := _wait(_next(events))) is not None:
                yield info
        finally:
            _wait(events.aclose())


class Session(_Waiting[AsyncSession]):
    """A session of a service; it lives on when this object is gone. See `AsyncSession`."""

    refresh = _waits(AsyncSession.refresh)
    advance = _waits(AsyncSession.advance)
    particles = _waits(AsyncSession.particles)
    start_file = _waits(AsyncSession.start_file)
    ways = _waits(AsyncSession.ways)
    surface = _waits(AsyncSession.surface)
    fork = _makes(AsyncSession.fork, lambda one: Session(one))  # noqa: PLW0108 - not defined yet
    log = _waits(AsyncSession.log)
    decisions = _waits(AsyncSession.decisions)
    steer = _waits(AsyncSession.steer)
    force = _waits(AsyncSession.force)
    pressure = _waits(AsyncSession.pressure)
    sketch = _waits(AsyncSession.sketch)
    release = _waits(AsyncSession.release)
    trace = _waits(AsyncSession.trace)
    record = _makes(AsyncSession.record, Job)
    link = _waits(AsyncSession.link)
    take_links_back = _waits(AsyncSession.take_links_back)
    delete = _waits(AsyncSession.delete)

    @property
    def id(self) -> str:
        """Id of the session."""
        return self._awaited.id

    @property
    def info(self) -> Json:
        """The latest description that the service sent; see docs/reference/http-api.md."""
        return self._awaited.info

    @contextlib.contextmanager
    def stream(self) -> Iterator[Stream]:
        """Watch the session: a context manager of its stream.

        Raises
        ------
        UnreachableError
            The service cannot be reached.
        """
        context = self._awaited.stream()
        stream = Stream(_wait(context.__aenter__()))
        try:
            yield stream
        finally:
            _wait(context.__aexit__(None, None, None))


class Client(_Waiting[AsyncClient]):
    """A service.

    All methods raise a `ServiceError` where the service refuses, and an `UnreachableError` where it does not
    answer.

    Parameters
    ----------
    address : str
        Address of the service, e.g. "http://127.0.0.1:8000".
    key : str, optional
        Token of a key that `hybridmpm key` made, or of a link, where the service has keys.
    timeout : float
        Longest time to wait for an answer [s]; `advance` of many frames may need more.
    """

    close = _waits(AsyncClient.close)
    ready = _waits(AsyncClient.ready)
    scenarios = _waits(AsyncClient.scenarios)
    scenario = _waits(AsyncClient.scenario)
    models = _waits(AsyncClient.models)
    plan = _waits(AsyncClient.plan)
    outlines = _waits(AsyncClient.outlines)
    shape = _waits(AsyncClient.shape)
    create = _makes(AsyncClient.create, Session)
    check = _waits(AsyncClient.check)
    sessions = _makes(AsyncClient.sessions, lambda found: [Session(one) for one in found])
    session = _makes(AsyncClient.session, Session)
    make_dataset = _makes(AsyncClient.make_dataset, Job)
    jobs = _makes(AsyncClient.jobs, lambda found: [Job(one) for one in found])
    job = _makes(AsyncClient.job, Job)

    def __init__(self, address: str = ADDRESS, *, key: str | None = None, timeout: float = TIMEOUT) -> None:
        super().__init__(AsyncClient(address, key=key, timeout=timeout))

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    @property
    def address(self) -> str:
        """Address of the service."""
        return self._awaited.address

    @property
    def timeout(self) -> float:
        """Longest time to wait for an answer [s]."""
        return self._awaited.timeout

    @timeout.setter
    def timeout(self, seconds: float) -> None:
        self._awaited.timeout = seconds
