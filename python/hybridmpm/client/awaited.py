"""`AsyncClient`: the same calls, to be awaited."""

import asyncio
import contextlib
from collections.abc import AsyncIterator, Mapping, Sequence
from types import TracebackType
from typing import Any, Self, TypeVar, Unpack

import httpx
from websockets.asyncio.client import ClientConnection, connect
from websockets.exceptions import ConnectionClosed, InvalidStatus

from hybridmpm.client import calls, messages
from hybridmpm.client.answers import Particles, Trajectory
from hybridmpm.client.calls import (
    Call,
    DataSetSettings,
    Drawing,
    Json,
    PlanSettings,
    RecordingSettings,
    SimulatorSettings,
    SketchSettings,
)
from hybridmpm.client.errors import refusal, unreachable
from hybridmpm.client.waiting import ADDRESS, TIMEOUT, closed
from hybridmpm.scene import Scene
from hybridmpm.stream_frames import Frame

T = TypeVar("T")


class AsyncClient:
    """A service.

    All methods raise a `ServiceError` where it refuses, and an `UnreachableError` where it is not there.

    Parameters
    ----------
    address : str
        Address of the service, e.g. "http://127.0.0.1:8000".
    timeout : float
        Longest time to wait for an answer [s]; `advance` of many frames may need more.
    """

    def __init__(self, address: str = ADDRESS, *, timeout: float = TIMEOUT) -> None:
        self.address = address.rstrip("/")
        self.timeout = timeout
        self._http = httpx.AsyncClient(base_url=self.address, timeout=timeout)

    async def __aenter__(self) -> Self:
        return self

    async def __aexit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        await self.close()

    async def close(self) -> None:
        """Close the connections; sessions go on."""
        await self._http.aclose()

    async def run(self, call: Call[T]) -> T:
        """Send a call, and return what its answer says."""
        try:
            answer = await self._http.request(call.method, call.path, **call.options)
        except httpx.TransportError as error:
            raise unreachable(self.address, error) from error
        if not answer.is_success:
            raise refusal(answer)
        return call.read(answer)

    async def ready(self) -> bool:
        """Return True where a session can be created now; else raise the reason."""
        return await self.run(calls.ready())

    async def scenarios(self) -> list[Json]:
        """Return the kinds of scenes: name, dim, frames, max_particles and text of each."""
        return await self.run(calls.scenario_list())

    async def scenario(self, name: str, seed: int = 0) -> Scene:
        """Return the scene of a scenario and a seed."""
        return await self.run(calls.scenario(name, seed))

    async def models(self) -> list[Json]:
        """Return the networks of the service."""
        return await self.run(calls.model_list())

    async def plan(
        self,
        scenario: str | None = None,
        seed: int | None = None,
        *,
        scene: Scene | Mapping[str, Any] | None = None,
        **settings: Unpack[PlanSettings],
    ) -> Json:
        """Return the coarse level that simulates a scene within an error or a time; see `Client.plan`."""
        return await self.run(calls.plan(scenario, seed, scene, settings))

    async def create(
        self,
        scenario: str | None = None,
        seed: int | None = None,
        *,
        scene: Scene | Mapping[str, Any] | None = None,
        log: Mapping[str, Any] | None = None,
        **settings: Unpack[SimulatorSettings],
    ) -> "AsyncSession":
        """Create a session, paused at frame 0.

        Parameters
        ----------
        scenario, seed : str and int, optional
            A scenario, and the seed of its scene (0 if absent).
        scene : Scene or mapping, optional
            A scene of your own.
        log : mapping, optional
            What `Session.log` returned, to compute it again.
        **settings
            Who simulates: solver, level, model, r_c, safeguard; see docs/http-api.md.

        Raises
        ------
        ConfigError
            Not exactly one of `scenario`, `scene` and `log` is given.
        """
        return AsyncSession(self, await self.run(calls.create(scenario, seed, scene, log, settings)))

    async def check(
        self,
        scenario: str | None = None,
        seed: int | None = None,
        *,
        scene: Scene | Mapping[str, Any] | None = None,
        **settings: Unpack[SimulatorSettings],
    ) -> Json:
        """Return what the service knows of a scene before its first frame: see docs/http-api.md.

        Parameters are those of `create`. A scene that is not valid is no error: its faults are among the
        `findings`, and `ok` is False.

        Raises
        ------
        ConfigError
            Not exactly one of `scenario` and `scene` is given.
        """
        return await self.run(calls.check(scenario, seed, scene, settings))

    async def sessions(self) -> list["AsyncSession"]:
        """Return all sessions of the service, oldest first."""
        return [AsyncSession(self, info) for info in await self.run(calls.session_list())]

    async def session(self, session_id: str) -> "AsyncSession":
        """Return a session by its id."""
        return AsyncSession(self, await self.run(calls.session(session_id)))

    async def make_dataset(
        self, scenario: str, trajectories: int, **settings: Unpack[DataSetSettings]
    ) -> "AsyncJob":
        """Begin a job that makes a data set: a zip file of HDF5 files and their metadata.

        Parameters
        ----------
        scenario : str
            Scenario that the scenes are drawn from.
        trajectories : int
            Number of trajectories for training.
        **settings
            valid, test, seed, frames, stride and r_p; see docs/http-api.md.
        """
        return AsyncJob(self, await self.run(calls.dataset(scenario, trajectories, settings)))

    async def jobs(self) -> list["AsyncJob"]:
        """Return all jobs of the service, the oldest first."""
        return [AsyncJob(self, info) for info in await self.run(calls.job_list())]

    async def job(self, job_id: str) -> "AsyncJob":
        """Return a job by its id."""
        return AsyncJob(self, await self.run(calls.job(job_id)))

    @contextlib.asynccontextmanager
    async def lines(self, path: str) -> AsyncIterator[AsyncIterator[str]]:
        """Read the answer of an address line by line: a context manager."""
        try:
            async with self._http.stream("GET", path) as answer:
                if not answer.is_success:
                    await answer.aread()
                    raise refusal(answer)
                yield answer.aiter_lines()
        except httpx.TransportError as error:
            raise unreachable(self.address, error) from error


