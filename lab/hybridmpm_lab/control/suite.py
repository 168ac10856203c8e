"""The cases of the suite, their digest, and the scenes and sketches that they are drawn from."""

import functools
import hashlib
import itertools
import json
import math
from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass
from typing import Any, Literal, cast, get_args

import numpy as np
import numpy.typing as npt

from hybridmpm import scenarios
from hybridmpm.control import (
    Arrow,
    Ellipse,
    Keyframe,
    Shape,
    Sketch,
    StrokeSketch,
    parse_png,
    render_png,
)
from hybridmpm.control.goal.room import Room
from hybridmpm.control.sketch.synthetic_sketches import distort, random_hand
from hybridmpm.scene import BallObstacle, Box, BoxObstacle, Polygon, Scene, SegmentObstacle
from hybridmpm_lab.control.outlines import OUTLINES, outline

VERSION = 3
"""Version of the suite; raised whenever a case changes."""

Family = Literal["reversed", "free", "bent", "obstacles", "gather", "hand", "shape", "sequence"]
Kind = Literal["oval", "arrow", "shape", "sequence"]

FAMILIES: tuple[Family, ...] = get_args(Family)
SETTINGS = ("water_2d", "sand_2d", "water_3d", "sand_3d")
"""Scenarios of the reversed family, the paper's four settings."""
_OPEN = tuple(name for name in scenarios.NAMES if "ramps" not in name)
_BOTH: tuple[Kind, ...] = ("oval", "arrow")
_SUITE: dict[Family, tuple[tuple[str, ...], tuple[Kind, ...], range]] = {
    "reversed": (SETTINGS, _BOTH, range(1_200_000, 1_200_060)),
    "free": (scenarios.NAMES, ("oval",), range(1_210_000, 1_210_010)),
    "bent": (_OPEN, ("arrow",), range(1_220_000, 1_220_010)),
    "obstacles": (scenarios.NAMES, ("oval",), range(1_230_000, 1_230_010)),
    "gather": (_OPEN, ("oval",), range(1_240_000, 1_240_010)),
    "hand": (("water_2d", "sand_2d", "water_sand_2d"), _BOTH, range(1_245_000, 1_245_005)),
    "shape": (SETTINGS, ("shape",), range(1_250_000, 1_250_020)),
    "sequence": (SETTINGS, ("sequence",), range(1_255_000, 1_255_010)),
}
"""Scenarios, kinds of sketches and seeds of each family.

Ramps leave no room for a shape on a bent path, or for a letter."""
_MOST = 50  # Largest number of sketches of each kind in a family and scenario
_STILL: dict[str, tuple[int, ...]] = {
    "water_2d": (2, 11),
    "sand_2d": (3, 16, 40, 46),
    "water_3d": (0, 5, 14, 17, 25, 40),
    "sand_3d": (0, 3, 14, 19, 27, 33, 37, 41, 53),
}
"""Reversed seeds, counted from the first, that are left out: in the front view their centre of mass moves by
less than 5 cm in the 100 frames, and a sketch would describe no motion."""

_Floats = npt.NDArray[np.float64]
_Corners = tuple[_Floats, _Floats]

_SALT = {"free": 1, "bent": 2, "obstacles": 3, "gather": 4, "hand": 5, "shape": 6, "sequence": 7}
_AMOUNT = {2: 0.052, 3: 0.00145}  # Volume of fluid by dimension [m^D]: 3400 particles in 2D, 3000 in 3D
_CENTERS = np.array([0.35, 0.4]), np.array([0.65, 0.65])
"""Corners of the box in which free ovals have their centres [m]."""
_BESIDE = 0.16  # Distance of an oval's centre from the ramp beside it [m]
_CLEAR = 0.07  # Wanted distance of such a centre from all ramps [m]
_SHAPE_DEPTH = 0.07  # Depth of a shape in 3D before it gets room [m]: four to five cells
_MARGIN = 0.14  # Least distance of a shape's lines from the edge of the world [m]
# Letters as strokes, boxes (left, bottom, right, top) in units of the letter's height.
_BAR = 0.2
_LETTERS = (
    ((0.0, 0.0, _BAR, 1.0), (_BAR, 0.4, 0.55, 0.4 + _BAR), (0.55, 0.0, 0.55 + _BAR, 1.0)),
    ((0.0, 0.0, _BAR, 1.0), (_BAR, 0.0, 0.55, _BAR), (0.55, 0.0, 0.55 + _BAR, 1.0)),
    ((0.0, 0.0, _BAR, 1.0), (_BAR, 0.8, 0.6, 1.0), (_BAR, 0.4, 0.6, 0.6), (_BAR, 0.0, 0.6, _BAR)),
)
"""The letters H, U and E."""
_FRAME = ((0, 0, 1, 0.15), (0, 0.85, 1, 1), (0, 0.15, 0.15, 0.85), (0.85, 0.15, 1, 0.85))
"""Four bars, the ring of 3D scenes."""


