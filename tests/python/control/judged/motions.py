"""Prints what a few numbers of each particle, or of each cell, keep of true motions,
for docs/guide/control.md.

`python -m tests.python.control.judged.motions` takes 24 reversed cases of each scenario, from the validation
seed 1000600 on, or those that `--seeds FIRST END` names. It takes some minutes.

A motion is the way q(s) - q(0) of a particle, s from 0 to 1. It is written as an end times s and K - 1 sines,
sin(k pi s), fitted by least squares. The loss is the share of the squared paths that this leaves out. What
ends alone are good for is also tried: guidance leads the particles to their true ends, by the law of learned
plans.
"""

import argparse
import dataclasses
from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from hybridmpm.coarse.clustering import balanced_clusters
from hybridmpm.control import ReversedCase, follow, reversed_from_seed
from hybridmpm.control.goal.paths import Paths
from hybridmpm.control.laws import Tracked
from hybridmpm.control.methods.method import Task
from hybridmpm.simulator import Simulator

Floats = npt.NDArray[np.float64]
COEFFICIENTS = (1, 4, 8, 16)
SEEDS = 1_000_600, 1_000_624
CELLS = (32, 16)
"""Cells per metre, in each of which particles start that get the same coefficients."""
GROUPS, FINER, CAP = 208, 2, 15.0
"""Of learned plans: groups that go the same way, cells for the smoothing of the force, and cap [g]."""


def kept(way: Floats, count: int) -> Floats:
    """Return paths (T + 1, N, D) as `count` coefficients of each particle tell them."""
    s = np.linspace(0, 1, len(way))
    basis = np.stack([s, *(np.sin(k * np.pi * s) for k in range(1, count))], axis=1)
    flat = way.reshape(len(way), -1)
    return np.asarray((basis @ np.linalg.lstsq(basis, flat, rcond=None)[0]).reshape(way.shape))


def of_cells(way: Floats, start: Floats, cells: int | None) -> Floats:
    """Return paths (..., N, D) that are the means over the particles that start in one cell; None: as is."""
    if cells is None:
        return way
    _, cell = np.unique(np.floor(start * cells), axis=0, return_inverse=True)
    sizes = np.bincount(cell)
    mean = np.zeros((*way.shape[:-2], len(sizes), way.shape[-1]))
    np.add.at(mean.swapaxes(0, -2), cell, way.swapaxes(0, -2))
    return np.asarray((mean / sizes[:, None])[..., cell, :])


def loss(way: Floats, other: Floats) -> float:
    """Return the share of the squared paths that is left out."""
    return float(((way - other) ** 2).sum() / (way**2).sum())


@dataclasses.dataclass(frozen=True)
class Ends:
    """A method that leads each particle to a place (N, D)."""

    places: Floats
    name = "ends"

    def plan(self, _simulator: Simulator, task: Task) -> Tracked:
        """Return the law of learned plans towards the places."""
        cloud = task.goal.cloud
        group = balanced_clusters(cloud.x, min(GROUPS, len(cloud.x)), seed=0).astype(np.uint32)
        finer = dataclasses.replace(task, resolution=FINER * task.resolution)
        return finer.tracked(Paths.straight(cloud, self.places, group))


def error(case: ReversedCase, method: str | Ends) -> float:
    """Return the final grid RMSE under a method."""
    result = follow(case.simulator(), case.sketch, method, frames=case.frames, cap=CAP).run()
    return case.error(result.positions[-1])


def judged(case: ReversedCase) -> dict[str, float]:
    """Return all figures of a case."""
    way = case.truth.astype(np.float64) - case.truth[0]
    start, end = case.truth[0].astype(np.float64), case.target.astype(np.float64)
    found = {}
    for cells in (None, *CELLS):
        label = "each particle" if cells is None else f"cells of 1/{cells} m"
        for count in COEFFICIENTS:
            found[f"{label}, K = {count}"] = loss(way, of_cells(kept(way, count), start, cells))
        found[f"{label}: error"] = error(case, Ends(start + of_cells(end - start, start, cells)))
    return found | {"constant: error": error(case, "constant")}


def table(names: Sequence[str], seeds: Sequence[int]) -> list[str]:
    """Return the rows of the table, means over seeds."""
    found = {
        name: [judged(reversed_from_seed(name, seed, start="live", kind="oval")) for seed in seeds]
        for name in names
    }
    lines = ["| | " + " | ".join(names) + " |", "|---" * (len(names) + 1) + "|"]
    for row in found[names[0]][0]:
        means = [np.mean([one[row] for one in found[name]]) for name in names]
        lines.append(f"| {row} | " + " | ".join(f"{mean:.4f}" for mean in means) + " |")
    return lines


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--scenario", nargs="+", default=["water_2d", "sand_2d", "water_3d", "sand_3d"])
    parser.add_argument("--seeds", nargs=2, type=int, default=SEEDS, metavar=("FIRST", "END"))
    asked = parser.parse_args()
    print("\n".join(table(asked.scenario, range(*asked.seeds))))  # noqa: T201 - that is what it is for
