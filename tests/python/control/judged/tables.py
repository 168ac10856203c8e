"""Prints the tables of docs/guide/control.md.

`python -m tests.python.control.judged.tables` judges the seeds 200 to 211, or those that `--seeds FIRST END`
names. It takes some minutes.
"""

import argparse
from collections.abc import Iterator, Sequence

import numpy as np
from tests.python.control.judged.scenes import (
    FREE,
    IN_DEPTH,
    LATE,
    OVER_RAMPS,
    Maker,
    lateness,
    reversed_error,
    shares,
)


def _rows_of_shares(makers: dict[str, Maker], seeds: Sequence[int]) -> Iterator[str]:
    yield "| | at the end | worst | 20 later, held | let go | in the oval as drawn | force, over the least |"
    yield "|---|---|---|---|---|---|---|"
    for name, make in makers.items():
        found = [shares(make, seed) for seed in seeds]
        mean = {field: np.mean([getattr(one, field) for one in found]) for field in vars(found[0])}
        worst = min(one.end for one in found)
        yield (
            f"| {name} | {mean['end']:.3f} | {worst:.3f} | {mean['later']:.3f} | {mean['loose']:.3f} "
            f"| {mean['drawn']:.3f} | {mean['over_least']:.2f} |"
        )


def _rows_of_lateness(seeds: Sequence[int]) -> Iterator[str]:
    yield f"| lost by {LATE} frames of delay | mean | worst |"
    yield "|---|---|---|"
    for name, make in (FREE | OVER_RAMPS).items():
        lost = [lateness(make, seed) for seed in seeds]
        yield f"| {name} | {np.mean(lost):.3f} | {max(lost):.3f} |"


def _rows_of_reversal(seeds: Sequence[int]) -> Iterator[str]:
    yield "| final grid RMSE | constant | analytic | backcast |"
    yield "|---|---|---|---|"
    for scenario in ("water_2d", "sand_2d"):
        found = {
            method: np.array([reversed_error(scenario, method, seed) for seed in seeds])
            for method in ("constant", "analytic", "backcast")
        }
        bodies = found["constant"][:, 0]
        for name, chosen in (("one body", bodies == 1), ("several", bodies > 1), ("all", bodies > 0)):
            if chosen.any():
                means = " | ".join(f"{errors[chosen, 1].mean():.3f}" for errors in found.values())
                yield f"| {scenario}, {name} ({chosen.sum()}) | {means} |"


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, nargs=2, default=(200, 212), metavar=("FIRST", "END"))
    seeds = range(*parser.parse_args().seeds)
    for rows in (
        _rows_of_shares(FREE | OVER_RAMPS, seeds),
        _rows_of_shares(IN_DEPTH, seeds[:4]),
        _rows_of_lateness(seeds),
        _rows_of_reversal(seeds),
    ):
        for row in rows:
            print(row, flush=True)  # noqa: T201 - that is what it is for
        print()  # noqa: T201
