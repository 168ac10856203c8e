"""From a stroke, which a page or a tablet records as points, to an arrow or an ellipse."""

from collections.abc import Mapping, Sequence
from typing import Annotated, Any, Literal, TypeAlias

import numpy as np
import numpy.typing as npt
from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, ValidationError, model_validator

from hybridmpm._support.arguments import no_truth_value
from hybridmpm.control.sketch.outline import fit_outline
from hybridmpm.control.sketch.polyline import arc_lengths, evenly_spaced, values_at_knots
from hybridmpm.control.sketch.sketch import (
    MAX_POINTS,
    MIN_LENGTH,
    ONE_METRE,
    RASTER_SIZE,
    WIDTH_AT_BACK,
    WIDTH_AT_FRONT,
    Arrow,
    Ellipse,
    Floats,
    StrokeSketch,
    check_in_world,
    check_points_in_world,
    checked_points,
)
from hybridmpm.errors import SketchError
from hybridmpm.scene.fields import LONGEST
from hybridmpm.scene.lines import simplified

Kind: TypeAlias = Literal["arrow", "ellipse"]

ROUND = np.radians(310)
"""Least angle by which an oval turns around its middle [rad]."""
SLENDER = 0.1
"""Least width of an oval over its length [-]."""
STRAYING = 1.8
"""Largest distance of an oval's line from its middle, over the mean distance [-]."""
MAX_OPENING = np.pi
"""Widest gap of a stroke that is said to be an oval, seen from its middle [rad]."""
_LOOSE = 0.25
"""Largest root mean square distance of an oval's line from the oval, over the oval's size [-]."""
TREMOR = 2.0 / RASTER_SIZE
"""Distance within which an arrow's line follows the hand, over the longest side of the world: two pixels of
the raster."""
_EVEN = 1024
"""Number of evenly spaced points by which a stroke is judged, so that a pen that rests has no weight."""
_POINT = 1e-6
"""Extent below which a stroke is one point, over the farthest place of it from the origin."""

_Number = Annotated[float, BeforeValidator(no_truth_value)]
_Place = Annotated[_Number, Field(ge=0, le=LONGEST, allow_inf_nan=False)]
_Width = Annotated[_Number, Field(ge=WIDTH_AT_BACK, le=WIDTH_AT_FRONT, allow_inf_nan=False)]
_Seconds = Annotated[_Number, Field(ge=0, allow_inf_nan=False)]


