"""`AsyncClient`: the calls of the service as coroutines."""

import asyncio
import base64
import contextlib
import json
from collections.abc import AsyncGenerator, AsyncIterator, Mapping, Sequence
from pathlib import Path
from types import TracebackType
from typing import Any, Literal, Self, TypeAlias, Unpack
from urllib.parse import quote

import httpx
import numpy as np
import numpy.typing as npt
from websockets.asyncio.client import ClientConnection, connect
from websockets.exceptions import ConnectionClosed, InvalidStatus

from hybridmpm._support.arguments import unmasked
from hybridmpm.client import messages
from hybridmpm.client.answers import Particles, Trajectory
from hybridmpm.client.errors import closed, refusal, refused_stream, unreachable
from hybridmpm.client.settings import (
    DataSetSettings,
    PlanSettings,
    RecordingSettings,
    SimulatorSettings,
    SketchSettings,
)
from hybridmpm.control import Arrow, Ellipse, Keyframe, Shape, Sketch, Solid, Stroke
from hybridmpm.control.guidance import sketch_from_dict, sketch_to_dict
from hybridmpm.errors import ConfigError
from hybridmpm.scene import Scene
from hybridmpm.stream_frames import Frame

Json: TypeAlias = dict[str, Any]
Drawing: TypeAlias = npt.ArrayLike | Stroke | bytes | Path | Sketch | Sequence[Keyframe]
"""Points (K, 2) [m], a stroke, a PNG as bytes or as a file, a sketch, or keyframes in turn."""
ADDRESS = "http://127.0.0.1:8000"
"""Address of a service that `hybridmpm serve` starts."""
TIMEOUT = 60.0
"""Longest time to wait for an answer [s]."""
_NPZ = {"Accept": "application/x-npz"}


