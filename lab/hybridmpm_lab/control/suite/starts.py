"""Scenes and sketches of the families that need no simulation to be drawn."""

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from hybridmpm import scenarios
from hybridmpm.control import Arrow, Ellipse, Sketch, parse_png, render_png
from hybridmpm.control.goal.room import Room
from hybridmpm.control.sketch.synthetic_sketches import distort, random_hand
from hybridmpm.scene import BallObstacle, Box, BoxObstacle, Polygon, Scene, SegmentObstacle

_Floats = npt.NDArray[np.float64]

_SALT = {"free": 1, "bent": 2, "obstacles": 3, "gather": 4, "hand": 5}
_AMOUNT = {2: 0.052, 3: 0.00145}
"""Volume of fluid by dimension [m^D]: 3400 particles in 2D, 3000 in 3D."""
_CENTERS = np.array([0.35, 0.4]), np.array([0.65, 0.65])
"""Corners of the box in which free ovals have their centres [m]."""
_BESIDE = 0.16
"""Distance of an oval's centre from the ramp that it lies behind [m]."""
_CLEAR = 0.07
"""Distance of such a centre from all ramps [m], as far as there is one."""
# Letters as strokes, boxes (left, bottom, right, top) in units of the letter's height.
_BAR = 0.2
_LETTERS = (
    ((0.0, 0.0, _BAR, 1.0), (_BAR, 0.4, 0.55, 0.4 + _BAR), (0.55, 0.0, 0.55 + _BAR, 1.0)),
    ((0.0, 0.0, _BAR, 1.0), (_BAR, 0.0, 0.55, _BAR), (0.55, 0.0, 0.55 + _BAR, 1.0)),
    ((0.0, 0.0, _BAR, 1.0), (_BAR, 0.8, 0.6, 1.0), (_BAR, 0.4, 0.6, 0.6), (_BAR, 0.0, 0.6, _BAR)),
)
"""The letters H, U and E."""


@dataclass(frozen=True, eq=False)
class Start:
    """A scene, the number of frames that it runs before the sketch is drawn, and the sketch."""

    scene: Scene
    frame: int
    sketch: Sketch
    meant: Sketch | None = None
    """What a hand meant, where the sketch is what is read from its picture."""


def drawn_start(family: str, scenario: str, kind: str, seed: int) -> Start:
    """Draw a start of a family from a seed; the same seed gives the same start."""
    rng = np.random.default_rng([_SALT[family], scenarios.NAMES.index(scenario), seed])
    if family == "hand":
        return _by_hand(_Drawing(scenario, seed, rng), kind)
    draw = {"free": _free, "bent": _bent, "obstacles": _obstacles, "gather": _gathered}[family]
    return draw(_Drawing(scenario, seed, rng))


class _Drawing:
    """What the parts of a start are drawn with."""

    def __init__(self, scenario: str, seed: int, rng: np.random.Generator) -> None:
        self.scenario, self.seed, self.rng = scenario, seed, rng
        self.dim = scenarios.describe(scenario).dim
        self.is_sand = scenario.startswith("sand")
        self.has_ramps = "ramps" in scenario
        self.materials = ("water", "sand") if "water_sand" in scenario else (scenario.partition("_")[0],)

    def of_scenario(self) -> Scene:
        return scenarios.get(self.scenario, self.seed)

    def scene(self, bodies: Sequence[Any], obstacles: Sequence[Any] = ()) -> Scene:
        return Scene(
            name=f"{self.scenario} seed {self.seed}",
            dim=self.dim,
            bodies=tuple(bodies),
            obstacles=tuple(obstacles),
        )

    def boxes(self, corners: Sequence[tuple[_Floats, _Floats]], **fields: Any) -> list[Box]:
        """Return bodies between pairs of corners (D,), of the scenario's materials by turns."""
        return [
            Box(
                lower=_rounded(lower),
                upper=_rounded(upper),
                material=self.materials[index % len(self.materials)],
                seed=int(self.rng.integers(2**31)),
                **fields,
            )
            for index, (lower, upper) in enumerate(corners)
        ]

    def block(self, left: float, bottom: float, width: float) -> list[tuple[_Floats, _Floats]]:
        """Return a block of the whole amount, cut in two along the height where there are two materials."""
        depth = 0.1 if self.dim == 3 else 1.0
        height = _AMOUNT[self.dim] / width / depth
        count = len(self.materials)
        lower = np.array([left, bottom, 0.5 - depth / 2][: self.dim])
        upper = np.array([left + width, bottom + height, 0.5 + depth / 2][: self.dim])
        levels = np.linspace(bottom, bottom + height, count + 1)
        return [
            (_with_height(lower, low), _with_height(upper, high)) for low, high in itertools.pairwise(levels)
        ]

    def oval(self, scene: Scene, center: _Floats | None = None) -> Ellipse:
        """Draw an oval of 0.7 to 1.6 times the fluid's volume."""
        rng = self.rng
        aspect = rng.uniform(1, 2.2)
        volume = sum(body.measure for body in scene.bodies) * rng.uniform(0.7, 1.6)
        mean = math.sqrt(volume / math.pi) if self.dim == 2 else (volume / math.pi * 3 / 4) ** (1 / 3)
        axes = mean * np.array([math.sqrt(aspect), 1 / math.sqrt(aspect)])
        drawn = rng.uniform(*_CENTERS)
        angle, width = rng.uniform(0, math.pi), rng.uniform(7, 15)
        return Ellipse(
            drawn if center is None else center, axes, angle, None if self.dim == 2 else float(width)
        )


