"""The calls of the service, as data: what is sent, and how its answer is read."""

import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Generic, Literal, TypeAlias, TypedDict, TypeVar
from urllib.parse import quote

import httpx
import numpy as np
import numpy.typing as npt

from hybridmpm.client.answers import Particles, Trajectory
from hybridmpm.control import Stroke
from hybridmpm.errors import ConfigError
from hybridmpm.scene import Scene

T = TypeVar("T")
Json: TypeAlias = dict[str, Any]
Drawing: TypeAlias = npt.ArrayLike | Stroke | bytes | Path
"""A sketch: points (K, 2) [m], a stroke, or a PNG as bytes or as a file."""
_NPZ = {"Accept": "application/x-npz"}


class SketchSettings(TypedDict, total=False):
    """How a sketch is followed; what is absent takes the service's default."""

    method: str
    """"auto", or a method of `hybridmpm.control.METHODS`."""
    frames: int
    """Number of frames in which the goal is to be reached."""
    cap: float
    """Largest acceleration of a particle, in (0, 1000] [g]."""
    strength: float
    """Factor on `cap`, in (0, 1]."""
    hold: int
    """Number of frames for which the goal is kept."""
    fill: Literal["even", "shrink"]
    """What becomes of an oval larger than the fluid."""
    seed: int
    """Seed of what a method draws at random, in [0, 2^32)."""


class RecordingSettings(TypedDict, total=False):
    """What a recording holds and how it looks; what is absent takes the service's default."""

    every: int
    """Number of frames from one recorded state to the next."""
    format: Literal["npz", "gif", "mp4", "png"]
    """File to write."""
    width: int
    """Width of a picture, in [64, 1280] [pixels]."""
    speed: float
    """Simulated seconds in a second of film, in [0.01, 10]."""


class DataSetSettings(TypedDict, total=False):
    """What a data set holds besides its training split; what is absent takes the service's default."""

    valid: int
    """Number of trajectories for validation."""
    test: int
    """Number of trajectories for tests."""
    seed: int
    """First seed of each split, counted from the start of the split's seeds."""
    frames: int
    """Number of frames of a trajectory."""
    stride: int
    """Number of frames from one stored state to the next."""
    r_p: float
    """Number of particles over that of the scene, in (0, 1]."""


class SimulatorSettings(TypedDict, total=False):
    """Who simulates a new session; what is absent takes the service's default."""

    solver: Literal["mpm", "hybrid", "neural"]
    coarse: str
    """From "1/64" to "1/4": the part of the particles that MPM simulates, carrying the others."""
    model: str
    """Name of a network."""
    r_c: float
    """Value below which the safeguard alarms, in [-1, 1]."""
    safeguard: Literal["ours", "paper"]


class PlanSettings(TypedDict, total=False):
    """What a coarse level has to keep within: give `max_error` or `budget_ms`."""

    max_error: float
    """Largest mean error."""
    budget_ms: float
    """Longest time of a frame [ms]."""
    measure: str
    """Measure of the error; "grid_rmse" if absent."""


@dataclass(frozen=True)
class Call(Generic[T]):
    """One request, and the reader of its answer."""

    method: Literal["GET", "POST", "DELETE"]
    path: str
    read: Callable[[httpx.Response], T]
    options: Mapping[str, Any] = field(default_factory=dict)
    """Further arguments of `httpx.Client.request`."""


def ready() -> Call[bool]:
    """Return the call that asks whether a session can be created now; a refusal is raised."""
    return Call("GET", "/readyz", lambda _answer: True)


def scenario_list() -> Call[list[Json]]:
    """Return the call for the kinds of scenes."""
    return Call("GET", "/v1/scenarios", _part("scenarios"))


def scenario(name: str, seed: int) -> Call[Scene]:
    """Return the call for the scene of a seed."""
    path = f"/v1/scenarios/{quote(name, safe='')}"
    return Call("GET", path, lambda answer: Scene.from_json(answer.content), {"params": {"seed": seed}})


def model_list() -> Call[list[Json]]:
    """Return the call for the networks."""
    return Call("GET", "/v1/models", _part("models"))


def plan(
    scenario: str | None,
    seed: int | None,
    scene: Scene | Mapping[str, Any] | None,
    settings: PlanSettings,
) -> Call[Json]:
    """Return the call that chooses a level.

    Raises
    ------
    ConfigError
        Not exactly one of `scenario` and `scene` is given.
    """
    if (scenario is None) == (scene is None):
        raise ConfigError("give exactly one of scenario and scene")
    origin = _origin({"scenario": scenario, "seed": seed, "scene": scene})
    return Call("POST", "/v1/plans", _json, {"json": {**origin, **settings}})


def session_list() -> Call[list[Json]]:
    """Return the call for the sessions."""
    return Call("GET", "/v1/sessions", _part("sessions"))


def session(session_id: str) -> Call[Json]:
    """Return the call for one session."""
    return Call("GET", f"/v1/sessions/{session_id}", _json)


def create(
    scenario: str | None,
    seed: int | None,
    scene: Scene | Mapping[str, Any] | None,
    log: Mapping[str, Any] | None,
    settings: SimulatorSettings,
) -> Call[Json]:
    """Return the call that creates a session.

    Raises
    ------
    ConfigError
        Not exactly one of `scenario`, `scene` and `log` is given.
    """
    given = {"scenario": scenario, "scene": scene, "log": log}
    if sum(value is not None for value in given.values()) != 1:
        raise ConfigError("give exactly one of scenario, scene and log")
    origin = _origin(given | {"seed": seed})
    return Call("POST", "/v1/sessions", _json, {"json": {**origin, **settings}})


