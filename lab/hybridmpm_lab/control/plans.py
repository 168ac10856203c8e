"""Prints how long plans of shapes take, and how much memory: docs/results/control-studies.md.

`python -m hybridmpm_lab.control.plans` takes half a minute on a quiet machine.
"""

import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

from hybridmpm.control import Keyframe, Shape, follow, prepare_keyframes
from hybridmpm.mpm import MpmSolver
from hybridmpm_lab.control.suite import SETTINGS, cases

SEEDS = 6
"""Outlines of each scenario."""
REPEATS = 5
_PAGE = 4096  # bytes
_MIB = 2**20


def memory() -> float:
    """Return the resident memory of the process [MiB]."""
    return int(Path("/proc/self/statm").read_text(encoding="utf-8").split()[1]) * _PAGE / _MIB


def spent(work: Callable[[], object]) -> list[float]:
    """Return what repeats take [ms]."""
    found = []
    for _ in range(REPEATS):
        begun = time.perf_counter()
        work()
        found.append(1000 * (time.perf_counter() - begun))
    return found


def measured(name: str) -> str:
    """Return a line of the table for a scenario."""
    first, three, most, particles = [], [], 0.0, 0
    for case in cases(["shape"], [name], SEEDS):
        start = case.start()
        solver = MpmSolver(start.scene)
        solver.advance(start.frame)
        particles = max(particles, solver.particle_count)
        sketch = start.sketch
        if not isinstance(sketch, Shape):
            raise TypeError(f"the family shape has shapes, got {sketch!r}")
        twin = solver.copy()
        first += spent(lambda: next(follow(twin.copy(), sketch, "analytic")))  # noqa: B023 - called at once
        goals = [Keyframe(sketch, 120)] * 3
        three += spent(lambda: prepare_keyframes(twin, goals, "analytic"))  # noqa: B023
        before = memory()
        following = follow(solver, sketch, "analytic")
        following.run()
        most = max(most, memory() - before)
    least, median, high = np.percentile(first, (0, 50, 90))
    cells = [name, str(particles), f"{least:.0f}", f"{median:.0f}", f"{high:.0f}"]
    return "| " + " | ".join([*cells, f"{np.median(three):.0f}", f"{most:.0f}"]) + " |"


HEAD = "| | particles | first frame, least [ms] | median | 90 % | three goals [ms] | with its motion [MiB] |"

if __name__ == "__main__":
    print(HEAD)  # noqa: T201
    print("|---" * 7 + "|")  # noqa: T201
    for scenario in SETTINGS:
        print(measured(scenario), flush=True)  # noqa: T201
