"""Sketches as a hand draws them: unsteady, with ends that miss or overshoot each other, gaps, and any ink.

They are what a reader of sketches has to bear, and training data for a controller that sees pictures. All
chance comes from the random generator that the caller hands in.
"""

from dataclasses import dataclass

import numpy as np

from hybridmpm.control.sketch.polyline import arc_lengths, at_arc_length, evenly_spaced
from hybridmpm.control.sketch.render import ARROW_WIDTH, OUTLINE_WIDTH, WHITE, Color, Drawing, PenStroke
from hybridmpm.control.sketch.sketch import (
    RASTER_SIZE,
    WIDTH_AT_BACK,
    WIDTH_AT_FRONT,
    Arrow,
    Ellipse,
    Floats,
    StrokeSketch,
)

_SPACING = 2.0
"""Distance between points of a hand-drawn stroke [pixels]."""
_SPEED = 0.5
"""Mean speed of the pen [m/s]."""
_INSIDE = 1e-3
"""Distance from the edge of the picture at which a pen stops [m]."""


@dataclass(frozen=True, kw_only=True)
class Hand:
    """Errors of drawing by hand. Lengths are in pixels of the 512-pixel raster."""

    tremor: float = 1.0
    """Root mean square distance of the pen from the meant line."""
    tremor_length: float = 30.0
    """Length along the line over which tremor changes."""
    pressure: float = 0.05
    """Relative change of the width along a stroke (standard deviation) [-]."""
    rounding: float = 8.0
    """Length over which corners are rounded."""
    overshoot: float = 0.3
    """Angle by which an oval goes on beyond its start; negative where it stops short [rad]."""
    spiral: float = 0.03
    """Growth of an oval from its start to its end, as a fraction of its size."""
    start: float = 0.0
    """Direction from an oval's middle, in the frame in which it is a circle, where the pen starts [rad]."""
    clockwise: bool = False
    """Whether an oval is drawn clockwise."""
    head: float = 26.0
    """Length of an arrow's barbs outside of its shaft."""
    head_angle: float = 0.5
    """Angle between shaft and barbs [rad]."""
    head_skew: float = 0.0
    """Difference of the two barbs, as a fraction of their length."""
    head_offset: tuple[float, float] = (0.0, 0.0)
    """Meeting point of the barbs, from the end of the shaft: forwards and to the left."""
    head_filled: bool = False
    """Whether the head is a filled triangle."""
    lift: float | None = None
    """Point at which the pen was lifted, as a fraction of the line; nowhere if None."""
    gap: float = 6.0
    """Length of line that is missing where the pen was lifted."""
    width: float | None = None
    """Width of a line that the sketch gives no width; that of the renderer if None."""
    color: Color = (220, 20, 30)
    """Red, green and blue of the ink, 0 to 255."""
    ground: Color = WHITE
    """Red, green and blue of the ground, 0 to 255."""


def random_hand(rng: np.random.Generator, kind: str) -> Hand:
    """Return a hand that draws an "arrow" or an "ellipse", from a steady one to a careless one.

    Two of three draw in a red or a green that is tinted more or less; the others take a dark pencil.
    """
    base = {"arrow": ((140, 256), (0, 80), (0, 90)), "ellipse": ((0, 90), (110, 220), (0, 100))}[kind]
    pencil = ((0, 110), (0, 110), (0, 150))
    ink = base if rng.random() < 2 / 3 else pencil
    color = tuple(int(rng.integers(low, high)) for low, high in ink)
    if ink is pencil:
        # Without a cast of red or green, which would say what it is.
        color = (color[0], color[0], max(color))
    ground = tuple(int(value) for value in rng.integers(225, 256, 3)) if rng.random() < 0.3 else WHITE
    return Hand(
        tremor=rng.uniform(0.2, 2.0),
        tremor_length=rng.uniform(20.0, 60.0),
        pressure=rng.uniform(0.0, 0.06),
        rounding=rng.uniform(0.0, 20.0),
        overshoot=rng.uniform(-0.6, 1.2),
        spiral=rng.uniform(-0.06, 0.06),
        start=rng.uniform(0.0, 2 * np.pi),
        clockwise=bool(rng.random() < 0.5),
        head=rng.uniform(16.0, 36.0),
        head_angle=rng.uniform(0.35, 0.65),
        head_skew=rng.uniform(-0.25, 0.25),
        head_offset=(rng.uniform(-4.0, 8.0), rng.uniform(-2.0, 2.0)),
        head_filled=bool(rng.random() < 0.3),
        lift=rng.uniform(0.2, 0.7) if rng.random() < 0.25 else None,
        gap=rng.uniform(3.0, 9.0),
        width=rng.uniform(2.0, 14.0),
        color=(color[0], color[1], color[2]),
        ground=(ground[0], ground[1], ground[2]),
    )