class AsyncSession:
    """A session of a service; it lives on when this object is gone.

    Attributes
    ----------
    id : str
    info : dict
        What the service told of it last; see docs/http-api.md.
    """

    def __init__(self, client: AsyncClient, info: Json) -> None:
        self._client = client
        self.id: str = info["id"]
        self.info = info

    def __repr__(self) -> str:
        """Return id and frame, for a reader."""
        return f"AsyncSession({self.id}, frame {self.info['frame']})"

    async def refresh(self) -> Json:
        """Ask for the session's present `info`, and return it."""
        self.info = await self._client.run(calls.session(self.id))
        return self.info

    async def advance(self, frames: int = 1) -> Json:
        """Compute frames, and return the session's `info` after them."""
        self.info = await self._client.run(calls.advance(self.id, frames))
        return self.info

    async def particles(self) -> Particles:
        """Return the particles at the present frame."""
        return await self._client.run(calls.particles(self.id))

    async def fork(self) -> "AsyncSession":
        """Create a session that goes on from the present state of this one."""
        return AsyncSession(self._client, await self._client.run(calls.fork(self.id)))

    async def log(self) -> Json:
        """Return all that the session can be computed again from."""
        return await self._client.run(calls.log(self.id))

    async def decisions(self) -> list[Json]:
        """Return who simulated since frame 0, and why."""
        return await self._client.run(calls.decisions(self.id))

    async def steer(
        self, drawing: Drawing, *, kind: str | None = None, **settings: Unpack[SketchSettings]
    ) -> Json:
        """Let a sketch steer the session, and return how it was understood and what it takes.

        Parameters
        ----------
        drawing : (K, 2) numbers, Stroke, bytes or Path
            Points of a stroke [m], or a PNG.
        kind : "arrow" or "ellipse", optional
            What the points stand for; the service finds out if absent.
        **settings
            method, frames, cap, strength, hold, fill, seed; see docs/http-api.md.
        """
        return await self._client.run(calls.steer(self.id, drawing, kind, settings))

    async def force(self) -> Json:
        """Return what acts on the fluid in the next frame besides gravity, in the mean over cells."""
        return await self._client.run(calls.force(self.id))

    async def pressure(self) -> Json:
        """Return the pressure [Pa] in the mean over the cells of a grid; MPM alone knows it."""
        return await self._client.run(calls.pressure(self.id))

    async def release(self) -> None:
        """Let no sketch steer any more."""
        await self._client.run(calls.release(self.id))

    async def trace(
        self,
        drawing: Drawing,
        *,
        kind: str | None = None,
        stride: int = 10,
        **settings: Unpack[SketchSettings],
    ) -> Trajectory:
        """Follow a sketch on a copy of the session, which does not change.

        `stride` is the distance in frames between two rows of positions; all else is as in `steer`.
        """
        return await self._client.run(calls.trace(self.id, drawing, kind, stride, settings))

    async def record(self, frames: int, **settings: Unpack[RecordingSettings]) -> "AsyncJob":
        """Begin a job that computes frames on a copy of the session, and writes them to a file.

        Parameters
        ----------
        frames : int
            Number of frames to compute.
        **settings
            every, format ("npz", "gif", "mp4" or "png"), width and speed; see docs/http-api.md.
        """
        return AsyncJob(self._client, await self._client.run(calls.record(self.id, frames, settings)))

    async def delete(self) -> None:
        """End the session."""
        await self._client.run(calls.delete(self.id))

    @contextlib.asynccontextmanager
    async def stream(self) -> AsyncIterator["AsyncStream"]:
        """Watch the session: a context manager of its stream.

        Raises
        ------
        UnreachableError
            The service cannot be reached.
        """
        address = messages.socket_address(self._client.address, self.id)
        try:
            connection = await connect(address, compression=None, open_timeout=self._client.timeout)
        except (OSError, TimeoutError, InvalidStatus) as error:
            raise unreachable(self._client.address, error) from error
        async with connection:
            stream = AsyncStream(connection, self._client.timeout)
            hello = await stream.receive()
            stream.hello = hello if isinstance(hello, dict) else {}
            yield stream


