"""The search for the constants of one level: CMA-ES, with a journal from which it goes on."""

import json
import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from hybridmpm._core import SOLVER_VERSION
from hybridmpm.errors import CoarseWarning, DataError, SimulationError
from hybridmpm.mpm import MpmSolver
from hybridmpm_lab.fitting.cases import Case
from hybridmpm_lab.fitting.cma_es import minimise
from hybridmpm_lab.fitting.outcome import Outcome, measure
from hybridmpm_lab.fitting.space import SCALE, Constants, Floats, Target, milliseconds

PRICE = 0.25
"""Exponent of the time in the objective, error * time^PRICE.

Along the ladder of coarse levels halving the time costs 18 to 24 % in error, a factor of 2^0.24 to 2^0.31. So the
lowest objective lies where the front touches a line of about its own slope.
"""
DENSEST = 1.3
"""Largest density, 99th percentile over that at rest, that is allowed."""
_DENSITY_MARGIN, _TRANSPORT_MARGIN = 0.03, 0.05
"""How far within the bounds a search stays: other runs are longer, and other scenes differ."""
_PENALTY = 4.0
"""Weight of what violates a bound, in the logarithm of the objective."""


@dataclass(frozen=True)
class Found:
    """The best constants of a search."""

    constants: Constants
    value: float
    trials: int


def search(
    target: Target,
    cases: Sequence[Case],
    trials: int,
    journal: Path,
    on_trial: Callable[[], object],
    *,
    known: Constants | None = None,
) -> Found:
    """Search the constants of a coarse level on training scenes.

    The objective is the logarithm of error * time^`PRICE`, meaned over the scenes. Transport must not be
    worse than that of the few without carrying, nor density exceed `DENSEST`: what does is penalised.

    Parameters
    ----------
    target : Target
    cases : sequence of Case
    trials : int
        Number of points that are tried.
    journal : Path
        File that every trial is appended to. Trials that it holds already are not made again.
    on_trial : callable
        Called after each trial.
    known : Constants, optional
        Constants of an older search, which stay where no trial is better on these scenes.

    Raises
    ------
    DataError
        The journal is of another search.
    """
    book = _Journal(journal, [case.scene.name for case in cases])
    few = [_run(MpmSolver(case.scene, r_p=target.r_p), case) for case in cases]
    reached = float(np.mean([one.transport for one in few]))

    def value(offset: Floats) -> float:
        constants = Constants.at(target, offset)
        noted = book.known(offset)
        if noted is None:
            noted, means = _value(target, constants, cases, reached)
            book.write(offset, noted, means)
        on_trial()
        return noted

    best = minimise(value, SCALE, go_on=lambda done: done < trials, seed=1)
    found = Found(Constants.at(target, best.x), best.value, best.trials)
    if known is None:
        return found
    of_known, _ = _value(target, known, cases, reached)
    return found if found.value < of_known else Found(known, of_known, best.trials)


def _value(
    target: Target, constants: Constants, cases: Sequence[Case], reached: float
) -> tuple[float, dict[str, float]]:
    """Return the objective, and means over the cases for whoever reads the journal."""
    outcomes, times = [], []
    for case in cases:
        level = constants.level(target, case.scene)
        try:
            outcome = _run(MpmSolver(case.scene, coarse=level), case)
        except SimulationError:
            return float("inf"), {}
        times.append(milliseconds(target, outcome, len(case.scene.sample().x)))
        outcomes.append(outcome)
    means = {
        "error": float(np.mean([one.error for one in outcomes])),
        "ms": float(np.mean(times)),
        "transport": float(np.mean([one.transport for one in outcomes])) / reached,
        "density": float(np.mean([one.density for one in outcomes])),
        "redone": float(np.mean([one.redone > 0 for one in outcomes])),
    }
    crowded = np.mean([max(0.0, one.density - (DENSEST - _DENSITY_MARGIN)) for one in outcomes])
    violation = crowded + max(0.0, means["transport"] - (1 - _TRANSPORT_MARGIN)) + 0.1 * means["redone"]
    logs = [np.log(one.error) + PRICE * np.log(spent) for one, spent in zip(outcomes, times, strict=True)]
    return float(np.mean(logs) + _PENALTY * violation), means


def _run(solver: MpmSolver, case: Case) -> Outcome:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", CoarseWarning)  # Frames that are redone are counted.
        return measure(case, solver)


class _Journal:
    """Trials in the order in which they were made, each by the offset that was tried."""

    def __init__(self, file: Path, scenes: Sequence[str]) -> None:
        self._file, self._next = file, 0
        head = {"solver_version": SOLVER_VERSION, "scenes": list(scenes)}
        if not file.exists():
            file.write_text(json.dumps(head) + "\n", encoding="utf-8")
        first, *lines = file.read_text(encoding="utf-8").splitlines()
        try:
            found = json.loads(first)
            self._trials = [(one["offset"], float(one["value"])) for one in map(json.loads, lines)]
        except (ValueError, KeyError, TypeError) as error:
            raise DataError(f"{file} is damaged: {error}; delete it to search anew") from None
        if found != head:
            raise DataError(
                f"{file} is of a search on other scenes or of another solver: {first}; delete it, or choose "
                "another folder"
            )

    def known(self, offset: Floats) -> float | None:
        """Return the value of the next trial if it was made before."""
        if self._next >= len(self._trials):
            return None
        tried, value = self._trials[self._next]
        if not np.allclose(tried, offset, rtol=1e-9, atol=1e-12):
            raise DataError(f"{self._file} is of another search; delete it, or choose another folder")
        self._next += 1
        return value

    def write(self, offset: Floats, value: float, means: dict[str, float]) -> None:
        """Append a trial, with what it showed."""
        self._trials.append((offset.tolist(), value))
        self._next += 1
        with self._file.open("a", encoding="utf-8") as stream:
            stream.write(json.dumps({"offset": offset.tolist(), "value": value} | means) + "\n")
