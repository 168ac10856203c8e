"""Shapes in files: surfaces of triangles, drawings as SVG, and pictures whose dark parts are a shape."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from hybridmpm._support.arguments import real
from hybridmpm.errors import ConfigError, DataError, SceneError
from hybridmpm.scene.facets import MOST_CORNERS, corners_around, fitted, mesh_of, middle_of, within_worlds
from hybridmpm.scene.fields import LONGEST, Points
from hybridmpm.scene.lines import simplified
from hybridmpm.scene.rigid import hull_corners
from hybridmpm.scene.surface_files import SUFFIXES
from hybridmpm.scene.svg import drawn_lines

if TYPE_CHECKING:
    from PIL import Image

SURFACES, DRAWINGS = SUFFIXES, (".svg", ".png")
"""Endings of files of closed surfaces, and of outlines in the plane."""
_MOST_PIXELS = 4_000_000
_FINE = 400
"""Smallest detail of an outline that is kept, as a part of its height, where it has too many points."""
_FEW_POINTS = 512
"""Points of all outlines beyond which they are made simpler."""
_AREA, _STRIPS = 0.003, 500
"""Most that simpler outlines change an area [-], and strips by which it is measured."""
_MOST_LINES = MOST_CORNERS // 5
"""Lines for which a polygon has room: each has three corners, and a way there and back."""
_PLACED = {"file", "center", "height"}


def shape_in(path: str | Path, center: Sequence[float], height: float) -> dict[str, Any]:
    """Return the shape in a file as fields of a body or an obstacle: shape, vertices, triangles of a mesh.

    Parameters
    ----------
    path : path
        .stl, .obj, .ply and .glb contain a closed surface, for 3D. Of an .svg the paths, rectangles, circles,
        ellipses and polygons that are seen count, in any colour; of a .png the dark parts.
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
    if suffix not in SURFACES + DRAWINGS:
        raise ConfigError(f"files of shapes end in {', '.join(SURFACES + DRAWINGS)}; got {path.name!r}")
    middle = middle_of(center, 3 if suffix in SURFACES else 2)
    if suffix in SURFACES:
        return {"shape": "mesh"} | mesh_of(path, middle.tolist(), height)
    lines = placed(drawn_lines(path) if suffix == ".svg" else dark_lines(_grey(path)), middle, height)
    within_worlds(np.concatenate(lines))
    low, high = np.concatenate(lines).min(axis=0), np.concatenate(lines).max(axis=0)
    if not _area(lines) > 1e-9 * np.prod(high - low):
        text = "its lines enclose no area, as where each is there twice; leave doubled ones out"
        raise DataError(f"{path.name}: {text}")
    return {"shape": "polygon", "vertices": corners_around(lines)}


def resolved(data: Any, folder: Path) -> Any:
    """Return the plain data of a scene with shapes in the place of files, which lie beside it in a folder.

    A body or an obstacle may have `file`, `center` and `height`, as of `shape_in`, in the place of its shape.
    A rigid body is the hull of the shape.

    Raises
    ------
    SceneError
        A file cannot be read; the message names the field and the fault.
    """
    if not isinstance(data, dict):
        return data
    found, faults = dict(data), []
    for group in ("bodies", "obstacles", "rigid"):
        parts = data.get(group)
        if not isinstance(parts, list):
            continue
        found[group] = list(parts)
        for index, part in enumerate(parts):
            if not isinstance(part, dict) or "file" not in part:
                continue
            where = f"{group}[{index}]"
            found[group][index], wrong = _read(part, group, data.get("dim"), folder)
            faults += [(f"{where}.{field}", text) for field, text in wrong]
    if faults:
        raise SceneError.of(faults)
    return found


def _read(  # noqa: PLR0911 - one fault after another
    part: dict[str, Any], group: str, dim: object, folder: Path
) -> tuple[dict[str, Any], list[tuple[str, str]]]:
    """Return a part with the shape in the place of its file, and the faults of its fields."""
    name = part["file"]
    if not isinstance(name, str) or not name:
        return part, [("file", f"must be the path of a file, got {name!r}")]
    suffix, allowed = Path(name).suffix.lower(), SURFACES if dim == 3 else DRAWINGS
    is_known = suffix in SURFACES + DRAWINGS
    if is_known and dim in (2, 3) and suffix not in allowed:
        text = f"{suffix} is for dim {2 if dim == 3 else 3} only; dim {dim} allows {', '.join(allowed)}"
        return part, [("file", text)]
    if is_known and not (folder / name).is_file():
        return part, [("file", f"there is no file {str(folder / name)!r}; paths begin at the scene's folder")]
    missing = sorted(_PLACED - part.keys())
    if missing:
        return part, [(field, "is required beside file, in metres") for field in missing]
    try:
        shape = shape_in(folder / name, part["center"], part["height"])
    except (ConfigError, DataError, OSError) as error:
        text = str(error)
        field = next((field for field in ("center", "height") if text.startswith(f"{field} must")), "file")
        return part, [(field, text if field == "file" else text.removeprefix(f"{field} "))]
    if group == "rigid":
        corners = hull_corners(np.array(shape["vertices"]))
        if len(corners) > MOST_CORNERS:
            text = f"its hull has {len(corners)} corners, at most {MOST_CORNERS} are allowed: make it coarser"
            return part, [("file", f"{text}, or take a ball or a cylinder")]
        shape = {"shape": "hull", "points": corners.tolist()}
    rest = {field: value for field, value in part.items() if field not in _PLACED}
    twice = [field for field in shape if field in rest and (field != "shape" or rest[field] != shape[field])]
    text = f"stands beside file, whose shape is a {shape['shape']}; leave it out"
    return shape | rest, [(field, text) for field in twice]


