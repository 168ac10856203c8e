"""The sketches of a goal: an arrow, or an oval or any other outline of the place for the fluid.

All are drawn in the front view (x, y) of the world with y up. Sketches know no world: `check_in_world` says
whether one lies in it. In 3D the width of the stroke
gives the depth z: `WIDTH_AT_BACK` pixels stand for the back wall (lower z), `WIDTH_AT_FRONT` pixels for the
front wall (upper z), and widths between them for depths between, linearly. A `Solid` has its place in 3D.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, ClassVar, Literal, TypeAlias

import numpy as np
import numpy.typing as npt

from hybridmpm import _core
from hybridmpm._support.arguments import unmasked
from hybridmpm.control.sketch.solid import Solid
from hybridmpm.errors import SketchError
from hybridmpm.scene.fields import LONGEST

RASTER_SIZE = 512
"""Side of the sketch raster [pixels]; stroke widths are in pixels of this raster."""
WIDTH_AT_BACK = 2.0
"""Stroke width that stands for the depth of the back wall [pixels]."""
WIDTH_AT_FRONT = 20.0
"""Stroke width that stands for the depth of the front wall [pixels]."""
MAX_POINTS = 4096
"""Largest number of points of a stroke."""
MIN_LENGTH = 2.0 / RASTER_SIZE
"""Shortest arrow and smallest semi-axis over the longest side of the world: two pixels of the raster."""
MAX_OUTLINES = 64
"""Largest number of closed lines of a shape."""
ONE_METRE = (1.0, 1.0)
"""Width and height of the world where a scene has none of its own [m]."""

Floats: TypeAlias = npt.NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Arrow:
    """A sketch along which the centre of mass is to move, by tip minus tail.

    Parameters
    ----------
    points : float (K, 2), in [0, 4096], 2 <= K <= `MAX_POINTS`
        Polyline from the tail to the tip [m], of some length.
    widths : float (K,), in [2, 20], optional
        Stroke width at each point [pixels of the 512-pixel raster], which gives the depth in 3D.
    note : str, optional
        How a picture was read, where that is not obvious.

    Raises
    ------
    SketchError
        A value is out of range; the message names the field and the allowed range.
    """

    points: Floats
    widths: Floats | None = None
    note: str | None = None

    kind: ClassVar[Literal["arrow"]] = "arrow"

    def __post_init__(self) -> None:
        points = checked_points(self.points)
        if not np.diff(points, axis=0).any():
            raise SketchError("points: all are in one place, the stroke must have a length")
        widths = None if self.widths is None else checked_widths(self.widths, len(points))
        object.__setattr__(self, "points", points)
        object.__setattr__(self, "widths", widths)

    @property
    def displacement(self) -> Floats:
        """Tip minus tail in the front view, shape (2,) [m]."""
        return np.asarray(self.points[-1] - self.points[0], dtype=np.float64)


@dataclass(frozen=True, eq=False)
class Ellipse:
    """A sketch that leads the centre of mass to `center`.

    Parameters
    ----------
    center : float (2,), in [0, 4096]
        Centre of the ellipse [m].
    axes : float (2,), above 0, at most 4096, major first
        Semi-axes [m], two standard deviations of the wanted particle cloud.
    angle : float
        Angle of the major axis to +x, counter-clockwise [rad].
    width : float in [2, 20], optional
        Stroke width [pixels of the 512-pixel raster], which gives the depth in 3D.
    note : str, optional
        How a picture was read, where that is not obvious.

    Raises
    ------
    SketchError
        A value is out of range; the message names the field and the allowed range.
    """

    center: Floats
    axes: Floats
    angle: float
    width: float | None = None
    note: str | None = None

    kind: ClassVar[Literal["ellipse"]] = "ellipse"

    def __post_init__(self) -> None:
        center = _frozen(self.center)
        axes = _frozen(self.axes)
        if center.shape != (2,) or not np.all((center >= 0) & (center <= LONGEST)):
            raise SketchError(f"center must be two numbers in [0, {LONGEST}], got {center.tolist()}")
        if axes.shape != (2,) or not np.all((axes > 0) & (axes <= LONGEST)):
            raise SketchError(f"axes must be two lengths in (0, {LONGEST}], got {axes.tolist()}")
        if not np.isfinite(self.angle):
            raise SketchError(f"angle must be finite, got {self.angle}")
        if self.width is not None:
            checked_widths([self.width], 1)
        object.__setattr__(self, "center", center)
        object.__setattr__(self, "axes", axes)

    def outline(self, count: int) -> Floats:
        """Return `count` points (count, 2) of the outline [m], the first again at the end."""
        turn = np.linspace(0.0, 2 * np.pi, count)
        cos, sin = np.cos(self.angle), np.sin(self.angle)
        local = np.column_stack([np.cos(turn), np.sin(turn)]) * self.axes
        return np.asarray(self.center + local @ np.array([[cos, sin], [-sin, cos]]))


@dataclass(frozen=True, eq=False)
class Shape:
    """A sketch that the fluid is to fill: what closed lines enclose.

    A point is inside where a ray from it crosses the lines an odd number of times (even-odd rule). So a line
    within another one makes a hole.

    Parameters
    ----------
    outlines : sequence of float (K, 2), in [0, 4096], 3 <= K <= `MAX_POINTS`
        Closed lines in the front view [m], at most `MAX_OUTLINES`; the last point of each joins the first.
    width : float in [2, 20], optional
        Stroke width [pixels of the 512-pixel raster], which gives the depth of the middle in 3D.
    note : str, optional
        How a picture was read, where that is not obvious.

    Raises
    ------
    SketchError
        A value is out of range, or the lines enclose nothing.
    """

    outlines: tuple[Floats, ...]
    width: float | None = None
    note: str | None = None

    kind: ClassVar[Literal["shape"]] = "shape"

    def __post_init__(self) -> None:
        given = self.outlines
        if isinstance(given, str | bytes) or not isinstance(given, Sequence | np.ndarray):
            raise SketchError(f"outlines must be a sequence of lines, got {type(given).__name__}")
        if not 1 <= len(given) <= MAX_OUTLINES:
            raise SketchError(f"outlines: there must be 1 to {MAX_OUTLINES} lines, got {len(given)}")
        outlines = []
        for number, one in enumerate(given):
            try:
                points = checked_points(one)
            except SketchError as error:
                raise SketchError(f"outlines[{number}]: {error}") from error
            if len(points) < 3:
                raise SketchError(
                    f"outlines[{number}]: a closed line has at least 3 points, got {len(points)}"
                )
            outlines.append(points)
        if self.width is not None:
            checked_widths([self.width], 1)
        object.__setattr__(self, "outlines", tuple(outlines))
        if not self.area > 0:
            raise SketchError("outlines: the lines enclose nothing")

    def __repr__(self) -> str:
        return f"Shape({len(self.outlines)} lines around {self.area:.3g} m^2)"

    @cached_property
    def compiled(self) -> _core.Outlines:
        """The lines, ready for questions about points."""
        starts = np.cumsum([0, *map(len, self.outlines)], dtype=np.uint32)
        return _core.Outlines(np.concatenate(self.outlines), starts)

    @property
    def area(self) -> float:
        """Area [m^2]."""
        return self.compiled.area

    @property
    def center(self) -> Floats:
        """Centre of the area (2,) [m]."""
        return np.array(self.compiled.center)

    @cached_property
    def bounds(self) -> tuple[Floats, Floats]:
        """Corners (2,), (2,) of the rectangle around the lines [m]."""
        points = np.concatenate(self.outlines)
        return points.min(axis=0), points.max(axis=0)

    def covers(self, points: Floats) -> npt.NDArray[np.bool_]:
        """Return which points (N, 2) [m] lie inside; (N,)."""
        return self.compiled.covers(points)

    def __reduce__(self) -> tuple[type["Shape"], tuple[Any, ...]]:
        """Return what makes the shape anew: compiled lines have no copies."""
        return Shape, (self.outlines, self.width, self.note)

    @cached_property
    def crosses_itself(self) -> bool:
        """Whether lines cross, so that the even-odd rule decides what is inside."""
        edges = np.concatenate([np.hstack([one, np.roll(one, -1, axis=0)]) for one in self.outlines])
        a, b = edges[:, None, :2], edges[:, None, 2:]
        c, d = edges[None, :, :2], edges[None, :, 2:]
        return bool(np.any((_side(a, b, c) * _side(a, b, d) < 0) & (_side(c, d, a) * _side(c, d, b) < 0)))


def _side(a: Floats, b: Floats, c: Floats) -> Floats:
    """Return on which side of lines from a to b points c are: the sign of the turn."""
    ab, ac = b - a, c - a
    return np.asarray(np.sign(ab[..., 0] * ac[..., 1] - ab[..., 1] * ac[..., 0]))


StrokeSketch: TypeAlias = Arrow | Ellipse
"""What one stroke of a pen, or a picture of it, is read as."""
Sketch: TypeAlias = StrokeSketch | Shape | Solid


def check_in_world(sketch: Sketch, size: Sequence[float]) -> None:
    """Check that a sketch lies in the front of a world, and is large enough to be seen there.

    Parameters
    ----------
    sketch : Arrow, Ellipse, Shape or Solid
    size : sequence of 2 or 3 floats
        Length of the world along each axis [m].

    Raises
    ------
    SketchError
        It does not; the message names the field and the allowed range.
    """
    longest = max(size)
    least = MIN_LENGTH * longest
    if isinstance(sketch, Arrow):
        check_points_in_world(sketch.points, size)
        length = float(np.linalg.norm(np.diff(sketch.points, axis=0), axis=1).sum())
        if length < least:
            raise SketchError(f"points: the stroke is {length:.4g} long, must be at least {least:.4g}")
        return
    if isinstance(sketch, Solid):
        _check_solid(sketch, size, 2 * least)
        return
    if isinstance(sketch, Shape):
        for number, outline in enumerate(sketch.outlines):
            try:
                check_points_in_world(outline, size)
            except SketchError as error:
                raise SketchError(f"outlines[{number}].{error}") from error
        low, high = sketch.bounds
        if not np.all(high - low >= 2 * least):
            raise SketchError(f"outlines: they must reach over at least {2 * least:.4g} m along both axes")
        return
    if not np.all(sketch.center <= size[:2]):
        raise SketchError(f"center must be {_range(size)}, got {sketch.center.tolist()}")
    if not np.all((sketch.axes >= least) & (sketch.axes <= longest)):
        raise SketchError(
            f"axes must be two lengths in [{least:.4g}, {longest:g}], got {sketch.axes.tolist()}"
        )


def _check_solid(solid: Solid, size: Sequence[float], least: float) -> None:
    """Raise `SketchError` unless a solid lies in a world of this size [m] and is large enough for it."""
    if len(size) != 3:
        raise SketchError("a solid is a goal in 3D only: in 2D draw a shape")
    bad = np.flatnonzero(~np.all(solid.vertices <= size, axis=1))
    if bad.size:
        first = int(bad[0])
        where = " x ".join(f"[0, {length:g}]" for length in size)
        raise SketchError(f"vertices[{first}]: must be in {where} m, got {solid.vertices[first].tolist()}")
    low, high = solid.bounds
    if not np.all(high - low >= least):
        raise SketchError(f"vertices: they must reach over at least {least:.4g} m along each axis")


def check_points_in_world(points: Floats, size: Sequence[float]) -> None:
    """Raise `SketchError` unless points (K, 2) lie in the front of a world of this size [m]."""
    bad = np.flatnonzero(~np.all(points <= size[:2], axis=1))
    if bad.size:
        first = int(bad[0])
        raise SketchError(f"points[{first}]: must be {_range(size)}, got {points[first].tolist()}")


def margin_of(size: Sequence[float]) -> Floats:
    """Return the width of the margins beside and below the front of a world in the middle of a square [m]."""
    return (max(size) - np.array(size[:2])) / 2


def _range(size: Sequence[float]) -> str:
    width, height = size[:2]
    if width == height:
        return f"two numbers in [0, {width:g}]"
    return f"in [0, {width:g}] x [0, {height:g}] m"


def depth_of_width(width: float, back: float, front: float) -> float:
    """Return the depth z [m] that a stroke width [pixels] stands for.

    `back` and `front` are the z of the back and the front wall [m]. A width below 2 stands for the back wall,
    a width above 20 for the front wall.
    """
    fraction = (width - WIDTH_AT_BACK) / (WIDTH_AT_FRONT - WIDTH_AT_BACK)
    return back + min(max(fraction, 0.0), 1.0) * (front - back)


def width_of_depth(depth: float, back: float, front: float) -> float:
    """Return the stroke width [pixels] that stands for a depth z [m]: the inverse of `depth_of_width`.

    A depth beyond a wall counts as that of the wall.
    """
    fraction = min(max((depth - back) / (front - back), 0.0), 1.0)
    return WIDTH_AT_BACK + fraction * (WIDTH_AT_FRONT - WIDTH_AT_BACK)


def _frozen(values: npt.ArrayLike) -> Floats:
    """Return a read-only float64 copy, so that nobody can change the values after they are checked."""
    unmasked("the numbers of a sketch", values, SketchError)
    try:
        array = np.array(values, dtype=np.float64)
    except (TypeError, ValueError) as err:
        raise SketchError(f"a sketch must be made of numbers: {err}") from err
    array.flags.writeable = False
    return array


def checked_points(values: npt.ArrayLike) -> Floats:
    """Return points (K, 2) of a stroke as a read-only copy.

    Raises
    ------
    SketchError
        There are not 2 to `MAX_POINTS` points, or a number is not in [0, 4096].
    """
    points = _frozen(values)
    if points.ndim != 2 or points.shape[1] != 2:
        raise SketchError(f"points must have shape (K, 2), got {points.shape}")
    if not 2 <= len(points) <= MAX_POINTS:
        raise SketchError(f"points: there must be 2 to {MAX_POINTS}, got {len(points)}")
    bad = np.flatnonzero(~np.all((points >= 0) & (points <= LONGEST), axis=1))
    if bad.size:
        first, allowed = int(bad[0]), f"two numbers in [0, {LONGEST}]"
        raise SketchError(f"points[{first}] must be {allowed}, got {points[first].tolist()}")
    return points


def checked_widths(values: npt.ArrayLike, count: int) -> Floats:
    """Return stroke widths (count,) [pixels] as a read-only copy; raise `SketchError` unless in [2, 20]."""
    widths = _frozen(values)
    if widths.shape != (count,):
        raise SketchError(f"widths must have one number per point ({count}), got shape {widths.shape}")
    if not np.all((widths >= WIDTH_AT_BACK) & (widths <= WIDTH_AT_FRONT)):
        raise SketchError(
            f"widths must be in [{WIDTH_AT_BACK:g}, {WIDTH_AT_FRONT:g}] pixels, "
            f"got {widths.min():g} to {widths.max():g}"
        )
    return widths
