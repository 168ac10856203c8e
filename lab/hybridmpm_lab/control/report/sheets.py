"""Contact sheets: sketch, start, target, and what each method made of it; first and worst cases."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt
from PIL import Image, ImageDraw

from hybridmpm._support.files import replacing
from hybridmpm.control.sketch.render import render
from hybridmpm.export.ink import Picture, empty_front, with_ink
from hybridmpm.render import view_of
from hybridmpm_lab.control.entrants import FILLED, Entrant
from hybridmpm_lab.control.report.means import judged_by
from hybridmpm_lab.control.suite.cases import Case
from hybridmpm_lab.control.suite.problems import problem
from hybridmpm_lab.control.trial import Trial, run
from hybridmpm_lab.harness.rows import Progress, Row

_SIZE, _GAP, _HEAD, _SIDE = 170, 4, 16, 92
"""Side of a picture, gaps, and room for titles above and on the left [pixels]."""
WORST_OF = "analytic"
"""Whose worst cases are shown."""
_WORST_BY_HAND = 5
"""Number of hand-drawn sketches that are shown: those that it does worst."""
_INK = (40, 40, 40)
_MILLIMETRES = 1000


@dataclass(frozen=True, eq=False)
class Line:
    """One line of a sheet."""

    title: str
    pictures: list[tuple[str, Picture]]
    """Pictures with their titles."""


def first_cases(some: Sequence[Case]) -> dict[str, list[Case]]:
    """Return, for each family, the first case of each scenario and kind of sketch."""
    found: dict[str, dict[tuple[str, str], Case]] = {}
    for case in some:
        found.setdefault(case.family, {}).setdefault((case.scenario, case.kind), case)
    return {family: list(lines.values()) for family, lines in found.items()}


def sheets(some: Sequence[Case], rows: Sequence[Row]) -> dict[str, list[Case]]:
    """Return the cases of each sheet: by family the first ones, and the worst ones of all families.

    The worst case of a family is the one that `WORST_OF` did worst, by what the family is judged by. Of
    hand-drawn sketches the five worst are shown in the place of the first ones.

    Parameters
    ----------
    some : sequence of Case
    rows : sequence of Row
        Runs of these cases.
    """
    ranked = sorted(
        (row for row in rows if row["method"] == WORST_OF and row["failed"] is None),
        key=lambda row: float(row[judged_by(row["family"])]),
    )
    by_name = {(case.family, case.scenario, case.kind, case.seed): case for case in some}
    # The last of a family is its worst.
    worst = {
        row["family"]: by_name[row["family"], row["scenario"], row["sketch"], row["seed"]] for row in ranked
    }
    by_hand = [row for row in ranked if row["family"] == "hand"][: -_WORST_BY_HAND - 1 : -1]
    shown = first_cases(some)
    if by_hand:
        shown["hand"] = [
            by_name[row["family"], row["scenario"], row["sketch"], row["seed"]] for row in by_hand
        ]
    return shown | ({"worst": list(worst.values())} if worst else {})


def write_sheets(
    folder: Path,
    lines: Mapping[str, Sequence[Case]],
    entrants: Sequence[Entrant],
    *,
    on_progress: Progress,
) -> list[Path]:
    """Run cases once more, and write sheets `control-NAME.png`.

    Parameters
    ----------
    folder : Path
    lines : mapping
        Cases of each sheet by the sheet's name, see `sheets`.
    entrants : sequence of Entrant
    on_progress : callable
        Called after each case.

    Raises
    ------
    ConfigError, SimulationError
        As `trial.run`.
    ExportError
        A file cannot be written.
    """
    written = []
    for name, some in lines.items():
        drawn = []
        for case in some:
            drawn.append(_line(case, entrants))
            on_progress(1)
        path = folder / f"control-{name}.png"
        with replacing(path) as part:
            _sheet(drawn).save(part, optimize=True)
        written.append(path)
    return written


def _line(case: Case, entrants: Sequence[Entrant]) -> Line:
    ready = problem(case)
    scene, start = ready.simulator.scene, ready.simulator
    view = view_of(scene, start.materials, _SIZE)

    def drawn(x: npt.NDArray[np.floating]) -> Picture:
        return view.draw(x.astype(np.float32), np.zeros_like(x, dtype=np.float32), start.time)

    nowhere = np.full_like(start.positions, np.nan)
    room = drawn(nowhere) if scene.dim == 2 else empty_front(scene.walls, _SIZE)
    sketched = with_ink(room, render(ready.sketch), scene.walls)
    pictures = [("sketch", sketched), ("start", drawn(start.positions))]
    target = ready.truth
    for entrant in (one for one in entrants if one.enters(case.family)):
        if entrant.name == FILLED and ready.truth is None:
            continue  # that is the target
        trial = run(ready, entrant)
        if target is None:
            target = trial.goal.paths.places.astype(np.float32)
        picture = drawn(nowhere if trial.end is None else trial.end)
        pictures.append((f"{entrant.name}: {_figure(trial, case.family)}", picture))
    if target is not None:
        pictures.insert(2, ("target", drawn(target)))
    by = judged_by(case.family).replace("_", " ")
    return Line(f"{case.family}\n{case.scenario}\n{case.kind}\nseed {case.seed}\n\nfigures:\n{by}", pictures)


def _figure(trial: Trial, family: str) -> str:
    """Return what a family is judged by first: an error, or a distance in millimetres."""
    if trial.end is None:
        return "failed"
    measure = judged_by(family)
    value = trial.row[measure]
    if value is None:
        return "-"
    return f"{value:.2f}" if measure == "error" else f"{_MILLIMETRES * value:.3g} mm"


def _sheet(lines: Sequence[Line]) -> Image.Image:
    columns = max(len(line.pictures) for line in lines)
    step = _SIZE + _GAP
    sheet = Image.new("RGB", (_SIDE + columns * step, len(lines) * (step + _HEAD)), "white")
    pen = ImageDraw.Draw(sheet)
    for row, line in enumerate(lines):
        top = row * (step + _HEAD)
        pen.text((4, top + _HEAD + 4), line.title, fill=_INK)
        for column, (title, picture) in enumerate(line.pictures):
            left = _SIDE + column * step
            pen.text((left, top + 2), title, fill=_INK)
            # Views of 3D scenes are wider than high.
            sheet.paste(Image.fromarray(picture), (left, top + _HEAD + (_SIZE - picture.shape[0]) // 2))
    return sheet