def check(
    scenario: str | None,
    seed: int | None,
    scene: Scene | Mapping[str, Any] | None,
    settings: SimulatorSettings,
) -> Call[Json]:
    """Return the call that checks a scene before its first frame.

    Raises
    ------
    ConfigError
        Not exactly one of `scenario` and `scene` is given.
    """
    if (scenario is None) == (scene is None):
        raise ConfigError("give exactly one of scenario and scene")
    origin = _origin({"scenario": scenario, "seed": seed, "scene": scene})
    return Call("POST", "/v1/checks", _json, {"json": {**origin, **settings}})


def delete(session_id: str) -> Call[None]:
    """Return the call that ends a session."""
    return Call("DELETE", f"/v1/sessions/{session_id}", _nothing)


def advance(session_id: str, frames: int) -> Call[Json]:
    """Return the call that computes frames."""
    return Call("POST", f"/v1/sessions/{session_id}/advance", _json, {"json": {"frames": frames}})


def particles(session_id: str) -> Call[Particles]:
    """Return the call for the particles."""
    return Call("GET", f"/v1/sessions/{session_id}/particles", Particles.of, {"headers": _NPZ})


def fork(session_id: str) -> Call[Json]:
    """Return the call for a new session that goes on from the state of another."""
    return Call("POST", f"/v1/sessions/{session_id}/fork", _json)


def log(session_id: str) -> Call[Json]:
    """Return the call for all that a session can be computed again from."""
    return Call("GET", f"/v1/sessions/{session_id}/log", _json)


def decisions(session_id: str) -> Call[list[Json]]:
    """Return the call for who simulated, and why."""
    return Call("GET", f"/v1/sessions/{session_id}/decisions", _part("decisions"))


def steer(session_id: str, drawing: Drawing, kind: str | None, settings: SketchSettings) -> Call[Json]:
    """Return the call that lets a sketch steer a session."""
    body = _sketch(drawing, kind, settings)
    return Call("POST", f"/v1/sessions/{session_id}/sketches", _json, body)


def force(session_id: str) -> Call[Json]:
    """Return the call for what steers in the next frame."""
    return Call("GET", f"/v1/sessions/{session_id}/force", _json)


def pressure(session_id: str) -> Call[Json]:
    """Return the call for the pressure in the cells of a grid."""
    return Call("GET", f"/v1/sessions/{session_id}/pressure", _json)


def release(session_id: str) -> Call[None]:
    """Return the call that lets no sketch steer a session."""
    return Call("DELETE", f"/v1/sessions/{session_id}/sketches", _nothing)


def trace(
    session_id: str, drawing: Drawing, kind: str | None, stride: int, settings: SketchSettings
) -> Call[Trajectory]:
    """Return the call that follows a sketch on a copy of a session."""
    body = _sketch(drawing, kind, settings) | {"params": {"stride": stride}, "headers": _NPZ}
    return Call("POST", f"/v1/sessions/{session_id}/trajectories", Trajectory.of, body)


def record(session_id: str, frames: int, settings: RecordingSettings) -> Call[Json]:
    """Return the call that begins a job, which records a copy of a session."""
    body = {"json": {"frames": frames, **settings}}
    return Call("POST", f"/v1/sessions/{session_id}/recordings", _json, body)


def dataset(scenario: str, trajectories: int, settings: DataSetSettings) -> Call[Json]:
    """Return the call that begins a job, which makes a data set."""
    body = {"json": {"scenario": scenario, "trajectories": trajectories, **settings}}
    return Call("POST", "/v1/datasets", _json, body)


def job_list() -> Call[list[Json]]:
    """Return the call for the jobs."""
    return Call("GET", "/v1/jobs", _part("jobs"))


def job(job_id: str) -> Call[Json]:
    """Return the call for one job."""
    return Call("GET", f"/v1/jobs/{job_id}", _json)


def result(job_id: str) -> Call[bytes]:
    """Return the call for the file that a job has made."""
    return Call("GET", f"/v1/jobs/{job_id}/result", lambda answer: answer.content)


def delete_job(job_id: str) -> Call[None]:
    """Return the call that ends a job."""
    return Call("DELETE", f"/v1/jobs/{job_id}", _nothing)


def _sketch(drawing: Drawing, kind: str | None, settings: SketchSettings) -> dict[str, Any]:
    """Return a sketch and its settings as arguments of a request."""
    if isinstance(drawing, Path):
        drawing = drawing.read_bytes()
    if isinstance(drawing, bytes):
        if kind is not None:
            raise ConfigError("kind belongs to points: a picture says by its form and colour what it is")
        return {"files": {"sketch": ("sketch.png", drawing, "image/png")}, "data": dict(settings)}
    if isinstance(drawing, Stroke):
        stroke = drawing.model_dump(exclude_none=True)
    else:
        stroke = {"points": np.asarray(drawing, dtype=np.float64).tolist()}
    if kind is not None:
        stroke["kind"] = kind
    return {"json": {"strokes": [stroke], **settings}}


def _json(answer: httpx.Response) -> Json:
    body: Json = answer.json()
    return body


def _part(name: str) -> Callable[[httpx.Response], list[Json]]:
    def read(answer: httpx.Response) -> list[Json]:
        part: list[Json] = answer.json()[name]
        return part

    return read


def _nothing(_answer: httpx.Response) -> None:
    return None


def _origin(given: Mapping[str, Any]) -> Json:
    """Return what was given, as JSON: a scenario with its seed, a scene or a log."""
    origin = {name: value for name, value in given.items() if value is not None}
    if isinstance(origin.get("scene"), Scene):
        origin["scene"] = json.loads(origin["scene"].to_json())
    return origin
