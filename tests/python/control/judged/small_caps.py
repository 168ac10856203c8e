"""Prints how methods do under small caps: a table of docs/guide/control.md.

`python -m tests.python.control.judged.small_caps` takes 12 reversed cases of each scenario, from the test
seed 1100600 on, or those that `--seeds FIRST END` names. It takes some minutes.
"""

import argparse
from collections.abc import Sequence

import numpy as np

from hybridmpm.control import Following, ReversedCase, prepare, reversed_from_seed

CAPS = (3.0, 5.0, 15.0)
"""Caps [g]."""
METHODS = ("constant", "analytic", "backcast", "learned")
SEEDS = 1_100_600, 1_100_612


def judged(case: ReversedCase, method: str, cap: float) -> tuple[float, float, bool]:
    """Return the final grid RMSE, the share of the mass inside, and whether the method handed over."""
    simulator, frames = case.simulator(), case.frames
    guidance = prepare(simulator, case.sketch, method=method, frames=frames, cap=cap)
    result = Following(simulator, guidance).run()
    return case.error(result.positions[-1]), result.reached.inside or 0.0, guidance.method != method


def table(names: Sequence[str], seeds: Sequence[int]) -> list[str]:
    """Return the rows of the table: final grid RMSE, in brackets the share inside, means over seeds."""
    lines = ["| scenario | cap [g] | " + " | ".join(METHODS) + " | handed over |"]
    lines.append("|---" * (len(METHODS) + 3) + "|")
    for name in names:
        cases = [reversed_from_seed(name, seed, start="live", kind="oval") for seed in seeds]
        for cap in CAPS:
            runs = [[judged(case, method, cap) for method in METHODS] for case in cases]
            found = np.mean(np.array(runs, dtype=np.float64), axis=0)
            cells = " | ".join(f"{error:.3f} ({inside:.2f})" for error, inside, _ in found)
            lines.append(f"| {name} | {cap:g} | {cells} | {100 * found[-1, 2]:.0f} % |")
    return lines


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--scenario", nargs="+", default=["water_2d", "sand_2d"])
    parser.add_argument("--seeds", nargs=2, type=int, default=SEEDS, metavar=("FIRST", "END"))
    asked = parser.parse_args()
    print("\n".join(table(asked.scenario, range(*asked.seeds))))  # noqa: T201 - that is what it is for