def distort(sketch: StrokeSketch, hand: Hand, rng: np.random.Generator) -> tuple[PenStroke, Drawing]:
    """Return a sketch as a hand draws it: what a tablet records, and what is seen on paper.

    The first is the one stroke, with times, along the arrow or round the oval. The second also has
    the arrow's head and the gap where the pen was lifted.

    Parameters
    ----------
    sketch : Arrow or Ellipse
        What is meant.
    hand : Hand
        How it is drawn.
    rng : numpy.random.Generator
        Source of the tremor.
    """
    if isinstance(sketch, Ellipse):
        stroke = _round_oval(sketch, hand, rng)
        return stroke, Drawing(_lifted(stroke, hand), (), hand.color, hand.ground)
    stroke = _along_arrow(sketch, hand, rng)
    left, tip, right = _head(stroke, hand)
    if hand.head_filled:
        # The shaft stops within the head, so that it does not blunt the tip.
        away = np.hypot(*(stroke.points - tip).T) > 0.4 * np.hypot(*(left - tip))
        shaft = PenStroke(stroke.points[away], stroke.widths[away])
        return stroke, Drawing(
            _lifted(shaft, hand), (np.vstack([left, tip, right]),), hand.color, hand.ground
        )
    line = _spaced(np.vstack([left, tip, right]))
    line = _unsteady(line, hand.tremor / 2, hand.tremor_length, rng)
    barb = float(np.clip(stroke.widths[-1], WIDTH_AT_BACK, 6.0))
    head = PenStroke(line, np.full(len(line), barb))
    return stroke, Drawing((*_lifted(stroke, hand), head), (), hand.color, hand.ground)


def _along_arrow(arrow: Arrow, hand: Hand, rng: np.random.Generator) -> PenStroke:
    line = _spaced(arrow.points)
    lengths = arc_lengths(arrow.points)
    places = np.linspace(0.0, lengths[-1], len(line))
    width = hand.width or ARROW_WIDTH
    widths = np.full(len(line), width) if arrow.widths is None else np.interp(places, lengths, arrow.widths)
    return _drawn(_averaged(line, hand.rounding / _SPACING), widths, hand, rng)


def _round_oval(ellipse: Ellipse, hand: Hand, rng: np.random.Generator) -> PenStroke:
    sweep = 2 * np.pi + hand.overshoot
    turn = np.linspace(0.0, sweep, 721)
    size = 1.0 + hand.spiral * (turn / sweep - 0.5)
    turn = hand.start + (-turn if hand.clockwise else turn)
    local = np.column_stack([np.cos(turn), np.sin(turn)]) * size[:, None] * ellipse.axes
    cos, sin = np.cos(ellipse.angle), np.sin(ellipse.angle)
    line = _spaced(ellipse.center + local @ np.array([[cos, sin], [-sin, cos]]))
    width = (hand.width or OUTLINE_WIDTH) if ellipse.width is None else ellipse.width
    return _drawn(line, np.full(len(line), width), hand, rng)


