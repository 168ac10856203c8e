"""Draws docs/images/coarse.png: the seven scenarios in full and at the level 1/16, at three moments each.

`python -m tests.python.coarse.contact_sheet docs/images/coarse.png` writes it, always the same.
"""

import sys
from pathlib import Path

import numpy as np
import numpy.typing as npt
from PIL import Image, ImageDraw

from hybridmpm import MpmSolver, scenarios
from hybridmpm._support.files import replacing
from hybridmpm.planner.calibrating.impact import LONGEST_FALL, first_impact
from hybridmpm.render import view_of

SEED = 1_100_003
LEVEL = "1/16"
AFTER = (40, 100, 200)
"""Frames after the first impact."""
_SIZE, _GAP, _HEAD, _SIDE = 200, 4, 16, 100
_INK = (40, 40, 40)

Picture = npt.NDArray[np.uint8]


def pictures(solver: MpmSolver, impact: int) -> list[Picture]:
    """Draw a solver at the moments of the sheet."""
    view = view_of(solver.scene, solver.materials, _SIZE)
    drawn = []
    for frame in AFTER:
        solver.advance(impact + frame - solver.frame)
        drawn.append(view.draw(solver.positions, solver.velocities, solver.time))
    return drawn


def line(scenario: str) -> list[Picture]:
    """Return the pictures of a scenario: at each moment in full, then by the level."""
    scene = scenarios.get(scenario, SEED)
    full = MpmSolver(scene, substeps="reference")
    impact = first_impact(full, LONGEST_FALL)
    rows = zip(pictures(full, impact), pictures(MpmSolver(scene, coarse=LEVEL), impact), strict=True)
    return [picture for pair in rows for picture in pair]


def sheet() -> Image.Image:
    """Put the lines of all scenarios below each other."""
    step = _SIZE + _GAP
    width = _SIDE + 2 * len(AFTER) * step + (len(AFTER) - 1) * 3 * _GAP
    image = Image.new("RGB", (width, _HEAD + len(scenarios.NAMES) * step), "white")
    draw = ImageDraw.Draw(image)
    for row, scenario in enumerate(scenarios.NAMES):
        top = _HEAD + row * step
        draw.text((4, top + _SIZE // 2 - 6), scenario, fill=_INK)
        for column, picture in enumerate(line(scenario)):
            left = _SIDE + column * step + column // 2 * 3 * _GAP
            image.paste(Image.fromarray(picture[:, :, :3]).resize((_SIZE, _SIZE)), (left, top))
            if row == 0:
                title = f"{AFTER[column // 2]} frames: " + (
                    "all simulated" if column % 2 == 0 else f"coarse level {LEVEL}"
                )
                draw.text((left + 4, 2), title, fill=_INK)
    return image


if __name__ == "__main__":
    with replacing(Path(sys.argv[1])) as part:
        sheet().save(part, optimize=True)
