"""Drawings as SVG: the closed lines of all that is drawn, in the drawing's own units."""

import itertools
import math
import re
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any
from xml.etree import ElementTree as ET

import numpy as np

from hybridmpm.errors import ConfigError, DataError
from hybridmpm.scene.fields import Points
from hybridmpm.scene.overlaps import Part, as_seen

_PIECES = 32
"""Straight pieces of a curve, or of a quarter of a circle."""
_SPACE = "{http://www.w3.org/2000/svg}"
_GROUPS = {"svg", "g", "a", "switch", "symbol"}
_SHAPES = {"path", "rect", "circle", "ellipse", "polygon", "polyline", "line"}
_ACROSS, _DOWN = {"x", "width", "cx", "rx", "x1", "x2"}, {"y", "height", "cy", "ry", "y1", "y2"}
_LENGTHS = _ACROSS | _DOWN | {"r"}
_WHITE = {"white", "#fff", "#ffffff", "rgb(255,255,255)", "rgb(100%,100%,100%)"}
_TEXTS = {"d", "points", "transform"}
_INHERITED = {"fill", "fill-opacity", "fill-rule", "stroke", "stroke-opacity", "visibility"}
_ZERO = re.compile(r"(0+\.?0*|\.0+)%?")
_CLEAR = re.compile(
    rf"transparent|(rgb|hsl)a?\(([^,]*,){{3}}\s*{_ZERO.pattern}\s*\)|.*/\s*{_ZERO.pattern}\s*\)"
)
"""Colours that draw nothing."""
_UNITS = {
    "": 1.0,
    "px": 1.0,
    "pt": 4 / 3,
    "pc": 16.0,
    "mm": 96 / 25.4,
    "cm": 96 / 2.54,
    "in": 96.0,
    "q": 24 / 25.4,
}
"""Units of the drawing in a unit of length."""
_DEEPEST, _MOST_PARTS = 50, 100_000
_NEEDED = (
    "there must be a path, rectangle, circle, ellipse or polygon that is drawn; make paths of texts, and "
    "outlines of strokes, in the drawing program"
)


def drawn_lines(path: Path) -> list[Points]:
    """Return the closed lines (K, 2) of an SVG file, y up, in its own units; open ones are closed.

    Raises
    ------
    ConfigError
        svgpathtools is not installed.
    DataError
        The file is no SVG, or has no line that encloses something.
    """
    try:
        text = path.read_bytes()
    except (OSError, ValueError) as error:
        fault = getattr(error, "strerror", None) or error
        raise DataError(f"{path.name} cannot be read as SVG: {fault}") from None
    # Entities could grow without bound; in UTF-16 every second byte is 0.
    if re.search(rb"<!\s*(DOCTYPE|ENTITY)[^>]*\[", text.replace(b"\0", b""), re.IGNORECASE):
        advice = "save it as plain SVG"
        raise DataError(f"{path.name}: SVG files with entities of their own are not read; {advice}")
    try:
        from svgpathtools.document import flattened_paths  # noqa: PLC0415 - an extra
    except ImportError:
        raise ConfigError("reading SVG needs svgpathtools: pip install 'hybridmpm[shapes]'") from None
    try:
        root = ET.fromstring(text)  # noqa: S314 - entities are refused above
        paths = flattened_paths(_Drawing(root).plain())
    except Exception as error:  # noqa: BLE001 - readers of damaged files raise whatever comes
        raise DataError(f"{path.name} cannot be read as SVG: {error}") from None
    parts = []
    for one in sorted(paths, key=lambda one: int(one.element.get("order"))):
        lines = _lines_of([one])
        if lines:
            is_nonzero = one.element.get("fill-rule") != "evenodd"
            parts.append(Part(lines, is_nonzero, is_white=one.element.get("fill") in _WHITE))
    _enclosing([line for part in parts for line in part.lines], path.name)
    return _enclosing(as_seen(parts), path.name)


def path_lines(text: str) -> list[Points]:
    """Return the closed lines (K, 2) of an SVG path, the attribute `d` of its element; as `drawn_lines`."""
    try:
        from svgpathtools import parse_path  # noqa: PLC0415 - an extra
    except ImportError:
        raise ConfigError("reading SVG needs svgpathtools: pip install 'hybridmpm[shapes]'") from None
    try:
        lines = _lines_of([parse_path(text)])
    except Exception as error:  # noqa: BLE001 - the parser raises whatever comes
        raise DataError(f"path: it cannot be read: {error}") from None
    return _enclosing(lines, "path")


def _enclosing(lines: list[Points], name: str) -> list[Points]:
    if not lines or not np.ptp(np.concatenate(lines)[:, 1]) > 0:
        raise DataError(f"{name}: it encloses nothing; {_NEEDED}")
    return lines


