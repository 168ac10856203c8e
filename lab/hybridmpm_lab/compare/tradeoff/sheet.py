"""A contact sheet: what the methods make of a scene of each scenario, some time after its first impact."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import numpy.typing as npt
from PIL import Image, ImageDraw

from hybridmpm import scenarios as library
from hybridmpm._support.files import replacing
from hybridmpm.errors import SimulationError
from hybridmpm.mpm import MpmSolver
from hybridmpm.physics.manifest import default_model
from hybridmpm.planner.calibrating.impact import LONGEST_FALL, first_impact
from hybridmpm.render import view_of
from hybridmpm.scene import Scene
from hybridmpm.simulator import Simulator
from hybridmpm_lab.compare.accuracy.conventions import FIRST_SEED
from hybridmpm_lab.compare.tradeoff.entrants import entrants
from hybridmpm_lab.harness.rows import Progress

AFTER = 100
"""Frames after the first impact of the states shown."""
_SIZE, _GAP, _HEAD, _SIDE = 190, 4, 18, 120
"""Side of a picture, gaps, and room for titles above and on the left [pixels]."""
_INK = (40, 40, 40)
_LINES = ("initial state", "MPM, the truth", "network,\nall carried along", "MPM at 1/1.75", "hybrid")

_Picture = npt.NDArray[np.uint8]


def write_sheet(file: Path, names: Sequence[str], threads: int, on_progress: Progress) -> None:
    """Simulate the first held-out scene of each scenario by each method, and write a PNG.

    A column is a scenario; the lines are the initial state, the truth, the network as it is shipped, MPM at
    r_p = 1/1.75, and the hybrid with the network, `AFTER` frames after the first impact.

    Raises
    ------
    ExportError
        The file cannot be written.
    """
    columns = []
    for name in names:
        columns.append(_column(name, threads))
        on_progress(1)
    step = _SIZE + _GAP
    sheet = Image.new("RGB", (_SIDE + len(columns) * step, _HEAD + len(_LINES) * step), "white")
    pen = ImageDraw.Draw(sheet)
    for line, title in enumerate(_LINES):
        pen.text((4, _HEAD + line * step + 6), title, fill=_INK)
    for index, (name, pictures) in enumerate(zip(names, columns, strict=True)):
        left = _SIDE + index * step
        pen.text((left, 3), name, fill=_INK)
        for line, picture in enumerate(pictures):
            # Views of 3D scenes are wider than high.
            top = _HEAD + line * step + (_SIZE - picture.shape[0]) // 2
            sheet.paste(Image.fromarray(picture), (left, top))
    with replacing(file) as part:
        sheet.save(part, optimize=True)


def _column(scenario: str, threads: int) -> list[_Picture]:
    scene, model = library.get(scenario, FIRST_SEED), default_model(scenario)
    known = entrants(scenario)
    truth = MpmSolver(scene, substeps="reference", threads=threads)
    frame = first_impact(MpmSolver(scene), LONGEST_FALL) + AFTER
    makers = [known[name].make for name in (f"neural {model} all shown", "mpm 1/1.75", f"hybrid {model}")]
    simulators: list[Simulator] = [truth, *(make(scene, threads) for make in makers)]
    pictures = [_drawn(scene, truth)]
    for simulator in simulators:
        try:
            simulator.advance(frame)
            pictures.append(_drawn(scene, simulator))
        except SimulationError:
            pictures.append(np.full_like(pictures[0], 255))
    return pictures


def _drawn(scene: Scene, simulator: Simulator) -> _Picture:
    view = view_of(scene, simulator.materials, _SIZE, simulator.particle_spacing)
    return view.draw(simulator.positions, simulator.velocities, simulator.time)