@dataclass(frozen=True, eq=False)
class Start:
    """A scene, the number of frames that it runs before the sketch is drawn, and the sketch."""

    scene: Scene
    frame: int
    sketch: Sketch | tuple[Keyframe, ...]
    """One, or several in turn."""
    meant: StrokeSketch | None = None
    """The sketch before a hand drew it, where `sketch` is read from the hand's picture."""


@dataclass(frozen=True)
class Case:
    """One sketch on one state; everything else follows from these four."""

    family: Family
    scenario: str
    kind: Kind
    seed: int

    def start(self) -> Start:
        """Return scene, frame and sketch; not for `reversed`, whose sketch follows from a run."""
        salt = [_SALT[self.family], scenarios.NAMES.index(self.scenario), self.seed]
        draw = _Drawing(self.scenario, self.seed, np.random.default_rng(salt))
        if self.family == "hand":
            return _by_hand(draw, self.kind)
        families = {
            "free": _free,
            "bent": _bent,
            "obstacles": _obstacles,
            "gather": _gathered,
            "shape": _shaped,
            "sequence": _in_turn,
        }
        return families[self.family](draw)


def cases(
    families: Collection[str] = FAMILIES, names: Collection[str] = scenarios.NAMES, seeds: int | None = None
) -> list[Case]:
    """Return the cases of some families and scenarios, at most `seeds` of each kind of sketch."""

    def moving(family: Family, scenario: str) -> list[int]:
        left_out = _STILL[scenario] if family == "reversed" else ()
        return [seed for index, seed in enumerate(_SUITE[family][2]) if index not in left_out][:_MOST]

    return [
        Case(family, scenario, kind, seed)
        for family, (mine, kinds, _) in _SUITE.items()
        if family in families
        for scenario in mine
        if scenario in names
        for kind in kinds
        for seed in moving(family, scenario)[:seeds]
    ]


@functools.cache
def digest(version: int = VERSION) -> str:
    """Return a hash of all scenes and sketches, and of the seeds of reversed cases.

    It changes with versions of numpy that draw other numbers from the same seed.
    """
    entries = [[version], *map(_entry, cases())]
    return hashlib.sha256(json.dumps(entries, sort_keys=True).encode()).hexdigest()[:16]


def _entry(case: Case) -> list[object]:
    head: list[object] = [case.family, case.scenario, case.kind, case.seed]
    if case.family == "reversed":
        return [*head, scenarios.get(case.scenario, case.seed).model_dump(mode="json", exclude_defaults=True)]
    start = case.start()
    several = start.sketch if isinstance(start.sketch, tuple) else (Keyframe(start.sketch),)
    numbers = [number for keyframe in several for number in _numbers(keyframe)]
    return [
        *head,
        start.scene.model_dump(mode="json", exclude_defaults=True),
        start.frame,
        np.round(numbers, 9).tolist(),
    ]


def _numbers(keyframe: Keyframe) -> list[float]:
    """Return the numbers of a sketch, and the frames for which it is held."""
    sketch = keyframe.goal
    held = [float(keyframe.hold)] if keyframe.hold else []
    if isinstance(sketch, Ellipse):
        return [*sketch.center, *sketch.axes, sketch.angle, sketch.width or 0.0, *held]
    if isinstance(sketch, Arrow):
        return [*sketch.points.ravel(), *held]
    return [*np.concatenate(sketch.outlines).ravel(), sketch.width or 0.0, *held]


