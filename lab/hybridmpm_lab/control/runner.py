"""`measure`: all entrants on all cases, as far as they have not run before."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from hybridmpm_lab.control.entrants import Entrant
from hybridmpm_lab.control.measures.naturalness import LEAST_SEEDS
from hybridmpm_lab.control.results import Runs
from hybridmpm_lab.control.suite.cases import REFERENCE_SEEDS, VERSION, Case, digest
from hybridmpm_lab.control.suite.problems import problem, uncontrolled
from hybridmpm_lab.control.trial import CAP, HOLD, look_at, run
from hybridmpm_lab.harness.provenance import Provenance
from hybridmpm_lab.harness.rows import Progress, significant
from hybridmpm_lab.harness.timing import Calibration


@dataclass(frozen=True, kw_only=True)
class ControlSettings:
    """What of the benchmark is measured."""

    cases: Sequence[Case]
    entrants: Sequence[Entrant]

    def shared(self) -> dict[str, Any]:
        """Return what runs must share to stand in one table."""
        return {"version": VERSION, "suite": digest(), "cap": CAP, "hold": HOLD}

    def judged(self) -> list[str]:
        """Return the scenarios of which naturalness is judged: those with enough reversed cases."""
        reversed_ones = [case for case in self.cases if case.family == "reversed"]
        names = dict.fromkeys(case.scenario for case in reversed_ones)
        return [
            name
            for name in names
            if len({case.seed for case in reversed_ones if case.scenario == name}) >= LEAST_SEEDS
        ]


def count_missing(settings: ControlSettings, runs: Runs) -> int:
    """Return the number of steps that `measure` has before it."""
    trials = sum(len(_missing(case, settings, runs)) for case in settings.cases)
    seeds = (set(REFERENCE_SEEDS) - runs.reference_seeds(name) for name in settings.judged())
    return trials + sum(map(len, seeds))


def measure(settings: ControlSettings, runs: Runs, origin: Provenance, on_progress: Progress) -> None:
    """Run what is missing, and add it to the runs one by one; `on_progress` counts them.

    `slowdown` of a run is the larger slowdown of the machine before and after it.

    Raises
    ------
    ConfigError
        A method is broken; the message names it and the case.
    SimulationError
        A case could not be simulated up to its sketch.
    ExportError
        The file of runs cannot be written to.
    """
    calibration = Calibration(threads=1)
    for case in settings.cases:
        missing = _missing(case, settings, runs)
        if missing:
            ready = problem(case)
            before = calibration.slowdown()
            for entrant in missing:
                trial = run(ready, entrant)
                after = calibration.slowdown()
                row = trial.row | {"slowdown": significant(max(before, after), 3)}
                runs.add(origin.stamped(row), trial.looks)
                before = after
                on_progress(1)
    for name in settings.judged():
        for seed in sorted(set(REFERENCE_SEEDS) - runs.reference_seeds(name)):
            runs.add_reference(name, seed, [look_at(solver) for solver in uncontrolled(name, seed)])
            on_progress(1)


def _missing(case: Case, settings: ControlSettings, runs: Runs) -> list[Entrant]:
    return [one for one in settings.entrants if one.enters(case.family) and not runs.has(case, one.name)]
