"""Work on what clients send and receive, made of functions that also run in a process apart (see `apart`)."""

import json
import re
import tempfile
import warnings
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
from pydantic import ValidationError

from hybridmpm import (
    ConfigError,
    DataError,
    MeshObstacle,
    PolygonObstacle,
    Scene,
    SceneError,
    UnknownScenarioError,
    checking,
    export,
    scenarios,
)
from hybridmpm.checking import Finding, SceneCheck
from hybridmpm.mpm import MpmSolver
from hybridmpm.planner import Estimate, Plan, estimates, plan
from hybridmpm.recording import Recording
from hybridmpm.scene import plain_data, shape_in
from hybridmpm_service.errors import FieldError, field_path
from hybridmpm_service.sessions.admission import building_cost, within_limits
from hybridmpm_service.sessions.inputs import (
    INPUT,
    Input,
    Inputs,
    PullInput,
    PushInput,
    SketchInput,
    check_hand,
)
from hybridmpm_service.sessions.solvers import SolverChoice, SolverFactory
from hybridmpm_service.settings import Settings

_INPUTS = re.compile(rb'"inputs"\s*:\s*\[')
_SMALL = 5_000_000
"""Building cost of scenes that are built without a trial: it takes some tens of milliseconds."""
_MOST_FAULTS, _MOST_FIELDS = 50, 100
_solvers = cache(SolverFactory)


def read_shape(data: bytes, kind: str, center: tuple[float, ...], height: float) -> dict[str, Any] | str:
    """Return the shape in a file of this ending as fields of a body, or what is wrong with the file."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / f"file.{kind}"
        path.write_bytes(data)
        try:
            shape = shape_in(path, center, height)
            # Faults of surfaces, such as open edges, are those of an obstacle.
            solid = (MeshObstacle if shape["shape"] == "mesh" else PolygonObstacle)(**shape)
        except (ConfigError, DataError) as error:
            return str(error).replace(str(path), "the file").replace(path.name, "the file")
        return solid.model_dump(mode="json", include={"shape", "vertices", "triangles"})


def surface_file(recording: Recording, kind: str) -> bytes:
    """Return the surfaces of the last state of a recording as a file of this ending."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / f"surface.{kind}"
        export.save(path, recording, style=export.Style(surface=True))
        return path.read_bytes()


@dataclass(frozen=True)
class SceneSource:
    """A scene as a client chooses it: a scenario with a seed, or a scene, read already or not."""

    scenario: str | None = None
    seed: int | None = None
    data: Mapping[str, Any] | Scene | None = None

    def scene(self, settings: Settings) -> Scene:
        """Return the scene, within the limits of the settings.

        Raises
        ------
        SceneError
            The scene is not valid, or beyond a limit.
        FieldError
            There is no such scenario.
        """
        if isinstance(self.data, Scene):
            return within_limits(self.data, settings)
        if self.scenario is None:
            return within_limits(read(self.data), settings)
        try:
            return within_limits(scenarios.get(self.scenario, self.seed or 0), settings)
        except UnknownScenarioError as err:
            raise FieldError("body.scenario", str(err).removeprefix("scenario: ")) from None


def value_of(text: bytes) -> Any:
    """Return the value of a JSON text.

    Raises
    ------
    ValueError, RecursionError
        It is no such text, or an object has a key twice, or many more fields than any model.
    """
    value = plain_data.from_json(text)
    waiting = [value]
    while waiting:
        one = waiting.pop()
        if isinstance(one, dict):
            # An error for each unknown field would take long to make.
            if len(one) > _MOST_FIELDS:
                raise ValueError(f"an object has {len(one)} fields, and may have at most {_MOST_FIELDS}")
            waiting += one.values()
        elif isinstance(one, list):
            waiting += one
    return value


def read_log(data: bytes) -> Any:
    """Return the value of a log's text, with its inputs as `Inputs`.

    Each input is read by itself: one call for all of them would keep Python's global lock for long.
    """
    found = _INPUTS.search(data)
    if found is None:
        return value_of(data)
    text, place = data.decode(), len(data[: found.end()].decode())
    inputs = Inputs()
    decoder = json.JSONDecoder()
    while (place := _after(text, place)) < len(text) and text[place] != "]":
        if inputs:
            if text[place] != ",":
                raise ValueError(f"expected , or ] at character {place}")
            place = _after(text, place + 1)
        start = place
        one, place = decoder.raw_decode(text, place)
        try:
            inputs.append(INPUT.validate_python(one))
        except ValidationError as err:
            value_of(text[start:place].encode())
            fault = err.errors(include_url=False)[0]
            field = field_path(("body", "log", "inputs", len(inputs), *fault["loc"]))
            raise FieldError(field, fault["msg"].removeprefix("Value error, ")) from None
    body = value_of(data[: found.end()] + text[place:].encode())
    log = body["log"] if isinstance(body, dict) else None
    if isinstance(log, dict) and log.get("inputs") == []:
        log["inputs"] = inputs
    elif inputs:
        raise ValueError("the inputs of a log are to stand in it once")
    return body


