"""`sketch_of`: the sketch in a file of the command line, or several in turn."""

from pathlib import Path
from typing import Any

import click
from PIL import Image

from hybridmpm.control import (
    Keyframe,
    Sketch,
    Solid,
    parse_png,
    parse_strokes,
    shape_of_path,
    shape_of_picture,
    shape_of_text,
)
from hybridmpm.control.guidance import sketch_from_dict
from hybridmpm.errors import ConfigError, SketchError
from hybridmpm.scene.plain_data import from_json

_PLACE = {"center", "height"}
_PLACES = {
    "text": {*_PLACE, "width"},
    "picture": {*_PLACE, "width"},
    "path": {*_PLACE, "width"},
    "file": _PLACE,
}
"""Fields beside a source, of which `width` may be absent."""
_SOURCES = ("strokes", "sketch", "text", "picture", "path", "file", "keyframes")
_FORMS = f"must be an object with one of {', '.join(_SOURCES)}"


def sketch_of(file: Path, size: tuple[float, ...]) -> Sketch | list[Keyframe]:
    """Return the sketch in a file, or several in turn, of a world of this size [m].

    Raises
    ------
    SketchError
        The file contains none; the message names it.
    """
    data = file.read_bytes()
    try:
        if file.suffix.lower() != ".json":
            sketch = parse_png(data, size)
            if sketch.note is not None:
                click.echo(f"{file}: {sketch.note}", err=True)
            return sketch
        try:
            content = from_json(data)
        except ValueError as error:
            raise SketchError(f"is not JSON: {error}") from None
        if isinstance(content, dict) and isinstance(content.get("keyframes"), list):
            return [_keyframe(one, file.parent, size) for one in content["keyframes"]]
        return _goal(content, file.parent, size)
    except ConfigError as error:
        raise SketchError(f"{file}: {error}") from error


def _keyframe(content: Any, folder: Path, size: tuple[float, ...]) -> Keyframe:
    if not isinstance(content, dict):
        raise SketchError(_FORMS)
    times = {name: content[name] for name in ("frames", "hold", "who") if name in content}
    goal = {name: value for name, value in content.items() if name not in times}
    return Keyframe(_goal(goal, folder, size), **times)


def _goal(content: Any, folder: Path, size: tuple[float, ...]) -> Sketch:
    """Return the one sketch of plain data; pictures and surfaces are files beside it."""
    sources = [name for name in _SOURCES[:-1] if isinstance(content, dict) and name in content]
    if len(sources) != 1:
        raise SketchError(_FORMS)
    (source,) = sources
    place = {name: value for name, value in content.items() if name != source}
    allowed = _PLACES.get(source, set())
    if unknown := sorted(set(place) - allowed):
        raise SketchError(f"{unknown[0]}: there is no such field beside {source}")
    if missing := sorted(allowed - {"width"} - set(place)):
        raise SketchError(f"{missing[0]} is missing beside {source}, in metres")
    value = content[source]
    match source:
        case "strokes":
            return parse_strokes(value, size)
        case "sketch":
            return _interpreted(value)
        case "text":
            return shape_of_text(value, **place)
        case "path":
            return shape_of_path(value, **place)
        case "file":
            return Solid.read(folder / str(value), **place)
        case _:
            with Image.open(folder / value) as picture:
                return shape_of_picture(picture, **place)


def _interpreted(value: Any) -> Sketch:
    try:
        return sketch_from_dict(dict(value))
    except (TypeError, KeyError, ValueError):
        kinds = "arrow, ellipse, shape or solid"
        raise SketchError(f"sketch: it must have a kind, {kinds}, and its fields") from None