def _free(draw: _Drawing) -> Start:
    """Draw a layer on the floor or a heap, or a scene of the scenario in motion, and an oval in the air."""
    rng = draw.rng
    if draw.has_ramps:
        scene, frame = draw.of_scenario(), 80
    elif draw.dim == 3:
        scene, frame = draw.of_scenario(), 150 if draw.is_sand else 40
    elif draw.seed % 2:
        scene, frame = draw.of_scenario(), 120
    else:
        width = 0.3 if draw.is_sand else 0.8
        left = rng.uniform(0.1, 0.6) if draw.is_sand else 0.1
        height = _AMOUNT[2] * rng.uniform(0.95, 1.15) / width
        parts = np.linspace(left, left + width, len(draw.materials) + 1)
        corners = [(np.array([a, 0.1]), np.array([b, 0.1 + height])) for a, b in itertools.pairwise(parts)]
        scene, frame = draw.scene(draw.boxes(corners)), 250 if "sand" in draw.materials else 100
    return Start(scene, frame, draw.oval(scene))


def _by_hand(draw: _Drawing, kind: str) -> Start:
    """Draw a start of `free`, and what is read from a hand's picture of an oval or of an arrow upwards."""
    start, rng = _free(draw), draw.rng
    meant = start.sketch
    if kind == "arrow":
        tail = rng.uniform([0.35, 0.2], [0.65, 0.35])
        tip = tail + rng.uniform([-0.2, 0.2], [0.2, 0.34])
        meant = Arrow(np.linspace(tail, tip, 40))
    _, picture = distort(meant, random_hand(rng, meant.kind), rng)
    return Start(start.scene, start.frame, parse_png(render_png(picture)), meant)


def _bent(draw: _Drawing) -> Start:
    """Draw a flying block and an arrow of two legs, with the tremor of a hand."""
    rng = draw.rng
    width = rng.uniform(0.17, 0.27) if draw.dim == 2 else rng.uniform(0.1, 0.15)
    left, bottom = rng.uniform([0.15, 0.15], [0.3, 0.25])
    velocity = np.append(rng.uniform(-1, 1, 2), [0.0] * (draw.dim - 2))
    scene = draw.scene(draw.boxes(draw.block(left, bottom, width), velocity=tuple(np.round(velocity, 4))))
    legs = rng.uniform([0.15, -0.05], [0.3, 0.05]), rng.uniform([-0.05, 0.15], [0.05, 0.3])
    corners = np.cumsum([[0.3, 0.3], *legs], axis=0)
    points = np.concatenate([np.linspace(a, b, 40) for a, b in itertools.pairwise(corners)])
    return Start(scene, 5, Arrow(points + rng.normal(scale=0.001, size=points.shape)))


def _obstacles(draw: _Drawing) -> Start:
    """Draw an obstacle, fluid on one side of it, and an oval on the other."""
    rng = draw.rng
    if draw.has_ramps:
        scene = draw.of_scenario()
        return Start(scene, 250, draw.oval(scene, _beside_a_ramp(draw, scene)))
    deep = [(), (0.1, 0.9)][draw.dim - 2]
    frame = 10 if draw.dim == 3 and not draw.is_sand else 100
    shape = draw.seed % 3
    if shape == 0:  # a post between the fluid and the oval
        height = rng.uniform(0.32, 0.45)
        solid: Any = _box_obstacle((0.47, 0.1, *deep[:1]), (0.52, height, *deep[1:]))
        center = rng.uniform([0.68, 0.32], [0.73, 0.45])
        left, width = 0.13, 0.26 if draw.dim == 2 else 0.15
    elif shape == 1:  # a ball under the oval
        radius = rng.uniform(0.08, 0.11)
        middle = rng.uniform([0.45, 0.36], [0.55, 0.4])
        solid = BallObstacle(center=_rounded(np.append(middle, [0.5] * (draw.dim - 2))), radius=radius)
        center = np.array([middle[0] + rng.uniform(-0.05, 0.05), middle[1] + radius + 0.17])
        left, width = (0.35, 0.3) if draw.dim == 2 else (0.43, 0.15)
    else:  # a plate under the oval
        level = rng.uniform(0.34, 0.4)
        depth = (0.3, 0.7) if draw.dim == 3 else ()
        solid = _box_obstacle((0.3, level, *depth[:1]), (0.7, level + 0.036, *depth[1:]))
        center = np.array([rng.uniform(0.42, 0.58), level + 0.2])
        left, width = (0.35, 0.3) if draw.dim == 2 else (0.43, 0.15)
    scene = draw.scene(draw.boxes(draw.block(left, 0.11, width)), [solid])
    return Start(scene, frame, draw.oval(scene, center))