def _after(text: str, place: int) -> int:
    """Return the place of the next character that is no white space."""
    while place < len(text) and text[place] in " \t\r\n":
        place += 1
    return place


def read(data: Any) -> Scene:
    """Return the scene of plain data; raises `SceneError`, with the first faults of many."""
    try:
        return Scene.parse(data)
    except SceneError as err:
        raise SceneError.of(err.problems[:_MOST_FAULTS]) from None


def read_logged(data: Any, inputs: Inputs, most: int) -> Scene:
    """Return the scene of a log.

    Parameters
    ----------
    data : mapping
        The scene.
    inputs : Inputs
    most : int
        Largest number of frames that a sketch may steer.

    Raises
    ------
    SceneError, FieldError, SketchError
        The scene is not valid, or an input does not fit it or a limit of this server.
    """
    scene = read(data)
    for place, one in enumerate(inputs):
        _check(one, f"body.log.inputs[{place}]", scene, most)
    return scene


def _check(one: Input, field: str, scene: Scene, most_sketch_frames: int) -> None:
    """Refuse an input that does not fit the scene, or a limit of this server."""
    if isinstance(one, SketchInput):
        settings = one.settings
        longest = max(settings.most, (settings.frames or 1) + settings.hold)
        if longest > most_sketch_frames:
            raise FieldError(
                f"{field}.settings", f"steers for up to {longest} frames, at most {most_sketch_frames} may be"
            )
        try:
            one.goals()
        except TypeError:
            text = (
                "an arrow has points, an ellipse center, axes and angle, a shape outlines, a solid vertices "
                "and triangles"
            )
            raise FieldError(f"{field}.sketch", text) from None
    if isinstance(one, PushInput) and one.push is not None:
        check_hand(one.push, scene, f"{field}.push.")
    if isinstance(one, PullInput):
        check_hand(one.pull, scene, f"{field}.pull.")


def examined(source: SceneSource, settings: Settings) -> tuple[Scene, tuple[Finding, ...]]:
    """Return a scene and its static findings; one that takes too long to build is found out here.

    Raises
    ------
    SceneError, FieldError
        As `SceneSource.scene`; or the scene cannot be filled with particles.
    """
    scene = source.scene(settings)
    if building_cost(scene) > _SMALL:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            MpmSolver(scene)
    return scene, checking.findings(scene)


def checked(source: SceneSource, settings: Settings, choice: SolverChoice) -> SceneCheck:
    """Return the check of a scene for a simulator; errors as `SceneSource.scene` and `SolverFactory.make`."""
    scene = source.scene(settings)
    if choice == SolverChoice() and settings.threads == 1:
        return checking.check(scene)
    solvers = _solvers(threads=settings.threads, folder=settings.models)
    return checking.check_with(scene, lambda: solvers.make(choice, scene, source.scenario).simulator)


def planned(
    source: SceneSource, settings: Settings, demand: Mapping[str, Any]
) -> tuple[Plan, list[Estimate]]:
    """Return the plan for a scene, and the estimates of all methods.

    Parameters
    ----------
    source : SceneSource
    settings : Settings
    demand : mapping
        Other arguments of `hybridmpm.planner.plan`.
    """
    scene = source.scene(settings)
    return plan(scene, **demand), [one for one, _ in estimates(scene, measure=demand["measure"])]


def json_object(values: Mapping[str, Any]) -> bytes:
    """Return numbers, lists and arrays as a JSON object, with null in place of NaN, which JSON lacks."""
    plain = {name: _listed(one) if isinstance(one, np.ndarray) else one for name, one in values.items()}
    return json.dumps(plain, allow_nan=False, separators=(",", ":")).encode()


def _listed(array: npt.NDArray[Any]) -> Any:
    if array.dtype.kind == "f" and (absent := np.isnan(array)).any():
        array = array.astype(object)
        array[absent] = None
    return array.tolist()


def warm_up() -> None:
    """Import and read what the functions of this module need; no thread is started."""
    planned(SceneSource("water_2d", 0), Settings(), {"budget_ms": 1.0, "measure": "grid_rmse"})
    scenarios.get("water_3d", 0).sample()