def _lines_of(paths: Sequence[Any]) -> list[Points]:
    lines = []
    for part in (part for whole in paths if len(whole) for part in whole.continuous_subpaths()):
        points = [part[0].start]
        for piece in part:
            # Arcs may go all the way round.
            quarters = math.ceil(abs(getattr(piece, "delta", 90.0)) / 90.0)
            count = 1 if type(piece).__name__ == "Line" else _PIECES * quarters
            points += [piece.point((k + 1) / count) for k in range(count)]
        if points[0] == points[-1]:
            points.pop()
        flat = np.array(points)
        lines.append(np.stack([flat.real, -flat.imag], axis=-1))
    return [line for line in lines if len(line) > 2]


class _Drawing:
    """What is drawn by the elements of a file, as groups and shapes that svgpathtools reads."""

    def __init__(self, root: ET.Element) -> None:
        self._root = root
        self._named = {element.get("id"): element for element in root.iter() if element.get("id")}
        self._parts = 0
        self._size = _size_of(root)
        self._classes: dict[str, dict[str, str]] = {}
        sheets = "".join(
            sheet.text or "" for sheet in root.iter() if sheet.tag in {f"{_SPACE}style", "style"}
        )
        for names, style in re.findall(r"([^{}]+)\{([^{}]*)\}", re.sub(r"(?s)/\*.*?\*/", "", sheets)):
            for found in re.findall(r"(?:^|,)\s*([\w-]+|[^,]*[.#][\w-]+)\s*(?=,|$)", names.strip()):
                name = re.sub(r".*(?=[.#])", "", found)
                self._classes[name] = self._classes.get(name, {}) | _style(style)

    def plain(self) -> ET.Element:
        """Return a group of groups and shapes alone, all of them seen, with plain numbers as lengths."""
        if self._root.tag.removeprefix(_SPACE) != "svg":
            raise DataError(f"its outermost element is {self._root.tag.rpartition('}')[2]}, not svg")
        group = ET.Element(f"{_SPACE}g")
        group.extend(list(self._children(self._root, {"fill": "black", "stroke": "none"}, 0)))
        return group

    def _children(self, element: ET.Element, inherited: dict[str, str], depth: int) -> Iterator[ET.Element]:
        for child in element:
            if isinstance(child.tag, str):
                yield from self._drawn(child, inherited, depth + 1)

    def _drawn(self, element: ET.Element, inherited: dict[str, str], depth: int) -> Iterator[ET.Element]:
        self._parts += 1
        if depth > _DEEPEST or self._parts > _MOST_PARTS:
            raise DataError(f"it has more than {_MOST_PARTS} parts, or {_DEEPEST} within each other")
        kind = element.tag.removeprefix(_SPACE)
        fields = dict(element.attrib)
        classes = [f".{name}" for name in element.get("class", "").split()]
        for name in (kind, *classes, f"#{element.get('id')}"):
            fields |= self._classes.get(name, {})
        fields |= _style(element.get("style", ""))
        seen = inherited | {name: fields[name] for name in _INHERITED & fields.keys()}
        if fields.get("display") == "none" or fields.get("opacity") in {"0", "0%"}:
            return
        if self._size is not None:
            fields |= {name: _share(name, fields[name], self._size) for name in _LENGTHS & fields.keys()}
        if "transform" in _style(element.get("style", "")):
            raise DataError("transform stands in a style; it must be an attribute: save it as plain SVG")
        if kind == "use":
            yield from self._used(fields, seen, depth)
        elif kind in _GROUPS - {"symbol"}:
            yield self._group(element, fields, seen, depth)
        elif kind in _SHAPES and _is_seen(seen := _painted(seen)):
            for shape in _shape(kind, fields):
                # Lines that are only drawn have no fill, and so no rule.
                rule = "evenodd" if seen["fill"] == "none" else seen.get("fill-rule", "nonzero")
                shape.set("fill-rule", rule)
                color = seen["stroke" if seen["fill"] == "none" else "fill"]
                shape.set("fill", re.sub(r"\s", "", color).lower())
                shape.set("order", str(self._parts))
                yield shape

    def _group(
        self, element: ET.Element, fields: dict[str, str], seen: dict[str, str], depth: int
    ) -> ET.Element:
        kind = element.tag.removeprefix(_SPACE)
        group = ET.Element(f"{_SPACE}g", {"transform": fields.get("transform", "")})
        if kind in {"svg", "symbol"}:
            group.set("transform", f"{group.get('transform')} {_viewport(fields)}")
        children = self._children(element, seen, depth)
        # The first part of a switch that can be shown is.
        group.extend(list(itertools.islice(children, 1 if kind == "switch" else None)))
        return group

    def _used(self, fields: dict[str, str], seen: dict[str, str], depth: int) -> Iterator[ET.Element]:
        name = fields.get("href") or fields.get("{http://www.w3.org/1999/xlink}href", "")
        if name.removeprefix("#") not in self._named:
            raise DataError(f"it uses {name!r}, which is not in the file")
        used = self._named[name.removeprefix("#")]
        moved = f"translate({_length('x', fields)} {_length('y', fields)})"
        group = ET.Element(f"{_SPACE}g", {"transform": f"{fields.get('transform', '')} {moved}"})
        if used.tag.removeprefix(_SPACE) in {"symbol", "svg"}:
            own = dict(used.attrib) | {side: fields[side] for side in ("width", "height") if side in fields}
            group.append(self._group(used, own, seen, depth + 1))
        else:
            group.extend(list(self._drawn(used, seen, depth + 1)))
        yield group