class AsyncClient:
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

    def __init__(self, address: str = ADDRESS, *, key: str | None = None, timeout: float = TIMEOUT) -> None:
        self.address = address.rstrip("/")
        self.timeout = timeout
        self.headers = {} if key is None else {"Authorization": f"Bearer {key}"}
        """Headers of each call."""
        self.http = httpx.AsyncClient(base_url=self.address, timeout=timeout, headers=self.headers)
        """The connections."""

    async def __aenter__(self) -> Self:
        return self

    async def __aexit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        await self.close()

    async def close(self) -> None:
        """Close the connections; sessions continue."""
        await self.http.aclose()

    async def request(
        self, method: Literal["GET", "POST", "DELETE"], path: str, /, **options: Any
    ) -> httpx.Response:
        """Send a request, and return its answer; `options` are those of `httpx.AsyncClient.request`."""
        try:
            answer = await self.http.request(method, path, **options)
        except httpx.TransportError as error:
            raise unreachable(self.address, error) from error
        if not answer.is_success:
            raise refusal(answer)
        return answer

    async def ready(self) -> bool:
        """Return True where a session can be created now; else raise the reason."""
        await self.request("GET", "/readyz")
        return True

    async def scenarios(self) -> list[Json]:
        """Return the kinds of scenes: name, dim, frames, max_particles and text of each."""
        return await self._list("scenarios")

    async def scenario(self, name: str, seed: int = 0) -> Scene:
        """Return the scene of a scenario and a seed."""
        path = f"/v1/scenarios/{quote(name, safe='')}"
        return Scene.from_json((await self.request("GET", path, params={"seed": seed})).content)

    async def models(self) -> list[Json]:
        """Return the networks of the service."""
        return await self._list("models")

    async def plan(
        self,
        scenario: str | None = None,
        seed: int | None = None,
        *,
        scene: Scene | Mapping[str, Any] | None = None,
        **settings: Unpack[PlanSettings],
    ) -> Json:
        """Return the method that simulates a scene within an error or a time, and why.

        Parameters
        ----------
        scenario, seed : str and int, optional
            A scenario, and the seed of its scene (0 if absent).
        scene : Scene or mapping, optional
            A scene of your own.
        **settings
            max_error or budget_ms, and measure; see docs/reference/http-api.md. `answer["session"]` are the
            settings of `create` that choose this method.

        Raises
        ------
        ConfigError
            Not exactly one of `scenario` and `scene` is given.
        """
        return await self._post("/v1/plans", {**_origin(seed, scenario=scenario, scene=scene), **settings})

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
            Result of `log` of a session, which is computed again.
        **settings
            The simulator: solver, coarse, model, r_c; see docs/reference/http-api.md.

        Raises
        ------
        ConfigError
            Not exactly one of `scenario`, `scene` and `log` is given.
        """
        origin = _origin(seed, scenario=scenario, scene=scene, log=log)
        return AsyncSession(self, await self._post("/v1/sessions", {**origin, **settings}))

    async def check(
        self,
        scenario: str | None = None,
        seed: int | None = None,
        *,
        scene: Scene | Mapping[str, Any] | None = None,
        **settings: Unpack[SimulatorSettings],
    ) -> Json:
        """Return the findings about a scene before its first frame: see docs/reference/http-api.md.

        Parameters are those of `create`. A scene that is not valid is no error: its faults are among the
        `findings`, and `ok` is False.

        Raises
        ------
        ConfigError
            Not exactly one of `scenario` and `scene` is given.
        """
        return await self._post("/v1/checks", {**_origin(seed, scenario=scenario, scene=scene), **settings})

    async def outlines(
        self,
        *,
        center: Sequence[float],
        height: float,
        text: str | None = None,
        picture: bytes | None = None,
        path: str | None = None,
        width: float | None = None,
    ) -> Shape:
        """Return the shape of a text, a picture or an SVG path, as the service traces it.

        Parameters
        ----------
        center : sequence of 2 floats
            Middle of the rectangle around the shape [m].
        height : float
            Height of that rectangle [m].
        text, picture, path : optional
            Exactly one of them: words; the bytes of a PNG, JPEG or WebP file, at most 1 MiB; the attribute d
            of an SVG path.
        width : float in [2, 20], optional
            Width of the stroke, which gives the depth in 3D [pixels of 512].

        Raises
        ------
        ServiceError
            Not exactly one source is given, or there is nothing in it to trace.
        """
        body = {
            "center": list(center),
            "height": height,
            "text": text,
            "picture": None if picture is None else base64.b64encode(picture).decode(),
            "path": path,
            "width": width,
        }
        answer = await self._post("/v1/outlines", body)
        sketch = sketch_from_dict(answer["sketch"])
        if not isinstance(sketch, Shape):
            raise ConfigError(f"the service has answered no shape: {sketch.kind}")
        return sketch

    async def shape(self, file: bytes, kind: str, *, center: Sequence[float], height: float) -> Json:
        """Return the shape in a file as fields of a body or an obstacle.

        Parameters
        ----------
        file : bytes
            Content of the file.
        kind : "stl", "obj", "ply", "glb", "svg" or "png"
            Ending of its name; the first four have surfaces for 3D.
        center : sequence of 2 or 3 floats
            Middle of the box around the shape [m].
        height : float
            Its length along y [m].

        Raises
        ------
        ServiceError
            There is no shape in the file, or its surface is not closed; the message names the open edges.
        """
        place = dict(zip("xyz", center, strict=False))
        where = {"kind": kind, "height": height, **place}
        found: Json = (await self.request("POST", "/v1/shapes", params=where, content=file)).json()
        return found

    async def sessions(self) -> list["AsyncSession"]:
        """Return all sessions of the service, oldest first."""
        return [AsyncSession(self, info) for info in await self._list("sessions")]

    async def session(self, session_id: str) -> "AsyncSession":
        """Return a session by its id."""
        return AsyncSession(self, (await self.request("GET", f"/v1/sessions/{session_id}")).json())

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
            valid, test, seed, frames, stride and r_p; see docs/reference/http-api.md.
        """
        body = {"scenario": scenario, "trajectories": trajectories, **settings}
        return AsyncJob(self, await self._post("/v1/datasets", body))

    async def jobs(self) -> list["AsyncJob"]:
        """Return all jobs of the service, oldest first."""
        return [AsyncJob(self, info) for info in await self._list("jobs")]

    async def job(self, job_id: str) -> "AsyncJob":
        """Return a job by its id."""
        return AsyncJob(self, (await self.request("GET", f"/v1/jobs/{job_id}")).json())

    async def _list(self, name: str) -> list[Json]:
        found: list[Json] = (await self.request("GET", f"/v1/{name}")).json()[name]
        return found

    async def _post(self, path: str, body: Mapping[str, Any]) -> Json:
        answer: Json = (await self.request("POST", path, json=body)).json()
        return answer