def _grey(path: Path) -> npt.NDArray[np.float64]:
    from PIL import Image, ImageOps  # noqa: PLC0415 - scenes without pictures do not need it

    try:
        with Image.open(path) as picture:
            size = picture.width * picture.height
            if size <= _MOST_PIXELS:
                return grey_of(ImageOps.exif_transpose(picture))
    except (OSError, ValueError, SyntaxError, Image.DecompressionBombError) as error:
        text = error.strerror if isinstance(error, OSError) and error.strerror else str(error)
        raise DataError(f"{path.name} cannot be read as a picture: {text}") from None
    raise DataError(f"{path.name} has {size} pixels, at most {_MOST_PIXELS} are allowed; make it smaller")


def grey_of(picture: "Image.Image") -> npt.NDArray[np.float64]:
    """Return the grey values (H, W) of a picture; transparent parts are white.

    Of a picture that is equally dark all over, such as a white logo, what is not transparent is dark.
    """
    from PIL import Image  # noqa: PLC0415 - as above

    if picture.mode.startswith("I"):
        # Pillow would cut 16 bits at 255.
        return np.asarray(picture, dtype=np.float64)
    rgba = picture.convert("RGBA")
    ground = Image.new("RGBA", rgba.size, "white")
    grey = np.asarray(Image.alpha_composite(ground, rgba).convert("L"), dtype=np.float64)
    if grey.min() == grey.max():
        return 255.0 - np.asarray(rgba.getchannel("A"), dtype=np.float64)
    return grey


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
        text = "all of it is equally dark; a shape needs dark parts on a light or transparent ground"
        raise DataError(f"picture: {text}")
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

    They have at most 512 points, or as many as a polygon may have where their area would change by 0.3 %.
    Details of a `fine` part of the height are kept at first.

    Raises
    ------
    ConfigError
        A value is out of range.
    DataError
        The area of so many points differs by more than 0.3 %.
    """
    height = real("height", height, 1e-6, LONGEST)
    large, lost = _without_specks(lines)
    found = fitted(large, center, height)
    if sum(map(len, found)) <= _FEW_POINTS:
        return [np.ascontiguousarray(line) for line in found]
    area = _area(found)
    for most, finest in ((_FEW_POINTS, fine), (MOST_CORNERS, 16 * fine)):
        simple = _simpler(found, most, height / finest)
        if simple and abs(_area(simple) - area) <= (_AREA - lost) * area:
            return simple
    raise _too_fine(lines)


def _too_fine(lines: Sequence[Points]) -> DataError:
    return DataError(
        f"the shape has too many details: {sum(map(len, lines))} points in {len(lines)} lines, and its area "
        f"changes by more than {100 * _AREA:g} % with the {MOST_CORNERS} that a polygon may have; leave "
        "details out, or take it in parts"
    )


def _without_specks(lines: Sequence[Points]) -> tuple[Sequence[Points], float]:
    """Return as many lines as a polygon has room for, the largest, and the share of area that is lost [-]."""
    if len(lines) <= _MOST_LINES:
        return lines, 0.0
    start = np.concatenate(lines)
    counts = np.array([len(line) for line in lines])
    first = np.cumsum(counts) - counts
    start = start - np.repeat(start[first], counts, axis=0)
    after = np.roll(start, -1, axis=0)
    # The last point of each line is followed by its first, from which places are counted.
    after[first - 1] = 0.0
    areas = np.abs(np.add.reduceat(start[:, 0] * after[:, 1] - start[:, 1] * after[:, 0], first))
    order = np.argsort(-areas, kind="stable")
    lost = float(areas[order[_MOST_LINES:]].sum() / max(areas.max(), 1e-300))
    if not lost < _AREA:
        raise _too_fine(lines)
    return [lines[number] for number in np.sort(order[:_MOST_LINES])], lost


def _simpler(lines: Sequence[Points], most: int, tolerance: float) -> list[Points]:
    """Return lines (K, 2) of so many points, with the ways between; none where they would vanish."""
    found = list(lines)
    longest = np.ptp(np.concatenate(found), axis=0).max()
    while sum(map(len, found)) + 2 * (len(found) - 1) > most:
        if not tolerance < longest / 16:
            return []
        simple = [line[simplified(np.vstack([line, line[:1]]), tolerance)[:-1]] for line in found]
        found = [line for line in simple if len(line) > 2]
        tolerance *= 1.5
    return [np.ascontiguousarray(line) for line in found]


def _area(lines: Sequence[Points]) -> float:
    """Return the area inside closed lines (K, 2) by the even-odd rule [m^2], from strips along x."""
    start = np.concatenate(lines)
    end = np.concatenate([np.roll(line, -1, axis=0) for line in lines])
    low, high = start[:, 1].min(), start[:, 1].max()
    total = 0.0
    for level in low + (high - low) * (np.arange(_STRIPS) + 0.5) / _STRIPS:
        crossed = (start[:, 1] <= level) != (end[:, 1] <= level)
        (ax, ay), (bx, by) = start[crossed].T, end[crossed].T
        across = np.sort(ax + (level - ay) * (bx - ax) / (by - ay))
        total += float((across[1::2] - across[::2]).sum())
    return total * float(high - low) / _STRIPS