def _drawn(line: Floats, widths: Floats, hand: Hand, rng: np.random.Generator) -> PenStroke:
    """Return a stroke along a line with tremor, pressure and times."""
    points = _unsteady(line, hand.tremor, hand.tremor_length, rng)
    widths = widths * (1.0 + hand.pressure * _noise(len(points), hand.tremor_length, rng))
    speeds = _SPEED * np.exp(0.3 * _noise(len(points), hand.tremor_length, rng))
    times = np.concatenate([[0.0], np.cumsum(np.diff(arc_lengths(points)) / speeds[1:])])
    return PenStroke(points, np.clip(widths, WIDTH_AT_BACK, WIDTH_AT_FRONT), times)


def _unsteady(line: Floats, tremor: float, length: float, rng: np.random.Generator) -> Floats:
    """Return points (K, 2) [m] that stray from a line (K, 2) of points `_SPACING` apart."""
    stray = np.column_stack([_noise(len(line), length, rng) for _ in range(2)])
    # Each coordinate carries half of the square of the distance.
    return np.asarray(np.clip(line + tremor / np.sqrt(2) / RASTER_SIZE * stray, _INSIDE, 1.0 - _INSIDE))


def _spaced(line: Floats) -> Floats:
    """Return a line [m] as points about `_SPACING` apart."""
    length = float(arc_lengths(line)[-1])
    return evenly_spaced(line, max(int(length * RASTER_SIZE / _SPACING), 2) + 1)


def _noise(count: int, length: float, rng: np.random.Generator) -> Floats:
    """Return smooth noise (count,) of variance one that changes over a length [pixels]."""
    sigma = length / _SPACING / 4
    reach = int(3 * sigma) + 1
    kernel: Floats = np.exp(-0.5 * (np.arange(-reach, reach + 1) / sigma) ** 2)
    kernel = kernel / np.sqrt((kernel**2).sum())
    return np.asarray(np.convolve(rng.standard_normal(count + 2 * reach), kernel, mode="valid"), np.float64)


def _averaged(line: Floats, count: float) -> Floats:
    """Return the running mean of a line over `count` points, with its ends where they were."""
    half = min(int(count / 2), (len(line) - 1) // 2)
    places = np.arange(len(line))
    reach = np.minimum(np.minimum(places, places[::-1]), half)
    total = np.cumsum(np.vstack([np.zeros(2), line]), axis=0)
    return np.asarray((total[places + reach + 1] - total[places - reach]) / (2 * reach + 1)[:, None])


def _head(stroke: PenStroke, hand: Hand) -> tuple[Floats, Floats, Floats]:
    """Return the end of the left barb, the point where both meet, and the end of the right one."""
    lengths = arc_lengths(stroke.points)
    barb = (hand.head + stroke.widths[-1] / 2 / np.sin(hand.head_angle)) / RASTER_SIZE
    back = at_arc_length(stroke.points, np.array([max(lengths[-1] - barb, 0.0)]))[0]
    along = stroke.points[-1] - back
    along = along / max(float(np.hypot(*along)), 1e-9)
    across = np.array([-along[1], along[0]])
    forward, left = np.array(hand.head_offset) / RASTER_SIZE
    tip = stroke.points[-1] + forward * along + left * across
    ends = [
        tip
        + barb
        * (1.0 + side * hand.head_skew)
        * (-np.cos(hand.head_angle) * along + side * np.sin(hand.head_angle) * across)
        for side in (1.0, -1.0)
    ]
    return ends[0], tip, ends[1]


def _lifted(stroke: PenStroke, hand: Hand) -> tuple[PenStroke, ...]:
    """Return the stroke in two pieces where the pen was lifted, else the stroke."""
    if hand.lift is None:
        return (stroke,)
    lengths = arc_lengths(stroke.points) * RASTER_SIZE
    place = hand.lift * lengths[-1]
    # Round ends reach into the gap.
    half = (hand.gap + np.interp(place, lengths, stroke.widths)) / 2
    pieces = (lengths < place - half, lengths > place + half)
    return tuple(PenStroke(stroke.points[at], stroke.widths[at]) for at in pieces if at.sum() > 1)