class AsyncSession:
    """A session of a service; it lives on when this object is gone.

    Attributes
    ----------
    id : str
    info : dict
        The latest description that the service sent; see docs/reference/http-api.md.
    """

    def __init__(self, client: AsyncClient, info: Json) -> None:
        self._client = client
        self.id: str = info["id"]
        self.info = info
        self._path = f"/v1/sessions/{self.id}"

    def __repr__(self) -> str:
        return f"AsyncSession({self.id}, frame {self.info['frame']})"

    async def refresh(self) -> Json:
        """Request the session's present `info`, and return it."""
        self.info = (await self._client.request("GET", self._path)).json()
        return self.info

    async def advance(self, frames: int = 1) -> Json:
        """Compute frames, and return the session's `info` after them."""
        self.info = (await self._post("advance", json={"frames": frames})).json()
        return self.info

    async def particles(self) -> Particles:
        """Return the particles at the present frame."""
        return Particles.of(await self._client.request("GET", f"{self._path}/particles", headers=_NPZ))

    async def start_file(self) -> bytes:
        """Return what a solver in a browser needs to go on from the present state; only MPM has it."""
        return (await self._client.request("GET", f"{self._path}/start")).content

    async def ways(self) -> bytes:
        """Return the law of the sketch that steers, which a solver in a browser follows as well."""
        return (await self._client.request("GET", f"{self._path}/ways")).content

    async def surface(self, kind: Literal["glb", "ply"] = "glb") -> bytes:
        """Return the surface of each material of a session in 3D, as a file of triangles."""
        accept = {"Accept": "model/gltf-binary" if kind == "glb" else "application/x-ply"}
        return (await self._client.request("GET", f"{self._path}/surface", headers=accept)).content

    async def fork(self) -> "AsyncSession":
        """Create a session that continues from the present state of this one."""
        return AsyncSession(self._client, (await self._post("fork")).json())

    async def log(self) -> Json:
        """Return the log, from which the session can be computed again."""
        return await self._get("log")

    async def decisions(self) -> list[Json]:
        """Return which simulator computed the frames since frame 0, and why."""
        decisions: list[Json] = (await self._get("decisions"))["decisions"]
        return decisions

    async def steer(
        self, drawing: Drawing, *, kind: str | None = None, **settings: Unpack[SketchSettings]
    ) -> Json:
        """Let a sketch steer the session, and return how it was interpreted and what it needs.

        Parameters
        ----------
        drawing : (K, 2) numbers, Stroke, bytes, Path, Arrow, Ellipse, Shape, Solid or list of Keyframe
            Points of a stroke [m], a PNG, a sketch, or several in turn.
        kind : "arrow" or "ellipse", optional
            Kind of the sketch, of points alone; recognised by the service if absent.
        **settings
            method, frames, cap, strength, hold, fill, seed; see docs/reference/http-api.md.
        """
        answer: Json = (await self._post("sketches", **_sketch(drawing, kind, settings))).json()
        return answer

    async def sketch(self) -> Json | None:
        """Return the sketch that steers and its goal, as `steer` has returned it; None without one."""
        return await self._get("sketches")

    async def force(self) -> Json:
        """Return the force on the fluid in the next frame besides gravity, as means over cells."""
        return await self._get("force")

    async def pressure(self) -> Json:
        """Return the pressure [Pa] as means over the cells of a grid; of MPM alone."""
        return await self._get("pressure")

    async def release(self) -> None:
        """End the steering by a sketch."""
        await self._client.request("DELETE", f"{self._path}/sketches")

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
        sketch = _sketch(drawing, kind, settings)
        return Trajectory.of(
            await self._post("trajectories", params={"stride": stride}, headers=_NPZ, **sketch)
        )

    async def record(self, frames: int, **settings: Unpack[RecordingSettings]) -> "AsyncJob":
        """Begin a job that computes frames on a copy of the session, and writes them to a file.

        Parameters
        ----------
        frames : int
            Number of frames to compute.
        **settings
            every, format ("npz", "gif", "mp4" or "png"), width and speed; see docs/reference/http-api.md.
        """
        answer = await self._post("recordings", json={"frames": frames, **settings})
        return AsyncJob(self._client, answer.json())

    async def link(self, seconds: int = 86_400) -> Json:
        """Return a link with which others watch the session, where the service has keys.

        Its `token` is a key that shows this session alone; its `page` is the address of the page that does,
        below that of the service. It expires after some `seconds` [s], at most 30 days.
        """
        answer: Json = (await self._post("links", json={"seconds": seconds})).json()
        return answer

    async def take_links_back(self) -> None:
        """Let no link to the session be valid that was made before."""
        await self._client.request("DELETE", f"{self._path}/links")

    async def delete(self) -> None:
        """End the session."""
        await self._client.request("DELETE", self._path)

    @contextlib.asynccontextmanager
    async def stream(self) -> AsyncIterator["AsyncStream"]:
        """Watch the session: a context manager of its stream.

        Raises
        ------
        UnreachableError
            The service cannot be reached.
        ServiceError
            The key of the client is not valid, or may not see the session.
        """
        address = messages.socket_address(self._client.address, self.id)
        try:
            connection = await connect(
                address,
                compression=None,
                open_timeout=self._client.timeout,
                additional_headers=self._client.headers,
            )
        except InvalidStatus as error:
            raise refused_stream(self._client.address, error) from error
        except (OSError, TimeoutError) as error:
            raise unreachable(self._client.address, error) from error
        async with connection:
            stream = AsyncStream(connection, self._client.timeout)
            hello = await stream.receive()
            stream.hello = hello if isinstance(hello, dict) else {}
            yield stream

    async def _get(self, part: str) -> Json:
        answer: Json = (await self._client.request("GET", f"{self._path}/{part}")).json()
        return answer

    async def _post(self, part: str, **options: Any) -> httpx.Response:
        return await self._client.request("POST", f"{self._path}/{part}", **options)


