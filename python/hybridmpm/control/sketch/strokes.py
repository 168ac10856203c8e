"""From a stroke, which a page or a tablet records as points, to an arrow or an ellipse."""

from collections.abc import Mapping, Sequence
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator

from hybridmpm.control.sketch.sketch import (
    MAX_POINTS,
    MIN_LENGTH,
    WIDTH_AT_BACK,
    WIDTH_AT_FRONT,
    Arrow,
    Ellipse,
    Floats,
    Sketch,
)
from hybridmpm.errors import SketchError

CLOSED_GAP = 0.2
"""Largest distance between the ends of a closed stroke, as a fraction of the stroke's length."""

_Unit = Annotated[float, Field(ge=0, le=1, allow_inf_nan=False)]
_Width = Annotated[float, Field(ge=WIDTH_AT_BACK, le=WIDTH_AT_FRONT, allow_inf_nan=False)]
_Seconds = Annotated[float, Field(ge=0, allow_inf_nan=False)]


class Stroke(BaseModel):
    """One freehand stroke in the front view (x, y) of the world box, in metres with y up."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    points: list[tuple[_Unit, _Unit]] = Field(
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
    kind: Literal["arrow", "ellipse"] | None = Field(
        default=None,
        description="Kind of sketch that the stroke stands for. If absent, a closed stroke is an ellipse, an "
        "open one an arrow.",
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


def parse_strokes(strokes: Sequence[Stroke | Mapping[str, Any]]) -> Sketch:
    """Return the sketch that a stroke stands for.

    Parameters
    ----------
    strokes : sequence of exactly one stroke
        The stroke is a `Stroke` or a mapping with its fields: points (K, 2) in [0, 1], and optionally widths
        (K,) in [2, 20] pixels, times (K,) and kind.

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
    kind = stroke.kind or ("ellipse" if _is_closed(points) else "arrow")
    try:
        if kind == "arrow":
            return Arrow(points, widths)
        return _ellipse_around(points, None if widths is None else float(widths.mean()))
    except SketchError as err:
        raise SketchError(f"strokes[0].{err}") from err


def _first_problem(err: ValidationError) -> str:
    problem = err.errors(include_url=False)[0]
    path = "".join(f"[{key}]" if isinstance(key, int) else f".{key}" for key in problem["loc"])
    return f"strokes[0]{path}: {problem['msg']}"


def _is_closed(points: Floats) -> bool:
    length = float(np.linalg.norm(np.diff(points, axis=0), axis=1).sum())
    gap = float(np.linalg.norm(points[-1] - points[0]))
    return len(points) > 3 and length > MIN_LENGTH and gap < CLOSED_GAP * length


def _ellipse_around(points: Floats, width: float | None) -> Ellipse:
    """Return the ellipse that has the area moments of the polygon (Green's theorem).

    Moments of the points would be wrong, because a pen that rests leaves many points in one place.
    """
    middle = points.mean(axis=0)
    x, y = (points - middle).T
    x_next, y_next = np.roll(x, -1), np.roll(y, -1)
    cross = x * y_next - x_next * y
    area = cross.sum() / 2
    if abs(area) < MIN_LENGTH**2:
        raise SketchError(
            f"points: an ellipse must enclose an area of at least {MIN_LENGTH**2:.2g}, got {abs(area):.2g}"
        )
    first = np.array([((x + x_next) * cross).sum(), ((y + y_next) * cross).sum()]) / (6 * area)
    xx = ((x * x + x * x_next + x_next * x_next) * cross).sum() / (12 * area)
    yy = ((y * y + y * y_next + y_next * y_next) * cross).sum() / (12 * area)
    xy = ((x * y_next + 2 * x * y + 2 * x_next * y_next + x_next * y) * cross).sum() / (24 * area)
    covariance = np.array([[xx, xy], [xy, yy]]) - np.outer(first, first)
    return ellipse_of_moments(middle + first, covariance, width)


def ellipse_of_moments(center: Floats, covariance: Floats, width: float | None) -> Ellipse:
    """Return the ellipse whose uniformly filled area has a given centre and covariance.

    Its semi-axes are 2 sqrt(lambda), where lambda are the eigenvalues of the covariance.

    Raises
    ------
    SketchError
        The covariance is not positive definite.
    """
    values, vectors = np.linalg.eigh(covariance)
    if values[0] <= 0:
        raise SketchError("points: the stroke crosses itself so that it encloses no definite area")
    major = vectors[:, 1]
    angle = float(np.arctan2(major[1], major[0]))
    # An axis has no direction, so its angle is given within half a turn.
    angle = (angle + np.pi / 2) % np.pi - np.pi / 2
    return Ellipse(np.clip(center, 0, 1), 2 * np.sqrt(values[::-1]), angle, width)