class _Drawing:
    """The scenario, the random numbers, and the parts that all families are drawn from."""

    def __init__(self, scenario: str, seed: int, rng: np.random.Generator) -> None:
        self.scenario, self.seed, self.rng = scenario, seed, rng
        self.dim = scenarios.describe(scenario).dim
        self.is_sand = scenario.startswith("sand")
        self.has_ramps = "ramps" in scenario
        self.materials = ("water", "sand") if "water_sand" in scenario else (scenario.partition("_")[0],)

    def of_scenario(self) -> Scene:
        return scenarios.get(self.scenario, self.seed)

    def scene(self, bodies: Sequence[Any], obstacles: Sequence[Any] = ()) -> Scene:
        name = f"{self.scenario} seed {self.seed}"
        return Scene(name=name, dim=self.dim, bodies=tuple(bodies), obstacles=tuple(obstacles))

    def corners(self, left: float, bottom: float, right: float, top: float, depth: float) -> _Corners:
        """Return the corners (D,) of a box in the middle of the depth."""
        lower, upper = (left, bottom, 0.5 - depth / 2), (right, top, 0.5 + depth / 2)
        return np.array(lower[: self.dim]), np.array(upper[: self.dim])

    def boxes(self, corners: Iterable[_Corners], **fields: Any) -> list[Box]:
        """Return bodies of the scenario's materials, by turns."""
        return [
            Box(
                lower=_rounded(lower),
                upper=_rounded(upper),
                material=material,
                seed=int(self.rng.integers(2**31)),
                **fields,
            )
            for (lower, upper), material in zip(corners, itertools.cycle(self.materials), strict=False)
        ]

    def block(self, left: float, bottom: float, width: float) -> list[_Corners]:
        """Return a block of the whole amount, cut in two along the height for two materials."""
        depth = 0.1 if self.dim == 3 else 1.0
        height = _AMOUNT[self.dim] / width / depth
        levels = np.linspace(bottom, bottom + height, len(self.materials) + 1)
        return [
            self.corners(left, low, left + width, high, depth) for low, high in itertools.pairwise(levels)
        ]

    def strokes(self, boxes: Sequence[Sequence[float]], corner: _Floats, size: float, depth: float) -> Scene:
        """Return a scene of boxes given in units of `size` from a corner on."""
        x, y = corner
        units = ([size * edge for edge in box] for box in boxes)
        return self.scene(
            self.boxes([self.corners(x + a, y + b, x + c, y + d, depth) for a, b, c, d in units])
        )

    def oval(self, scene: Scene, center: _Floats | None = None) -> Ellipse:
        """Draw an oval of 0.7 to 1.6 times the fluid's volume."""
        rng = self.rng
        aspect = rng.uniform(1, 2.2)
        volume = sum(body.measure for body in scene.bodies) * rng.uniform(0.7, 1.6)
        mean = math.sqrt(volume / math.pi) if self.dim == 2 else (volume / math.pi * 3 / 4) ** (1 / 3)
        axes = mean * np.array([math.sqrt(aspect), 1 / math.sqrt(aspect)])
        drawn = rng.uniform(*_CENTERS)
        angle, width = rng.uniform(0, math.pi), float(rng.uniform(7, 15))
        return Ellipse(drawn if center is None else center, axes, angle, None if self.dim == 2 else width)

    def shape(self, scene: Scene, name: str) -> Shape:
        """Draw a shape of 0.95 to 1.1 times the fluid's area, in 3D some cells deep."""
        rng = self.rng
        volume = sum(body.measure for body in scene.bodies) * rng.uniform(0.95, 1.1)
        area = volume if self.dim == 2 else volume / _SHAPE_DEPTH
        center, turn = rng.uniform(*_CENTERS), rng.uniform(-0.25, 0.25)
        made = outline(name, area, center, turn, None if self.dim == 2 else 11.0)
        low, high = made.bounds
        within = np.clip(0, _MARGIN - low, None) + np.clip(0, None, 1 - _MARGIN - high)
        return Shape(tuple(line + within for line in made.outlines), made.width)


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
        parts = itertools.pairwise(np.linspace(left, left + width, len(draw.materials) + 1))
        scene = draw.scene(draw.boxes([draw.corners(a, 0.1, b, 0.1 + height, 1.0) for a, b in parts]))
        frame = 250 if "sand" in draw.materials else 100
    return Start(scene, frame, draw.oval(scene))


def _by_hand(draw: _Drawing, kind: str) -> Start:
    """Draw a start of `free`, and the reading of a hand's picture of an oval or of an arrow upwards."""
    start, rng = _free(draw), draw.rng
    meant = cast("StrokeSketch", start.sketch)
    if kind == "arrow":
        tail = rng.uniform([0.35, 0.2], [0.65, 0.35])
        tip = tail + rng.uniform([-0.2, 0.2], [0.2, 0.34])
        meant = Arrow(np.linspace(tail, tip, 40))
    _, picture = distort(meant, random_hand(rng, meant.kind), rng)
    return Start(start.scene, start.frame, parse_png(render_png(picture)), meant)


def _shaped(draw: _Drawing) -> Start:
    """Draw a start of `free`, and one of the outlines, the next one with each seed."""
    start = _free(draw)
    name = [*OUTLINES][draw.seed % len(OUTLINES)]
    return Start(start.scene, start.frame, draw.shape(start.scene, name))


