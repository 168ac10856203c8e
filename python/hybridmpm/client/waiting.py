"""`Client`: calls that wait for their answers."""

import contextlib
from collections.abc import Iterator, Mapping, Sequence
from types import TracebackType
from typing import Any, Self, TypeVar, Unpack

import httpx
from websockets.exceptions import ConnectionClosed, InvalidStatus
from websockets.sync.client import ClientConnection, connect

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
from hybridmpm.client.errors import StreamClosedError, refusal, unreachable
from hybridmpm.scene import Scene
from hybridmpm.stream_frames import Frame

T = TypeVar("T")
ADDRESS = "http://127.0.0.1:8000"
"""Address of a service that `hybridmpm serve` starts."""
TIMEOUT = 60.0
"""Longest time to wait for an answer [s]."""


class Client:
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
        self._http = httpx.Client(base_url=self.address, timeout=timeout)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def close(self) -> None:
        """Close the connections; sessions go on."""
        self._http.close()

    def run(self, call: Call[T]) -> T:
        """Send a call, and return what its answer says."""
        try:
            answer = self._http.request(call.method, call.path, **call.options)
        except httpx.TransportError as error:
            raise unreachable(self.address, error) from error
        if not answer.is_success:
            raise refusal(answer)
        return call.read(answer)

    def ready(self) -> bool:
        """Return True where a session can be created now; else raise the reason."""
        return self.run(calls.ready())

    def scenarios(self) -> list[Json]:
        """Return the kinds of scenes: name, dim, frames, max_particles and text of each."""
        return self.run(calls.scenario_list())

    def scenario(self, name: str, seed: int = 0) -> Scene:
        """Return the scene of a scenario and a seed."""
        return self.run(calls.scenario(name, seed))

    def models(self) -> list[Json]:
        """Return the networks of the service."""
        return self.run(calls.model_list())

    def plan(
        self,
        scenario: str | None = None,
        seed: int | None = None,
        *,
        scene: Scene | Mapping[str, Any] | None = None,
        **settings: Unpack[PlanSettings],
    ) -> Json:
        """Return the coarse level that simulates a scene within an error or a time, and why.

        Parameters
        ----------
        scenario, seed : str and int, optional
            A scenario, and the seed of its scene (0 if absent).
        scene : Scene or mapping, optional
            A scene of your own.
        **settings
            max_error or budget_ms, and measure; see docs/http-api.md. `answer["session"]` are the settings of
            `create` that choose this level.

        Raises
        ------
        ConfigError
            Not exactly one of `scenario` and `scene` is given.
        """
        return self.run(calls.plan(scenario, seed, scene, settings))

    def create(
        self,
        scenario: str | None = None,
        seed: int | None = None,
        *,
        scene: Scene | Mapping[str, Any] | None = None,
        log: Mapping[str, Any] | None = None,
        **settings: Unpack[SimulatorSettings],
    ) -> "Session":
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
        return Session(self, self.run(calls.create(scenario, seed, scene, log, settings)))

    def check(
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
        return self.run(calls.check(scenario, seed, scene, settings))

    def sessions(self) -> list["Session"]:
        """Return all sessions of the service, oldest first."""
        return [Session(self, info) for info in self.run(calls.session_list())]

    def session(self, session_id: str) -> "Session":
        """Return a session by its id."""
        return Session(self, self.run(calls.session(session_id)))

    def make_dataset(self, scenario: str, trajectories: int, **settings: Unpack[DataSetSettings]) -> "Job":
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
        return Job(self, self.run(calls.dataset(scenario, trajectories, settings)))

    def jobs(self) -> list["Job"]:
        """Return all jobs of the service, the oldest first."""
        return [Job(self, info) for info in self.run(calls.job_list())]

    def job(self, job_id: str) -> "Job":
        """Return a job by its id."""
        return Job(self, self.run(calls.job(job_id)))

    @contextlib.contextmanager
    def lines(self, path: str) -> Iterator[Iterator[str]]:
        """Read the answer of an address line by line: a context manager."""
        try:
            with self._http.stream("GET", path) as answer:
                if not answer.is_success:
                    answer.read()
                    raise refusal(answer)
                yield answer.iter_lines()
        except httpx.TransportError as error:
            raise unreachable(self.address, error) from error


class Session:
    """A session of a service; it lives on when this object is gone.

    Attributes
    ----------
    id : str
    info : dict
        What the service told of it last; see docs/http-api.md.
    """

    def __init__(self, client: Client, info: Json) -> None:
        self._client = client
        self.id: str = info["id"]
        self.info = info

    def __repr__(self) -> str:
        """Return id and frame, for a reader."""
        return f"Session({self.id}, frame {self.info['frame']})"

    def refresh(self) -> Json:
        """Ask for the session's present `info`, and return it."""
        self.info = self._client.run(calls.session(self.id))
        return self.info

    def advance(self, frames: int = 1) -> Json:
        """Compute frames, and return the session's `info` after them."""
        self.info = self._client.run(calls.advance(self.id, frames))
        return self.info

    def particles(self) -> Particles:
        """Return the particles at the present frame."""
        return self._client.run(calls.particles(self.id))

    def fork(self) -> "Session":
        """Create a session that goes on from the present state of this one."""
        return Session(self._client, self._client.run(calls.fork(self.id)))

    def log(self) -> Json:
        """Return all that the session can be computed again from."""
        return self._client.run(calls.log(self.id))

    def decisions(self) -> list[Json]:
        """Return who simulated since frame 0, and why."""
        return self._client.run(calls.decisions(self.id))

    def steer(self, drawing: Drawing, *, kind: str | None = None, **settings: Unpack[SketchSettings]) -> Json:
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
        return self._client.run(calls.steer(self.id, drawing, kind, settings))

    def force(self) -> Json:
        """Return what acts on the fluid in the next frame besides gravity, in the mean over cells."""
        return self._client.run(calls.force(self.id))

    def pressure(self) -> Json:
        """Return the pressure [Pa] in the mean over the cells of a grid; MPM alone knows it."""
        return self._client.run(calls.pressure(self.id))

    def release(self) -> None:
        """Let no sketch steer any more."""
        self._client.run(calls.release(self.id))

    def trace(
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
        return self._client.run(calls.trace(self.id, drawing, kind, stride, settings))

    def record(self, frames: int, **settings: Unpack[RecordingSettings]) -> "Job":
        """Begin a job that computes frames on a copy of the session, and writes them to a file.

        Parameters
        ----------
        frames : int
            Number of frames to compute.
        **settings
            every, format ("npz", "gif", "mp4" or "png"), width and speed; see docs/http-api.md.
        """
        return Job(self._client, self._client.run(calls.record(self.id, frames, settings)))

    def delete(self) -> None:
        """End the session."""
        self._client.run(calls.delete(self.id))

    @contextlib.contextmanager
    def stream(self) -> Iterator["Stream"]:
        """Watch the session: a context manager of its stream.

        Raises
        ------
        UnreachableError
            The service cannot be reached.
        """
        address = messages.socket_address(self._client.address, self.id)
        try:
            connection = connect(address, compression=None, open_timeout=self._client.timeout)
        except (OSError, TimeoutError, InvalidStatus) as error:
            raise unreachable(self._client.address, error) from error
        with connection:
            stream = Stream(connection, self._client.timeout)
            hello = stream.receive()
            stream.hello = hello if isinstance(hello, dict) else {}
            yield stream


class Job:
    """Work of a service in the background.

    Attributes
    ----------
    id : str
    info : dict
        What the service told of it last: phase, done, total and more; see docs/http-api.md.
    """

    def __init__(self, client: Client, info: Json) -> None:
        self._client = client
        self.id: str = info["id"]
        self.info = info

    def __repr__(self) -> str:
        """Return id and phase, for a reader."""
        return f"Job({self.id}, {self.info['phase']})"

    def events(self) -> Iterator[Json]:
        """Iterate over the job's `info` as it changes, until the job has ended."""
        with self._client.lines(f"{calls.job(self.id).path}/events") as lines:
            for line in lines:
                told = messages.event(line)
                if told is not None:
                    self.info = told
                    yield told

    def result(self) -> bytes:
        """Wait until the job has ended, and return the file that it has made.

        Raises
        ------
        ServiceError
            The job has failed; the error is what it failed with.
        """
        for _ in self.events():
            pass
        return self._client.run(calls.result(self.id))

    def delete(self) -> None:
        """End the job, and let the service forget its result."""
        self._client.run(calls.delete_job(self.id))


class Stream:
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

    def receive(self) -> messages.Message:
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
            return messages.read(self._connection.recv(timeout=self._timeout))
        except TimeoutError as error:
            raise unreachable(str(self._connection.remote_address), error) from None
        except ConnectionClosed as error:
            raise closed(error) from None

    def __iter__(self) -> Iterator[messages.Message]:
        """Iterate over frames and statuses, as long as the stream is open."""
        while True:
            yield self.receive()

    def frames(self) -> Iterator[Frame]:
        """Iterate over frames alone."""
        return (message for message in self if isinstance(message, Frame))

    def play(self) -> None:
        """Let the player compute frames."""
        self._send(messages.command("play"))

    def pause(self) -> None:
        """Stop the player."""
        self._send(messages.command("pause"))

    def step(self, frames: int = 1) -> None:
        """Stop the player, and compute some frames."""
        self._send(messages.command("step", frames=frames))

    def reset(self) -> None:
        """Go back to frame 0."""
        self._send(messages.command("reset"))

    def speed(self, value: float) -> None:
        """Aim at so many simulated seconds per second, in [0.01, 1]."""
        self._send(messages.command("speed", value=value))

    def push(
        self, point: Sequence[float], velocity: Sequence[float], radius: float, *, cap: float | None = None
    ) -> None:
        """Push the fluid within `radius` [m] of `point` (D,) [m] to `velocity` (D,) [m/s], until `let_go`.

        `cap` is the largest acceleration [g], 15 if absent.
        """
        self._send(messages.push(point, velocity, radius, cap))

    def let_go(self) -> None:
        """Push no more."""
        self._send(messages.command("push_end"))

    def _send(self, text: str) -> None:
        try:
            self._connection.send(text)
        except ConnectionClosed as error:
            raise closed(error) from None


def closed(error: ConnectionClosed) -> StreamClosedError:
    """Return the error of a stream that the service has ended."""
    code = 1006 if error.rcvd is None else error.rcvd.code
    reason = "" if error.rcvd is None else error.rcvd.reason
    return StreamClosedError(
        f"the service has ended the stream with code {code}: {reason or 'no reason'}", code
    )
