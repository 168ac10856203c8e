"""Draws docs/images/control.png: five sketches, and the start, the middle and the end of following each.

`python -m tests.python.control.judged.contact_sheet docs/images/control.png` writes it, always the same.
"""

import argparse
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import numpy.typing as npt
from PIL import Image, ImageDraw
from tests.python.control.judged import scenes

from hybridmpm import Box, MpmSolver, Scene, SegmentObstacle
from hybridmpm.control import Arrow, Ellipse, Sketch, follow
from hybridmpm.control.sketch.render import render
from hybridmpm.render import side_by_side, view_of
from hybridmpm.render.flat import MARGIN

WIDTH = 248
"""Width of each picture [pixels]."""
Picture = npt.NDArray[np.uint8]


def cases() -> Iterator[tuple[MpmSolver, Sketch]]:
    """Yield a pool, a heap of sand, two puddles, a fluid under ramps, and a block that a bent arrow leads."""
    rng = np.random.default_rng(7)
    yield scenes.pool(7, rng), Ellipse(np.array([0.5, 0.6]), np.array([0.16, 0.12]), 0.3)
    yield scenes.sand(7, rng), Ellipse(np.array([0.45, 0.62]), np.array([0.18, 0.11]), 2.6)
    yield scenes.puddles(7, rng), Ellipse(np.array([0.5, 0.5]), np.array([0.17, 0.12]), 0.0)
    ramps = [
        SegmentObstacle(start=(0.2, 0.34), end=(0.48, 0.28), thickness=0.02),
        SegmentObstacle(start=(0.55, 0.42), end=(0.82, 0.5), thickness=0.02),
    ]
    water = Box(lower=(0.1, 0.1), upper=(0.9, 0.16), material="water")
    yield (
        MpmSolver(Scene(dim=2, bodies=[water], obstacles=ramps)),
        Ellipse(np.array([0.45, 0.68]), np.array([0.15, 0.11]), 0.2),
    )
    block = Box(lower=(0.2, 0.2), upper=(0.38, 0.38), material="water")
    corners = np.array([[0.29, 0.29], [0.64, 0.33], [0.66, 0.6], [0.4, 0.7]])
    yield MpmSolver(Scene(dim=2, bodies=[block])), Arrow(corners)


def row(solver: MpmSolver, sketch: Sketch) -> Picture:
    """Return the sketch, and the fluid at the start, in the middle and at the end, side by side."""
    view = view_of(solver.scene, solver.materials, WIDTH)
    pictures = [view.draw(solver.positions, solver.velocities)]
    following = follow(solver, sketch)
    frames = following.guidance.frames
    for index, _ in enumerate(following, start=1):
        if index in (frames // 2, frames):
            pictures.append(view.draw(solver.positions, solver.velocities))
    height, width = pictures[0].shape[:2]
    raster = Image.fromarray(render(sketch)).convert("RGBA")
    paper = Image.new("RGBA", raster.size, "white")
    paper.alpha_composite(raster)
    # The other pictures show the room between the walls, at 0.1 and 0.9 m, and a margin.
    low, high = 0.1 - 0.8 * MARGIN, 0.9 + 0.8 * MARGIN
    box = tuple(round(edge * raster.width) for edge in (low, low, high, high))
    drawn = paper.convert("RGB").crop(box).resize((width, height), Image.Resampling.LANCZOS)
    ImageDraw.Draw(drawn).rectangle((0, 0, width - 1, height - 1), outline="lightgrey")
    return side_by_side([np.asarray(drawn), *pictures])


def sheet() -> Picture:
    """Return all rows, one below the other."""
    rows = [row(*case).swapaxes(0, 1) for case in cases()]
    return np.ascontiguousarray(side_by_side(rows).swapaxes(0, 1))


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("file", type=Path)
    Image.fromarray(sheet()).save(parser.parse_args().file, optimize=True)