class AsyncJob:
    """Work of a service in the background.

    Attributes
    ----------
    id : str
    info : dict
        The latest description from the service: phase, done, total and more; see docs/reference/http-api.md.
    """

    def __init__(self, client: AsyncClient, info: Json) -> None:
        self._client = client
        self.id: str = info["id"]
        self.info = info
        self._path = f"/v1/jobs/{self.id}"

    def __repr__(self) -> str:
        return f"AsyncJob({self.id}, {self.info['phase']})"

    async def events(self) -> AsyncGenerator[Json, None]:
        """Iterate over the job's `info` as it changes, until the job has ended."""
        try:
            async with self._client.http.stream("GET", f"{self._path}/events") as answer:
                if not answer.is_success:
                    await answer.aread()
                    raise refusal(answer)
                async for line in answer.aiter_lines():
                    if (info := messages.event(line)) is not None:
                        self.info = info
                        yield info
        except httpx.TransportError as error:
            raise unreachable(self._client.address, error) from error

    async def result(self) -> bytes:
        """Wait until the job has ended, and return the file that it has made.

        Raises
        ------
        ServiceError
            The job has failed; the error is what it failed with.
        """
        async for _ in self.events():
            pass
        return (await self._client.request("GET", f"{self._path}/result")).content

    async def delete(self) -> None:
        """End the job, and delete its result."""
        await self._client.request("DELETE", self._path)


