"""Sketches drawn as by hand, each a function of its seed."""

import io
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from PIL import Image

from hybridmpm.control import Arrow, Ellipse, Sketch
from hybridmpm.control.sketch.polyline import arc_lengths, at_arc_length
from hybridmpm.control.sketch.render import Drawing, PenStroke, render
from hybridmpm.control.sketch.sketch import Floats
from hybridmpm.control.sketch.synthetic_sketches import distort, random_hand

SEED = 20250
PICTURES = {"on paper": 256, "compressed": 512, "photographed": 400}
"""Pictures of the first sketches, with their sides [pixels]."""


@dataclass(frozen=True)
class HandDrawn:
    """A sketch that was meant, the stroke that a tablet recorded, and the drawing that is seen."""

    meant: Sketch
    stroke: PenStroke
    drawing: Drawing


def random_sketch(rng: np.random.Generator, *, depth: bool) -> Sketch:
    """Return an arrow of one to three segments or an oval, with a depth in 3D or without."""
    return _random_arrow(rng, depth) if rng.random() < 0.5 else _random_ellipse(rng, depth)


def draw(seed: int) -> HandDrawn:
    """Return what a hand draws, from its seed alone; every other one has a depth."""
    rng = np.random.default_rng(seed)
    meant = random_sketch(rng, depth=seed % 2 == 0)
    return HandDrawn(meant, *distort(meant, random_hand(rng, meant.kind), rng))


def _random_arrow(rng: np.random.Generator, depth: bool) -> Arrow:  # noqa: FBT001
    while True:
        points = [rng.uniform(0.08, 0.92, 2)]
        direction = rng.uniform(0.0, 2 * np.pi)
        for _ in range(int(rng.integers(1, 4))):
            step = rng.uniform(0.16, 0.4) * np.array([np.cos(direction), np.sin(direction)])
            points.append(points[-1] + step)
            direction += rng.choice([-1, 1]) * rng.uniform(0.3, 1.3)
        line = np.array(points)
        # On a short line a wide head hides what the width at the tip is.
        long_enough = arc_lengths(line)[-1] > (0.35 if depth else 0.0)
        if long_enough and line.min() > 0.06 and line.max() < 0.94 and not _meets_itself(line):
            break
    if not depth:
        return Arrow(line)
    return Arrow(line, np.linspace(*rng.uniform(2.5, 19.0, 2), len(line)))


def _meets_itself(line: Floats) -> bool:
    """Return whether parts of a line that are 0.15 m apart along it come nearer than 0.09 m."""
    places = np.linspace(0.0, float(arc_lengths(line)[-1]), 80)
    points = at_arc_length(line, places)
    away = np.hypot(*(points[:, None] - points).transpose(2, 0, 1))
    return bool((away[np.abs(places[:, None] - places) > 0.15] < 0.09).any())


def _random_ellipse(rng: np.random.Generator, depth: bool) -> Ellipse:  # noqa: FBT001
    while True:
        major = rng.uniform(0.06, 0.3)
        minor = max(major * rng.uniform(0.3, 1.0), 0.036)
        center = rng.uniform(0.1, 0.9, 2)
        if minor <= major and (center > major + 0.04).all() and (center < 0.96 - major).all():
            break
    width = rng.uniform(2.5, min(19.0, 256 * minor)) if depth else None
    return Ellipse(center, np.array([major, minor]), rng.uniform(-1.5, 1.5), width)


def pictures() -> Iterator[bytes]:
    """Make the pictures: the first sketches on uneven paper, with JPEG's artefacts, in uneven light."""
    rng = np.random.default_rng(SEED)
    for index, (name, side) in enumerate(PICTURES.items()):
        picture = Image.fromarray(render(draw(SEED + index).drawing)).convert("RGB").resize((side, side))
        values = np.asarray(picture, dtype=np.float64)
        if name == "on paper":
            values = values - 12.0 * rng.random((side, side, 1)).round(1)
        elif name == "compressed":
            data = io.BytesIO()
            picture.save(data, "JPEG", quality=40)
            values = np.asarray(Image.open(data), dtype=np.float64)
        else:
            values = values * np.linspace(0.9, 1.0, side)[:, None, None]
        data = io.BytesIO()
        Image.fromarray(np.rint(values).astype(np.uint8)).quantize(64).save(data, "PNG", optimize=True)
        yield data.getvalue()


SKETCHES = [draw(SEED + index) for index in range(40)]
