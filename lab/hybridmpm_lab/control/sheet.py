"""Draws a sheet of a family's sketches with the fluid in them: docs/images/shapes.png.

`python -m hybridmpm_lab.control.sheet docs/images/shapes.png` follows the twenty shapes of water_2d.
"""

import argparse
from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw

from hybridmpm.control import Shape, follow
from hybridmpm.mpm import MpmSolver
from hybridmpm_lab.control.suite import Case, cases

SIDE = 150
"""Side of one picture [pixels]."""
COLUMNS = 5
_LARGER = 3  # Factor at which a picture is drawn, so that lines are smooth
_GROUND, _WATER, _SAND, _LINE = "#0a0f16", "#4696eb", "#d8a860", "#e5564f"
_ROOM = 0.1, 0.9  # Part of the world that is shown [m]


def picture(case: Case) -> Image.Image:
    """Return the fluid at the end of a shape's frames, within its outline."""
    start = case.start()
    solver = MpmSolver(start.scene)
    solver.advance(start.frame)
    sketch = start.sketch
    if not isinstance(sketch, Shape):
        raise TypeError(f"the family shape has shapes, got {sketch!r}")
    result = follow(solver, sketch, "analytic").run()
    side = SIDE * _LARGER
    image = Image.new("RGB", (side, side), _GROUND)
    pen = ImageDraw.Draw(image)

    def placed(x: np.ndarray) -> np.ndarray:
        low, high = _ROOM
        return np.column_stack([x[:, 0] - low, high - x[:, 1]]) / (high - low) * side

    radius = 0.55 * start.scene.spacing / (_ROOM[1] - _ROOM[0]) * side
    colour = _SAND if case.scenario.startswith("sand") else _WATER
    for x, y in placed(result.positions[-1]):
        pen.ellipse((x - radius, y - radius, x + radius, y + radius), fill=colour)
    for line in sketch.outlines:
        corners = [tuple(corner) for corner in placed(np.vstack([line, line[:1]]))]
        pen.line(corners, fill=_LINE, width=_LARGER, joint="curve")
    return image.resize((SIDE, SIDE), Image.Resampling.LANCZOS)


def sheet(name: str) -> Image.Image:
    """Return the pictures of a scenario's shapes, row by row."""
    pictures = [picture(case) for case in cases(["shape"], [name])]
    rows = -(-len(pictures) // COLUMNS)
    whole = Image.new("RGB", (COLUMNS * (SIDE + 2) - 2, rows * (SIDE + 2) - 2), "#33475e")
    for number, one in enumerate(pictures):
        row, column = divmod(number, COLUMNS)
        whole.paste(one, (column * (SIDE + 2), row * (SIDE + 2)))
    return whole


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("file", type=Path)
    parser.add_argument("--scenario", choices=("water_2d", "sand_2d"), default="water_2d")
    asked = parser.parse_args()
    sheet(asked.scenario).quantize(64).save(asked.file, optimize=True)