def _painted(style: dict[str, str]) -> dict[str, str]:
    """Return a style with none in the place of paints that are transparent."""
    found = dict(style)
    for paint in ("fill", "stroke"):
        if _CLEAR.fullmatch(style[paint]) or _ZERO.fullmatch(style.get(f"{paint}-opacity", "1")):
            found[paint] = "none"
    return found


def _is_seen(style: dict[str, str]) -> bool:
    if style.get("visibility") in {"hidden", "collapse"}:
        return False
    return not style["fill"] == style["stroke"] == "none"


def _style(text: str) -> dict[str, str]:
    pairs = (part.partition(":") for part in text.split(";"))
    return {name.strip(): value.replace("!important", "").strip() for name, colon, value in pairs if colon}


def _size_of(root: ET.Element) -> tuple[float, float] | None:
    """Return width and height of a drawing, of which lengths may be percentages."""
    box = root.get("viewBox", "").replace(",", " ").split()
    try:
        sides = box[2:] if len(box) == 4 else [root.get("width", ""), root.get("height", "")]
        width, height = (_length("size", {"size": side}) for side in sides)
    except DataError:
        return None
    return (width, height) if width > 0 and height > 0 else None


def _share(name: str, text: str, size: tuple[float, float]) -> str:
    """Return a length whose percentage is one of the drawing's size."""
    number = text.strip().removesuffix("%")
    if number == text.strip():
        return text
    width, height = size
    across = (
        width if name in _ACROSS else height if name in _DOWN else math.hypot(width, height) / math.sqrt(2)
    )
    try:
        return repr(float(number) / 100 * across)
    except ValueError:
        return text


def _length(name: str, fields: dict[str, str], absent: float = 0.0) -> float:
    """Return a length in the drawing's units."""
    text = fields.get(name, "").strip().lower()
    if text in {"", "auto"}:
        return absent
    found = re.fullmatch(r"([-+]?(?:\d+\.?\d*|\.\d+)(?:e[-+]?\d+)?)\s*([a-z]*)", text)
    if not found or found[2] not in _UNITS:
        units = ", ".join(unit for unit in _UNITS if unit)
        raise DataError(f"{name} must be a number, with or without one of {units}, got {text!r}")
    return float(found[1]) * _UNITS[found[2]]


def _viewport(fields: dict[str, str]) -> str:
    """Return the transform of a drawing within a drawing."""
    x, y = _length("x", fields), _length("y", fields)
    numbers = [float(number) for number in fields.get("viewBox", "").replace(",", " ").split()]
    if len(numbers) != 4 or not (numbers[2] > 0 and numbers[3] > 0):
        return f"translate({x} {y})"
    left, top, across, down = numbers
    width, height = _length("width", fields, across), _length("height", fields, down)
    wide, high = width / across, height / down
    fit = fields.get("preserveAspectRatio", "xMidYMid").split()
    if fit[0] != "none":
        wide = high = (max if "slice" in fit else min)(wide, high)
        parts = {"Min": 0.0, "Mid": 0.5, "Max": 1.0}
        x += (width - wide * across) * parts.get(fit[0][1:4], 0.5)
        y += (height - high * down) * parts.get(fit[0][5:8], 0.5)
    return f"translate({x} {y}) scale({wide} {high}) translate({-left} {-top})"


def _shape(kind: str, fields: dict[str, str]) -> Iterator[ET.Element]:
    """Yield a shape with plain numbers; nothing if it has no extent, for such are not drawn."""
    plain: dict[str, str] = {name: fields[name] for name in _TEXTS & fields.keys()}
    plain |= {name: repr(_length(name, fields)) for name in _LENGTHS if fields.get(name, "auto") != "auto"}
    if kind == "rect":
        width, height = _length("width", fields), _length("height", fields)
        if not (width > 0 and height > 0):
            return
        rx = _length("rx", fields, _length("ry", fields))
        ry = _length("ry", fields, rx)
        plain |= {"rx": repr(min(rx, width / 2)), "ry": repr(min(ry, height / 2))}
        if not (rx > 0 and ry > 0):
            del plain["rx"], plain["ry"]
    if kind == "circle" and not _length("r", fields) > 0:
        return
    if kind == "ellipse":
        rx = _length("rx", fields, _length("ry", fields))
        ry = _length("ry", fields, rx)
        if not (rx > 0 and ry > 0):
            return
        plain |= {"rx": repr(rx), "ry": repr(ry)}
    yield ET.Element(f"{_SPACE}{kind}", plain)