def _in_turn(draw: _Drawing) -> Start:
    """Draw a start of `free`, and three goals: two outlines, and an oval, an arrow or a third outline."""
    start, rng = _free(draw), draw.rng
    names = rng.permutation([*OUTLINES])
    goals: list[Sketch] = [draw.shape(start.scene, str(name)) for name in names[:3]]
    if draw.seed % 3 == 0:
        goals[1] = draw.oval(start.scene)
    elif draw.seed % 3 == 1:
        tail = goals[1].center if isinstance(goals[1], Shape) else _CENTERS[0]
        tip = np.clip(tail + rng.uniform([-0.15, -0.1], [0.15, 0.1]), *_CENTERS)
        goals[2] = Arrow(np.linspace(tail, tip, 20))
    holds = [int(20 * rng.integers(2)) for _ in goals[1:]]
    return Start(
        start.scene,
        start.frame,
        tuple(Keyframe(goal, hold=hold) for goal, hold in zip(goals, [*holds, 0], strict=True)),
    )


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
    """Draw fluid on one side of an obstacle and an oval on the other: a post, a ball or a plate."""
    rng = draw.rng
    if draw.has_ramps:
        scene = draw.of_scenario()
        return Start(scene, 250, draw.oval(scene, _beside_a_ramp(draw, scene)))
    shape = draw.seed % 3
    left, width = (0.35, 0.3) if draw.dim == 2 else (0.43, 0.15)
    if shape == 0:
        solid: Any = _box_obstacle(draw.corners(0.47, 0.1, 0.52, rng.uniform(0.32, 0.45), 0.8))
        center = rng.uniform([0.68, 0.32], [0.73, 0.45])
        left, width = 0.13, 0.26 if draw.dim == 2 else 0.15
    elif shape == 1:
        radius = rng.uniform(0.08, 0.11)
        middle = rng.uniform([0.45, 0.36], [0.55, 0.4])
        solid = BallObstacle(center=_rounded(np.append(middle, [0.5] * (draw.dim - 2))), radius=radius)
        center = np.array([middle[0] + rng.uniform(-0.05, 0.05), middle[1] + radius + 0.17])
    else:
        level = rng.uniform(0.34, 0.4)
        solid = _box_obstacle(draw.corners(0.3, level, 0.7, level + 0.036, 0.4))
        center = np.array([rng.uniform(0.42, 0.58), level + 0.2])
    scene = draw.scene(draw.boxes(draw.block(left, 0.11, width)), [solid])
    return Start(scene, 10 if draw.dim == 3 and not draw.is_sand else 100, draw.oval(scene, center))


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
    """Draw two puddles, a ring or a letter, which no affine map brings into the oval."""
    rng, dim = draw.rng, draw.dim
    shape, frame = draw.seed % 3, 5
    if shape == 0:
        width = rng.uniform(0.15, 0.22) if dim == 2 else rng.uniform(0.09, 0.12)
        height = 0.1 + _AMOUNT[dim] / 2 / width / (0.1 if dim == 3 else 1.0)
        sides = [(0.1, 0.1 + width), (0.9 - width, 0.9)]
        scene = draw.scene(draw.boxes([draw.corners(a, 0.1, b, height, 0.1) for a, b in sides]))
        frame = 10 if dim == 3 and not draw.is_sand else 150 if draw.is_sand else 60
    elif shape == 1:
        scene = _ring(draw)
    else:
        letter = _LETTERS[int(rng.integers(len(_LETTERS)))]
        height = 0.32 if dim == 2 else 0.3
        corner = rng.uniform([0.2, 0.2], [0.5, 0.4])
        area = sum((right - left) * (top - bottom) for left, bottom, right, top in letter) * height**2
        scene = draw.strokes(letter, corner, height, _AMOUNT[3] / area)
    return Start(scene, frame, draw.oval(scene))


def _ring(draw: _Drawing) -> Scene:
    """Draw a ring, in 3D a frame of four bars."""
    center = draw.rng.uniform([0.35, 0.35], [0.6, 0.5])
    if draw.dim == 3:
        return draw.strokes(_FRAME, center - 0.14, 0.28, _AMOUNT[3] / (0.28**2 * 0.51))
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


def _box_obstacle(corners: _Corners) -> BoxObstacle:
    return BoxObstacle(lower=_rounded(corners[0]), upper=_rounded(corners[1]))


def _rounded(corner: _Floats) -> tuple[float, ...]:
    return tuple(np.round(corner, 6).tolist())