def _beside_a_ramp(draw: _Drawing, scene: Scene) -> _Floats:
    """Draw a point near one of the ramps, above or below it, with room around it."""
    points = []
    for ramp in scene.obstacles:
        if isinstance(ramp, SegmentObstacle):
            start, end = np.array(ramp.start), np.array(ramp.end)
            along = (end - start) / np.linalg.norm(end - start)
            normal = np.array([-along[1], along[0]])
            points += [(start + end) / 2 + side * _BESIDE * normal for side in (-1, 1)]
    near = np.clip(points, [0.28, 0.3], [0.72, 0.7])
    room = Room(scene, 0.0).distance(near)
    fitting = np.flatnonzero(room >= min(_CLEAR, float(room.max())))
    return np.asarray(near[draw.rng.choice(fitting)])


def _gathered(draw: _Drawing) -> Start:
    """Draw two puddles, a ring or a letter, none of which an affine map brings into the oval."""
    rng, dim = draw.rng, draw.dim
    shape = draw.seed % 3
    if shape == 0:
        width = rng.uniform(0.15, 0.22) if dim == 2 else rng.uniform(0.09, 0.12)
        deep = (0.45, 0.55) if dim == 3 else ()
        height = 0.1 + _AMOUNT[dim] / 2 / width / (0.1 if dim == 3 else 1.0)
        sides = [(0.1, 0.1 + width), (0.9 - width, 0.9)]
        corners = [(np.array([a, 0.1, *deep[:1]]), np.array([b, height, *deep[1:]])) for a, b in sides]
        scene = draw.scene(draw.boxes(corners))
        frame = 10 if dim == 3 and not draw.is_sand else 150 if draw.is_sand else 60
    elif shape == 1:
        scene, frame = _ring(draw), 5
    else:
        letter = _LETTERS[int(rng.integers(len(_LETTERS)))]
        height = 0.32 if dim == 2 else 0.3
        corner = rng.uniform([0.2, 0.2], [0.5, 0.4])
        area = sum((right - left) * (top - bottom) for left, bottom, right, top in letter) * height**2
        depth = _AMOUNT[3] / area
        scene = draw.scene(draw.boxes([_stroke(one, corner, height, depth, dim) for one in letter]))
        frame = 5
    return Start(scene, frame, draw.oval(scene))


def _ring(draw: _Drawing) -> Scene:
    """Draw a ring, in 3D a frame of four bars."""
    center = draw.rng.uniform([0.35, 0.35], [0.6, 0.5])
    if draw.dim == 3:
        bars = ((0, 0, 1, 0.15), (0, 0.85, 1, 1), (0, 0.15, 0.15, 0.85), (0.85, 0.15, 1, 0.85))
        depth = _AMOUNT[3] / (0.28**2 * 0.51)
        return draw.scene(draw.boxes([_stroke(one, center - 0.14, 0.28, depth, 3) for one in bars]))
    outer, hole = 0.19, math.sqrt(0.19**2 - _AMOUNT[2] / math.pi)
    bodies = []
    for index, material in enumerate(draw.materials):
        first, last = np.array([index, index + 1]) * 2 * math.pi / len(draw.materials)
        turn = np.linspace(first, last, 64)
        circle = np.column_stack([np.cos(turn), np.sin(turn)])
        corners = np.concatenate([center + outer * circle, center + hole * circle[::-1]])
        vertices = tuple(_rounded(corner) for corner in corners)
        bodies.append(Polygon(vertices=vertices, material=material, seed=int(draw.rng.integers(2**31))))
    return draw.scene(bodies)


def _stroke(
    box: Sequence[float], corner: _Floats, size: float, depth: float, dim: int
) -> tuple[_Floats, _Floats]:
    """Return the corners (D,) of a stroke given in units of `size` from a corner on."""
    left, bottom, right, top = size * np.array(box)
    lower = np.array([corner[0] + left, corner[1] + bottom, 0.5 - depth / 2][:dim])
    return lower, np.array([corner[0] + right, corner[1] + top, 0.5 + depth / 2][:dim])


def _box_obstacle(lower: tuple[float, ...], upper: tuple[float, ...]) -> BoxObstacle:
    return BoxObstacle(lower=_rounded(np.array(lower)), upper=_rounded(np.array(upper)))


def _with_height(corner: _Floats, height: float) -> _Floats:
    return np.concatenate([corner[:1], [height], corner[2:]])


def _rounded(corner: _Floats) -> tuple[float, ...]:
    return tuple(np.round(corner, 6).tolist())
