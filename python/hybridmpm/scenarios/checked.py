"""The check that a scene is one, and what to write instead where it is not."""

from collections.abc import Mapping
from pathlib import Path

from hybridmpm._support.suggestions import nearest
from hybridmpm.errors import SceneError
from hybridmpm.scenarios.samplers import SAMPLERS
from hybridmpm.scene import Scene


def checked_scene(value: object) -> Scene:
    """Return a value that is a `Scene`.

    Raises
    ------
    SceneError
        It is none; the message says what to write in its place.
    """
    if isinstance(value, Scene):
        return value
    raise SceneError.of([("scene", f"must be a Scene, got {_described(value)}")])


def _described(value: object) -> str:
    kind = type(value).__name__
    if isinstance(value, str | Path) and Path(value).suffix.lower() in {".json", ".yaml", ".yml"}:
        return f"the path {str(value)!r}: write Scene.load({str(value)!r})"
    if isinstance(value, str):
        near = nearest(value, SAMPLERS)
        advice = "read a file by Scene.load" if near is None else f"write scenarios.{near}()"
        return f"the text {value!r}: {advice}"
    name = getattr(value, "__name__", None)
    if callable(value) and name in SAMPLERS:
        return f"the function {name}: call it, scenarios.{name}()"
    if isinstance(value, Mapping):
        return f"a {kind}: write Scene.parse(...)"
    if isinstance(getattr(value, "scene", None), Scene):
        return f"{value!r}: write .scene behind it"
    return f"{value!r}" if value is None else f"an object of type {kind}"