class AsyncStream:
    """Live frames of a session, and its player. Iterate over it for frames and statuses.

    The service drops a client that takes more than five seconds for a message; one that falls behind gets the
    newest frame.

    Attributes
    ----------
    hello : dict
        Session, scene and types of the particles, as docs/reference/http-api.md describes them.
    """

    def __init__(self, connection: ClientConnection, timeout: float) -> None:
        self._connection, self._timeout = connection, timeout
        self.hello: Json = {}
        self._length = 1.0

    async def receive(self) -> messages.Message:
        """Return the next message: a frame, or a status of the session.

        Raises
        ------
        ServiceError
            The service refuses a command, or a frame has failed; the stream continues.
        StreamClosedError
            The service has ended the stream.
        UnreachableError
            Nothing has come for the client's `timeout`.
        """
        try:
            async with asyncio.timeout(self._timeout):
                message = messages.read(await self._connection.recv(), self._length)
        except TimeoutError as error:
            raise unreachable(str(self._connection.remote_address), error) from None
        except ConnectionClosed as error:
            raise closed(error) from None
        if isinstance(message, dict) and message["type"] == "hello":
            self._length = max(message["scene"].get("world", {"size": [1.0]})["size"])
        return message

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
        await self._send("play")

    async def pause(self) -> None:
        """Stop the player."""
        await self._send("pause")

    async def step(self, frames: int = 1) -> None:
        """Stop the player, and compute a number of frames."""
        await self._send("step", frames=frames)

    async def reset(self) -> None:
        """Go back to frame 0."""
        await self._send("reset")

    async def speed(self, value: float) -> None:
        """Set the simulated seconds per second of the player, in [0.01, 1]."""
        await self._send("speed", value=value)

    async def push(
        self, point: Sequence[float], velocity: Sequence[float], radius: float, *, cap: float | None = None
    ) -> None:
        """Push the fluid within `radius` [m] of `point` (D,) [m] to `velocity` (D,) [m/s], until `let_go`.

        `cap` is the largest acceleration [g], 15 if absent.
        """
        await self._send("push", point=list(point), velocity=list(velocity), radius=radius, cap=cap)

    async def pull(
        self,
        body: int,
        target: Sequence[float],
        *,
        strength: float,
        grip: Sequence[float] | None = None,
        reach: float = 0.08,
    ) -> None:
        """Pull at a rigid body, until `let_go` or a push; `hybridmpm.control.pull` describes the force.

        Parameters
        ----------
        body : int
            Its number in the scene.
        target : D floats
            Point that it is drawn to [m].
        strength : float > 0
            Largest force [N], in 2D per metre of depth.
        grip : D floats, optional
            Point that is held, from the centre of mass, in the body's own frame [m]; that centre if absent.
        reach : float > 0
            Distance from the target at which a spring at rest gives `strength` [m].
        """
        held = [0.0] * len(target) if grip is None else list(grip)
        await self._send("pull", body=body, grip=held, target=list(target), reach=reach, strength=strength)

    async def let_go(self) -> None:
        """End the push or the pull."""
        await self._send("push_end")

    async def lead(self) -> None:
        """Compute the frames of the session in this client; the service answers with its state."""
        await self._send("lead")

    async def led(self, upto: int, inputs: Sequence[Json] = ()) -> None:
        """Report the frames that this client has computed, and what a hand did in them.

        Parameters
        ----------
        upto : int
            Latest frame.
        inputs : sequence of dict
            Each {"frame": first frame whose state it acts on, "push": arguments of `push`, or None}, or
            "pull" with those of `pull`.
        """
        await self._send("led", upto=upto, inputs=list(inputs))

    async def unlead(self, digest: str | None = None, *, pause: bool = False) -> None:
        """Let the session go on alone, or pause; the service compares this digest with that of its state."""
        await self._send("unlead", digest=digest, pause=pause)

    async def _send(self, kind: str, **values: Any) -> None:
        try:
            await self._connection.send(messages.command(kind, **values))
        except ConnectionClosed as error:
            raise closed(error) from None


def _origin(seed: int | None, **given: Scene | str | Mapping[str, Any] | None) -> Json:
    """Return the body that names a scenario and its seed, a scene or a log.

    Raises
    ------
    ConfigError
        Not exactly one of them is given.
    """
    origin: Json = {name: value for name, value in given.items() if value is not None}
    if len(origin) != 1:
        *others, last = given
        raise ConfigError(f"give exactly one of {', '.join(others)} and {last}")
    if isinstance(origin.get("scene"), Scene):
        origin["scene"] = json.loads(origin["scene"].to_json())
    return origin if seed is None else origin | {"seed": seed}


def _plain(sketch: Sketch) -> Json:
    """Return a sketch as JSON."""
    kept: Json = json.loads(json.dumps(sketch_to_dict(sketch), default=np.ndarray.tolist))
    return kept


def _sketch(drawing: Drawing, kind: str | None, settings: SketchSettings) -> Json:
    """Return a sketch and its settings as arguments of a request."""
    if isinstance(drawing, Path):
        drawing = drawing.read_bytes()
    if isinstance(drawing, bytes):
        if kind is not None:
            raise ConfigError("kind belongs to points: a picture says by its form and colour what it is")
        return {"files": {"sketch": ("sketch.png", drawing, "image/png")}, "data": dict(settings)}
    if isinstance(drawing, Arrow | Ellipse | Shape | Solid):
        return {"json": {"sketch": _plain(drawing), **settings}}
    if isinstance(drawing, Sequence) and drawing and isinstance(drawing[0], Keyframe):
        keyframes = [
            {"sketch": _plain(one.goal), "frames": one.frames, "hold": one.hold, "who": one.who}
            for one in drawing
            if isinstance(one, Keyframe)
        ]
        return {"json": {"keyframes": keyframes, **settings}}
    if isinstance(drawing, Stroke):
        stroke = drawing.model_dump(exclude_none=True)
    else:
        stroke = {"points": np.asarray(unmasked("the points", drawing), dtype=np.float64).tolist()}
    if kind is not None:
        stroke["kind"] = kind
    return {"json": {"strokes": [stroke], **settings}}
