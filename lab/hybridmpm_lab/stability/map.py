"""The stability map: each method under each stress at three levels, and what became of it."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from hybridmpm_lab.harness.provenance import Provenance
from hybridmpm_lab.harness.rows import Progress, Row, significant
from hybridmpm_lab.harness.store import RowStore
from hybridmpm_lab.stability.outcome import figures, judged, volume_spread
from hybridmpm_lab.stability.stresses.handling import HANDLING
from hybridmpm_lab.stability.stresses.matter import MATTER
from hybridmpm_lab.stability.stresses.motion import MOTION
from hybridmpm_lab.stability.stresses.solids import SOLIDS
from hybridmpm_lab.stability.stresses.trial import Method, Stress, Trial
from hybridmpm_lab.stability.trials import attempt, truth

STRESSES: dict[str, Stress] = {one.name: one for one in (*MOTION, *MATTER, *SOLIDS, *HANDLING)}
"""Stresses by name, in the order of the map."""
LEVELS = 3
JITTERS = 3
"""Runs of the truth with other jitter, which tell how much chance there is in a trial."""
KEY = ("method", "material", "dim", "stress", "step")
"""Fields that tell cells apart; `step` counts the levels from 1, the mildest."""


@dataclass(frozen=True)
class Cell:
    """One cell of the map."""

    method: Method
    material: str
    dim: int
    stress: str
    step: int
    """Level, from 1 for the mildest to `LEVELS`."""

    @property
    def key(self) -> tuple[object, ...]:
        """The values of `KEY`."""
        return (self.method, self.material, self.dim, self.stress, self.step)


def cells(names: Sequence[str] = ()) -> list[Cell]:
    """Return the cells of some stresses, or of all, those of one scene together."""
    return [
        Cell(method, material, dim, stress.name, step)
        for stress in STRESSES.values()
        if not names or stress.name in names
        for material, dim in stress.settings
        for step in range(1, LEVELS + 1)
        for method in stress.methods
    ]


def trial_of(cell: Cell) -> Trial:
    """Return the trial of a cell."""
    return STRESSES[cell.stress].trials(cell.material, cell.dim)[cell.step - 1]


def measure(todo: Sequence[Cell], runs: RowStore, origin: Provenance, on_progress: Progress) -> Iterator[Row]:
    """Run the cells that are missing, adding each to the runs, and yield all rows.

    `on_progress` counts cells.

    `signalled` names the errors, warnings and alarms that a user meets, None where there are none. `against`
    names the measures that speak against survival. `energy` is the largest energy over that at the start and
    the work done, `density` the largest crowding over the truth's, `volume` the volume in the last quarter
    over the truth's; None where the run came to no end. `volume_jitter` is the part by which the volume of
    the truth with other jitter differs from the truth's, at most.
    """
    scenes: dict[tuple[object, ...], list[Cell]] = {}
    for cell in todo:
        scenes.setdefault(cell.key[1:], []).append(cell)
    for mine in scenes.values():
        missing = [cell for cell in mine if cell.key not in runs]
        if missing:
            trial = trial_of(missing[0])
            true, *others = (truth(trial, shift=shift) for shift in range(1 + JITTERS))
            for cell in missing:
                made = attempt(trial, cell.method)
                row = dict(zip(KEY, cell.key, strict=True)) | {"level": trial.level}
                found: Row = {"outcome": "refused" if made.refused else "failed", "against": None}
                shown: Row = dict.fromkeys(("energy", "density", "volume"))
                if made.run is not None:
                    outcome, faults = judged(made.run, true, others, carries=cell.method != "mpm")
                    found = {"outcome": outcome, "against": ", ".join(faults) or None}
                    if all(one.finite for one in made.run.looks):
                        shown = {name: significant(value) for name, value in figures(made.run, true).items()}
                signalled = {"signalled": ", ".join(made.signals) or None}
                spread = {"volume_jitter": significant(volume_spread(true, others))}
                runs.add(cell.key, origin.stamped(row | found | signalled | shown | spread))
        on_progress(len(mine))
    for cell in todo:
        yield runs[cell.key]


def defects(rows: Sequence[Row]) -> list[Row]:
    """Return the cells in which MPM or the hybrid is degraded or fails, and nobody tells the user."""
    return [
        row
        for row in rows
        if row["method"] != "neural" and row["outcome"] in ("degraded", "failed") and not row["signalled"]
    ]


def rescued(rows: Sequence[Row]) -> list[Row]:
    """Return the cells of the hybrid that survive what the network alone, not refused, does not."""
    outcomes = {tuple(row[name] for name in KEY): row["outcome"] for row in rows}
    found = []
    for row in rows:
        alone = outcomes.get(("neural", *(row[name] for name in KEY[1:])))
        if row["method"] == "hybrid" and row["outcome"] == "survived" and alone in ("degraded", "failed"):
            found.append(row)
    return found
