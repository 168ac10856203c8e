"""The two sketches that a person can draw: an arrow, or an oval around the place where the fluid should be.

Both are drawn in the front view (x, y) of the world box [0, 1]^D with y up. In 3D the width of the stroke
gives the depth z: `WIDTH_AT_BACK` pixels stand for the back wall (lower z), `WIDTH_AT_FRONT` pixels for the
front wall (upper z), and widths between them for depths between, linearly.
"""

from dataclasses import dataclass
from typing import ClassVar, Literal, TypeAlias

import numpy as np
import numpy.typing as npt

from hybridmpm._support.arguments import unmasked
from hybridmpm.errors import SketchError

RASTER_SIZE = 512
"""Side of the sketch raster [pixels]; stroke widths are in pixels of this raster."""
WIDTH_AT_BACK = 2.0
"""Stroke width that stands for the depth of the back wall [pixels]."""
WIDTH_AT_FRONT = 20.0
"""Stroke width that stands for the depth of the front wall [pixels]."""
MAX_POINTS = 4096
"""Largest number of points of a stroke."""
MIN_LENGTH = 2.0 / RASTER_SIZE
"""Shortest arrow and smallest semi-axis [m]: two pixels of the raster."""

Floats: TypeAlias = npt.NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Arrow:
    """A sketch along which the centre of mass is to move, by tip minus tail.

    Parameters
    ----------
    points : float (K, 2), in [0, 1], 2 <= K <= `MAX_POINTS`
        Polyline from the tail to the tip [m].
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
        length = float(np.linalg.norm(np.diff(points, axis=0), axis=1).sum())
        if length < MIN_LENGTH:
            raise SketchError(f"points: the stroke is {length:.4g} long, must be at least {MIN_LENGTH:.4g}")
        widths = None if self.widths is None else _checked_widths(self.widths, len(points))
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
    center : float (2,), in [0, 1]
        Centre of the ellipse [m].
    axes : float (2,), >= 2 / 512, major first
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
        if center.shape != (2,) or not np.all((center >= 0) & (center <= 1)):
            raise SketchError(f"center must be two numbers in [0, 1], got {center.tolist()}")
        if axes.shape != (2,) or not np.all((axes >= MIN_LENGTH) & (axes <= 1)):
            raise SketchError(f"axes must be two lengths in [{MIN_LENGTH:.4g}, 1], got {axes.tolist()}")
        if not np.isfinite(self.angle):
            raise SketchError(f"angle must be finite, got {self.angle}")
        if self.width is not None:
            _checked_widths([self.width], 1)
        object.__setattr__(self, "center", center)
        object.__setattr__(self, "axes", axes)

    def outline(self, count: int) -> Floats:
        """Return `count` points (count, 2) of the outline [m], the first again at the end."""
        turn = np.linspace(0.0, 2 * np.pi, count)
        cos, sin = np.cos(self.angle), np.sin(self.angle)
        local = np.column_stack([np.cos(turn), np.sin(turn)]) * self.axes
        return np.asarray(self.center + local @ np.array([[cos, sin], [-sin, cos]]))


Sketch: TypeAlias = Arrow | Ellipse


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
        There are not 2 to `MAX_POINTS` points, or a number is not in [0, 1].
    """
    points = _frozen(values)
    if points.ndim != 2 or points.shape[1] != 2:
        raise SketchError(f"points must have shape (K, 2), got {points.shape}")
    if not 2 <= len(points) <= MAX_POINTS:
        raise SketchError(f"points: there must be 2 to {MAX_POINTS}, got {len(points)}")
    bad = np.flatnonzero(~np.all((points >= 0) & (points <= 1), axis=1))
    if bad.size:
        first = int(bad[0])
        raise SketchError(f"points[{first}] must be two numbers in [0, 1], got {points[first].tolist()}")
    return points


def _checked_widths(values: npt.ArrayLike, count: int) -> Floats:
    widths = _frozen(values)
    if widths.shape != (count,):
        raise SketchError(f"widths must have one number per point ({count}), got shape {widths.shape}")
    if not np.all((widths >= WIDTH_AT_BACK) & (widths <= WIDTH_AT_FRONT)):
        raise SketchError(
            f"widths must be in [{WIDTH_AT_BACK:g}, {WIDTH_AT_FRONT:g}] pixels, "
            f"got {widths.min():g} to {widths.max():g}"
        )
    return widths
