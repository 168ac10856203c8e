"""Shapes in files: surfaces of triangles, drawings as SVG, and pictures whose dark parts are a shape."""

import math
import re
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from hybridmpm._support.arguments import float64, real
from hybridmpm.errors import ConfigError, DataError, SceneError
from hybridmpm.scene.facets import corners_around, mesh_of
from hybridmpm.scene.fields import LONGEST, Points
from hybridmpm.scene.lines import simplified

if TYPE_CHECKING:
    from PIL import Image

SURFACES, DRAWINGS = (".stl", ".obj", ".ply", ".glb"), (".svg", ".png")
"""Endings of files of closed surfaces, and of outlines in the plane."""
_PIECES = 16
"""Straight pieces of a curve, or of a quarter of a circle."""
_MOST_PIXELS = 4_000_000
_FINE = 400
"""Smallest detail of an outline that is kept, as a part of its height, where it has too many points."""
_FEW_POINTS = 512
"""Points of all outlines beyond which they are made simpler."""
_PLACED = {"file", "center", "height"}


def shape_in(path: str | Path, center: Sequence[float], height: float) -> dict[str, Any]:
    """Return the shape in a file as fields of a body or an obstacle: shape, vertices, triangles of a mesh.

    Parameters
    ----------
    path : path
        .stl, .obj, .ply and .glb contain a closed surface, for 3D. Of an .svg the paths, rectangles, circles,
        ellipses and polygons count, by the even-odd rule and in any colour; of a .png the dark parts.
    center : float (D,)
        Middle of the box around the shape [m].
    height : float in [1e-6, 4096]
        Length of that box along y [m].

    Raises
    ------
    ConfigError
        A package is missing (pip install 'hybridmpm[shapes]'), or the ending is another one.
    DataError
        The file cannot be read, or contains no such shape.
    """
    path, suffix = Path(path), Path(path).suffix.lower()
    middle = float64("center", center)
    if suffix not in SURFACES + DRAWINGS:
        raise ConfigError(f"files of shapes end in {', '.join(SURFACES + DRAWINGS)}; got {path.name!r}")
    dim = 3 if suffix in SURFACES else 2
    if middle.shape != (dim,):
        raise ConfigError(f"center must have {dim} numbers for {suffix}, got shape {middle.shape}")
    if suffix in SURFACES:
        return {"shape": "mesh"} | mesh_of(path, middle.tolist(), height)
    lines = drawn_lines(path) if suffix == ".svg" else dark_lines(_grey(path))
    return {"shape": "polygon", "vertices": corners_around(placed(lines, middle, height))}


def resolved(data: Any, folder: Path) -> Any:
    """Return the plain data of a scene with shapes in the place of files, which lie beside it in a folder.

    A body or an obstacle may have `file`, `center` and `height`, as of `shape_in`, in the place of its shape.

    Raises
    ------
    SceneError
        A file cannot be read; the message names the field and the fault.
    """
    if not isinstance(data, dict):
        return data
    found, faults = dict(data), []
    for group in ("bodies", "obstacles"):
        parts = data.get(group)
        if not isinstance(parts, list):
            continue
        found[group] = list(parts)
        for index, part in enumerate(parts):
            if not isinstance(part, dict) or "file" not in part:
                continue
            where = f"{group}[{index}]"
            missing = sorted(_PLACED - part.keys())
            if missing:
                faults.append((f"{where}.{missing[0]}", "is required beside file, in metres"))
                continue
            try:
                shape = shape_in(folder / str(part["file"]), part["center"], part["height"])
            except (ConfigError, DataError, OSError) as error:
                faults.append((f"{where}.file", str(error)))
                continue
            rest = {name: value for name, value in part.items() if name not in _PLACED}
            found[group][index] = shape | rest
    if faults:
        raise SceneError.of(faults)
    return found


def drawn_lines(path: Path) -> list[Points]:
    """Return the closed lines (K, 2) of an SVG file, y up, in its own units; open ones are closed.

    Raises
    ------
    ConfigError
        svgpathtools is not installed.
    DataError
        The file is no SVG, or has no line that encloses something.
    """
    text = path.read_bytes()
    # Entities could grow without bound.
    if re.search(rb"<!\s*(DOCTYPE|ENTITY)[^>]*\[", text, re.IGNORECASE):
        raise DataError(f"{path.name}: SVG files with entities of their own are not read")
    try:
        from svgpathtools import Document  # noqa: PLC0415 - an extra
    except ImportError:
        raise ConfigError("reading SVG needs svgpathtools: pip install 'hybridmpm[shapes]'") from None
    try:
        paths = Document.from_svg_string(text.decode()).paths()
    except Exception as error:  # noqa: BLE001 - readers of damaged files raise whatever comes
        raise DataError(f"{path.name} cannot be read as SVG: {error}") from None
    return _lines_of(paths, path.name)