class AsyncJob:
    """Work of a service in the background.

    Attributes
    ----------
    id : str
    info : dict
        What the service told of it last: phase, done, total and more; see docs/http-api.md.
    """

    def __init__(self, client: AsyncClient, info: Json) -> None:
        self._client = client
        self.id: str = info["id"]
        self.info = info

    def __repr__(self) -> str:
        """Return id and phase, for a reader."""
        return f"AsyncJob({self.id}, {self.info['phase']})"

    async def events(self) -> AsyncIterator[Json]:
        """Iterate over the job's `info` as it changes, until the job has ended."""
        async with self._client.lines(f"{calls.job(self.id).path}/events") as lines:
            async for line in lines:
                told = messages.event(line)
                if told is not None:
                    self.info = told
                    yield told

    async def result(self) -> bytes:
        """Wait until the job has ended, and return the file that it has made.

        Raises
        ------
        ServiceError
            The job has failed; the error is what it failed with.
        """
        async for _ in self.events():
            pass
        return await self._client.run(calls.result(self.id))

    async def delete(self) -> None:
        """End the job, and let the service forget its result."""
        await self._client.run(calls.delete_job(self.id))


class AsyncStream:
    """Live frames of a session, and its player. Iterate over it for frames and statuses.

    The service drops a client that takes more than five seconds for a message; one that falls behind gets the
    newest frame.

    Attributes
    ----------
    hello : dict
        Session, scene and types of the particles, as docs/http-api.md describes them.
    """

    def __init__(self, connection: ClientConnection, timeout: float) -> None:
        self._connection, self._timeout = connection, timeout
        self.hello: Json = {}

    async def receive(self) -> messages.Message:
        """Return the next message: a frame, or a status of the session.

        Raises
        ------
        ServiceError
            The service refuses a command, or a frame has failed; the stream goes on.
        StreamClosedError
            It has ended the stream.
        UnreachableError
            Nothing has come for the client's `timeout`.
        """
        try:
            async with asyncio.timeout(self._timeout):
                return messages.read(await self._connection.recv())
        except TimeoutError as error:
            raise unreachable(str(self._connection.remote_address), error) from None
        except ConnectionClosed as error:
            raise closed(error) from None

    async def __aiter__(self) -> AsyncIterator[messages.Message]:
        """Iterate over frames and statuses, as long as the stream is open."""
        while True:
            yield await self.receive()

    async def frames(self) -> AsyncIterator[Frame]:
        """Iterate over frames alone."""
        async for message in self:
            if isinstance(message, Frame):
                yield message

    async def play(self) -> None:
        """Let the player compute frames."""
        await self._send(messages.command("play"))

    async def pause(self) -> None:
        """Stop the player."""
        await self._send(messages.command("pause"))

    async def step(self, frames: int = 1) -> None:
        """Stop the player, and compute some frames."""
        await self._send(messages.command("step", frames=frames))

    async def reset(self) -> None:
        """Go back to frame 0."""
        await self._send(messages.command("reset"))

    async def speed(self, value: float) -> None:
        """Aim at so many simulated seconds per second, in [0.01, 1]."""
        await self._send(messages.command("speed", value=value))

    async def push(
        self, point: Sequence[float], velocity: Sequence[float], radius: float, *, cap: float | None = None
    ) -> None:
        """Push the fluid within `radius` [m] of `point` (D,) [m] to `velocity` (D,) [m/s], until `let_go`.

        `cap` is the largest acceleration [g], 15 if absent.
        """
        await self._send(messages.push(point, velocity, radius, cap))

    async def let_go(self) -> None:
        """Push no more."""
        await self._send(messages.command("push_end"))

    async def _send(self, text: str) -> None:
        try:
            await self._connection.send(text)
        except ConnectionClosed as error:
            raise closed(error) from None