class Stroke(BaseModel):
    """One freehand stroke in the front view (x, y) of the world box, in metres with y up."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    points: list[tuple[_Place, _Place]] = Field(
        min_length=2, max_length=MAX_POINTS, description="Points [x, y] of the stroke [m], from tail to tip."
    )
    widths: list[_Width] | None = Field(
        default=None,
        description="Stroke width at each point, in pixels of a 512-pixel raster. In 3D it gives the depth: "
        "2 stands for the back wall, 20 for the front wall.",
    )
    times: list[_Seconds] | None = Field(
        default=None,
        description="Time at which each point was drawn [s]; times must not decrease. Drawing tools record "
        "them; the constant force does not depend on them.",
    )
    kind: Kind | None = Field(
        default=None,
        description="Kind of sketch that the stroke stands for. If absent, a stroke that goes round is an "
        "ellipse, any other an arrow.",
    )

    @model_validator(mode="after")
    def _one_entry_per_point(self) -> "Stroke":
        for name, values in (("widths", self.widths), ("times", self.times)):
            if values is not None and len(values) != len(self.points):
                raise ValueError(
                    f"{name} must have {len(self.points)} entries, one per point, got {len(values)}"
                )
        if self.times is not None and np.any(np.diff(self.times) < 0):
            raise ValueError("times must not decrease")
        return self


def parse_strokes(
    strokes: Sequence[Stroke | Mapping[str, Any]], size: Sequence[float] = ONE_METRE
) -> StrokeSketch:
    """Return the sketch that a stroke stands for.

    Parameters
    ----------
    strokes : sequence of exactly one stroke
        The stroke is a `Stroke` or a mapping with its fields: points (K, 2) in the world [m], and optionally
        widths (K,) in [2, 20] pixels, times (K,) and kind.
    size : sequence of 2 or 3 floats
        Length of the world along each axis [m], as `Scene.size` has it.

    Raises
    ------
    SketchError
        There is not exactly one stroke, or a value is out of range; the message names the field and the
        allowed range.
    """
    if isinstance(strokes, str | bytes | Mapping) or not isinstance(strokes, Sequence):
        raise SketchError(f"strokes must be a list of one stroke, got {type(strokes).__name__}")
    if len(strokes) != 1:
        raise SketchError(f"strokes: there must be exactly 1, got {len(strokes)}")
    try:
        stroke = Stroke.model_validate(strokes[0])
    except ValidationError as err:
        raise SketchError(_first_problem(err)) from err
    points = np.array(stroke.points, dtype=np.float64)
    widths = None if stroke.widths is None else np.array(stroke.widths, dtype=np.float64)
    longest = max(size)
    try:
        check_points_in_world(points, size)
        kind = stroke.kind or classify_stroke(points)
        sketch = (_arrow_along if kind == "arrow" else _ellipse_along)(points, widths, longest)
        check_in_world(sketch, size)
    except SketchError as err:
        raise SketchError(f"strokes[0].{err}") from err
    return sketch


def classify_stroke(points: npt.ArrayLike) -> Kind:
    """Return what a freehand stroke (K, 2) looks like: an "ellipse" if it goes round, else an "arrow".

    The stroke is seen from its middle, the mean of its points along its length, in the frame in which it
    spreads equally in all directions. It goes round if

    1. it is at least a tenth as wide as it is long (in standard deviations),
    2. the direction to the pen turns by at least 310 degrees, counted back where the pen turns back, and
    3. the pen never strays more than 1.8 times as far from the middle as it is in the mean.

    So a stroke that stops short of its start or overshoots it is an oval, whatever its shape and sense; a
    hairpin, a stroke to and fro, and an arrow with a loop in it are arrows.

    Raises
    ------
    SketchError
        `points` is not float (K, 2) with 2 to `MAX_POINTS` points in [0, 4096].
    """
    line = evenly_spaced(checked_points(points), _EVEN)
    line = line - line.mean(axis=0)
    values, vectors = np.linalg.eigh(line.T @ line / len(line))
    point = _POINT * max(float(np.max(points)), _POINT)
    if not values[0] >= SLENDER**2 * max(float(values[1]), point**2):
        return "arrow"
    x, y = (line @ vectors / np.sqrt(values)).T
    radius = np.hypot(x, y)
    if radius.max() > STRAYING * radius.mean():
        return "arrow"
    turned = float(np.abs(np.unwrap(np.arctan2(y, x))[[0, -1]] @ [-1.0, 1.0]))
    return "ellipse" if turned >= ROUND else "arrow"


def _first_problem(err: ValidationError) -> str:
    problem = err.errors(include_url=False)[0]
    path = "".join(f"[{key}]" if isinstance(key, int) else f".{key}" for key in problem["loc"])
    return f"strokes[0]{path}: {problem['msg']}"


def _arrow_along(points: Floats, widths: Floats | None, longest: float) -> Arrow:
    """Return the arrow without the tremor of the hand; its tip and its tail are those of the stroke."""
    kept = simplified(points, TREMOR * longest)
    if widths is not None:
        places = arc_lengths(points)
        fitted = values_at_knots(places, widths, places[kept])
        widths = np.clip(fitted, widths.min(), widths.max())
    return Arrow(points[kept], widths)


def _ellipse_along(points: Floats, widths: Floats | None, longest: float) -> Ellipse:
    """Return the ellipse that a stroke follows; a pen that rests, or goes round twice, does not change it."""
    length = float(arc_lengths(points)[-1])
    least = 2 * np.pi * MIN_LENGTH * longest
    if length < least:
        raise SketchError(f"points: an oval must be at least {least:.2g} m long, got {length:.2g}")
    try:
        outline = fit_outline(evenly_spaced(points, _EVEN), np.ones(_EVEN))
    except SketchError as err:
        raise SketchError(f"points: {err}") from err
    if outline.gap > MAX_OPENING:
        raise SketchError(
            f"points: an oval must go more than half round, but {np.degrees(outline.gap):.0f} degrees "
            "are open as seen from its middle; draw it round, or send it with kind: arrow"
        )
    if outline.spread > _LOOSE:
        raise SketchError(
            f"points: the stroke is no oval: it strays from one by {outline.spread:.0%} of its size, "
            f"at most {_LOOSE:.0%} are allowed; draw one round, or send it with kind: arrow"
        )
    width = None if widths is None else float(np.median(widths))
    return Ellipse(outline.center, outline.axes, outline.angle, width)
