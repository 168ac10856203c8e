"""Contact sheets: sketch, start, target, and the end of each method's run."""

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
import numpy.typing as npt
from PIL import Image, ImageDraw

from hybridmpm._support.files import replacing
from hybridmpm.control.sketch.render import render
from hybridmpm.export.ink import Picture, empty_front, with_ink
from hybridmpm.render import view_of
from hybridmpm_lab.control.methods import FILLED, Methods, takes_part
from hybridmpm_lab.control.runner import Trial, problem, run
from hybridmpm_lab.control.suite import Case
from hybridmpm_lab.control.table import judged_by
from hybridmpm_lab.harness.rows import Progress, Row

_SIZE, _GAP, _HEAD, _SIDE = 170, 4, 16, 92
"""Side of a picture, gaps, and room for titles above and on the left [pixels]."""
_WORST_OF = "analytic"
_INK = (40, 40, 40)


def sheets(some: Sequence[Case], rows: Sequence[Row]) -> dict[str, list[Case]]:
    """Return the cases of each sheet: of each family, and the `worst` of all.

    A family's sheet has the first case of each scenario and kind of sketch. The worst case of a family is the
    one on which `analytic` is worst by `judged_by`. `rows` are the runs of the cases.
    """
    first: dict[str, dict[tuple[str, str], Case]] = {}
    for case in some:
        first.setdefault(case.family, {}).setdefault((case.scenario, case.kind), case)
    found = {family: list(lines.values()) for family, lines in first.items()}
    ranked = [row for row in rows if row["method"] == _WORST_OF and row["failed"] is None]
    ranked.sort(key=lambda row: float(row[judged_by(row["family"])]))
    # A later case of a family replaces an earlier one, so that the worst stays.
    worst = {
        row["family"]: Case(row["family"], row["scenario"], row["sketch"], row["seed"]) for row in ranked
    }
    return found | ({"worst": list(worst.values())} if worst else {})


def write_sheets(
    folder: Path, lines: Mapping[str, Sequence[Case]], methods: Methods, on_progress: Progress
) -> list[Path]:
    """Run the cases of each sheet once more, and write `control-NAME.png`; `on_progress` counts cases."""
    written = []
    step = _SIZE + _GAP
    for name, some in lines.items():
        drawn = []
        for case in some:
            drawn.append(_pictures(case, methods))
            on_progress(1)
        width = _SIDE + max(map(len, drawn)) * step
        sheet = Image.new("RGB", (width, len(drawn) * (step + _HEAD)), "white")
        pen = ImageDraw.Draw(sheet)
        for case, pictures, top in zip(some, drawn, range(0, sheet.height, step + _HEAD), strict=True):
            by = judged_by(case.family).replace("_", " ")
            text = f"{case.family}\n{case.scenario}\n{case.kind}\nseed {case.seed}\n\nfigures:\n{by}"
            pen.text((4, top + _HEAD + 4), text, fill=_INK)
            for (title, picture), left in zip(pictures, range(_SIDE, width, step), strict=False):
                pen.text((left, top + 2), title, fill=_INK)
                # Views of 3D scenes are wider than high.
                sheet.paste(Image.fromarray(picture), (left, top + _HEAD + (_SIZE - picture.shape[0]) // 2))
        path = folder / f"control-{name}.png"
        with replacing(path) as part:
            sheet.save(part, optimize=True)
        written.append(path)
    return written


def _pictures(case: Case, methods: Methods) -> list[tuple[str, Picture]]:
    """Return the pictures of one case, with their titles."""
    ready = problem(case)
    scene, start = ready.simulator.scene, ready.simulator
    view = view_of(scene, start.materials, _SIZE)

    def drawn(x: npt.NDArray[np.floating]) -> Picture:
        return view.draw(x.astype(np.float32), np.zeros_like(x, dtype=np.float32), start.time)

    nowhere = np.full_like(start.positions, np.nan)
    room = drawn(nowhere) if scene.dim == 2 else empty_front(scene.walls, _SIZE)
    sketched = with_ink(room, render(ready.sketch), scene.walls)
    target = ready.goal.paths.places if ready.truth is None else ready.truth
    pictures = [("sketch", sketched), ("start", drawn(start.positions)), ("target", drawn(target))]
    for name, method in methods.items():
        # Without a truth the filled sketch is the target.
        if takes_part(name, case.family) and not (name == FILLED and ready.truth is None):
            trial = run(ready, name, method)
            end = nowhere if trial.end is None else trial.end
            pictures.append((f"{name}: {_figure(trial, case.family)}", drawn(end)))
    return pictures


def _figure(trial: Trial, family: str) -> str:
    """Return an error, or a distance in millimetres, as `judged_by` says."""
    value = trial.row[judged_by(family)]
    if value is None:
        return "failed" if trial.end is None else "-"
    return f"{value:.2f}" if family == "reversed" else f"{1000 * value:.3g} mm"