def path_lines(text: str) -> list[Points]:
    """Return the closed lines (K, 2) of an SVG path, the attribute `d` of its element; as `drawn_lines`."""
    try:
        from svgpathtools import parse_path  # noqa: PLC0415 - an extra
    except ImportError:
        raise ConfigError("reading SVG needs svgpathtools: pip install 'hybridmpm[shapes]'") from None
    try:
        return _lines_of([parse_path(text)], "path")
    except DataError:
        raise
    except Exception as error:  # noqa: BLE001 - the parser raises whatever comes
        raise DataError(f"path: it cannot be read: {error}") from None


def _lines_of(paths: Sequence[Any], name: str) -> list[Points]:
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
    lines = [line for line in lines if len(line) > 2]
    if not lines or not np.ptp(np.concatenate(lines)[:, 1]) > 0:
        raise DataError(f"{name}: it encloses nothing")
    return lines


def _grey(path: Path) -> npt.NDArray[np.float64]:
    from PIL import Image  # noqa: PLC0415 - scenes without pictures do not need it

    try:
        with Image.open(path) as picture:
            if picture.width * picture.height > _MOST_PIXELS:
                raise DataError(f"{path.name} has more than {_MOST_PIXELS} pixels; make it smaller")
            return grey_of(picture)
    except (OSError, ValueError, Image.DecompressionBombError) as error:
        raise DataError(f"{path.name} cannot be read as a picture: {error}") from None


def grey_of(picture: "Image.Image") -> npt.NDArray[np.float64]:
    """Return the grey values (H, W) of a picture; transparent parts are white."""
    from PIL import Image  # noqa: PLC0415 - as above

    rgba = picture.convert("RGBA")
    ground = Image.new("RGBA", rgba.size, "white")
    return np.asarray(Image.alpha_composite(ground, rgba).convert("L"), dtype=np.float64)


def dark_lines(grey: npt.NDArray[np.float64]) -> list[Points]:
    """Return the lines (K, 2) around the dark parts of grey values (H, W) [pixels], y up.

    Raises
    ------
    ConfigError
        contourpy is not installed.
    DataError
        No part is darker than the middle of the range.
    """
    middle = (grey.min() + grey.max()) / 2
    if not grey.min() < middle:
        raise DataError("picture: all of it is equally dark; a shape needs dark parts on a light ground")
    try:
        import contourpy  # noqa: PLC0415 - an extra
    except ImportError:
        raise ConfigError("tracing a picture needs contourpy: pip install 'hybridmpm[shapes]'") from None
    edged = np.pad(middle - grey, 1, constant_values=min(float((middle - grey).min()), -1e-9))
    generator: Any = contourpy.contour_generator(z=edged)
    # Row 0 is on top.
    lines = [line[:-1] * [1.0, -1.0] for line in generator.lines(0.0) if len(line) > 3]
    if not lines:
        raise DataError("picture: it has no dark part that can be traced")
    return lines


def placed(lines: Sequence[Points], center: npt.ArrayLike, height: float, fine: int = _FINE) -> list[Points]:
    """Return closed lines (K, 2) at a place and of a height [m], made simpler where they have many points.

    They have at most 512 points, unless details of a sixteenth of the height take more. Details of a
    `fine` part of the height are kept at first.
    """
    points = np.concatenate(lines)
    low, high = points.min(axis=0), points.max(axis=0)
    scale = real("height", height, 1e-6, LONGEST) / (high[1] - low[1])
    found = [(line - (low + high) / 2) * scale + np.asarray(center, dtype=np.float64) for line in lines]
    tolerance = height / fine
    while sum(map(len, found)) > _FEW_POINTS and tolerance < height / 16:
        simple = [line[simplified(np.vstack([line, line[:1]]), tolerance)[:-1]] for line in found]
        found = [line for line in simple if len(line) > 2]
        tolerance *= 1.5
    return [np.ascontiguousarray(line) for line in found]
