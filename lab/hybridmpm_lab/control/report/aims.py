"""What we want of the reversed family, beside what was measured; and the paper's figures beside ours."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from hybridmpm_lab.control.report.means import paired, wins
from hybridmpm_lab.control.suite.cases import SETTINGS, Kind
from hybridmpm_lab.harness.rows import Row, significant


@dataclass(frozen=True, kw_only=True)
class Aim:
    """A bound on the mean final error over that of the constant force, or on the share of seeds won."""

    scenarios: tuple[str, ...]
    sketch: Kind
    method: str
    ratio: float | None = None
    """Largest mean error, over that of the constant force."""
    wins: float | None = None
    """Smallest share of the seeds on which the error is below that of the constant force."""
    one_body: bool = False
    """Whether only scenes of one body count."""


_IN_2D, _IN_3D = SETTINGS[:2], SETTINGS[2:]
AIMS = (
    Aim(scenarios=_IN_2D, sketch="oval", method="analytic", ratio=0.60),
    Aim(scenarios=_IN_2D, sketch="oval", method="analytic", ratio=0.33, one_body=True),
    Aim(scenarios=_IN_2D, sketch="oval", method="analytic", wins=0.95),
    Aim(scenarios=_IN_3D, sketch="oval", method="analytic", ratio=0.65, one_body=True),
    Aim(scenarios=SETTINGS, sketch="arrow", method="analytic", ratio=0.75),
    Aim(scenarios=("water_2d", "water_3d"), sketch="arrow", method="backcast", ratio=0.62),
    Aim(scenarios=_IN_2D, sketch="oval", method="learned", ratio=0.60),
    Aim(scenarios=_IN_2D, sketch="arrow", method="learned", ratio=0.60),
)

PAPER = {
    "water_2d": (0.0908, 0.0802),
    "sand_2d": (0.1151, 0.0924),
    "water_3d": (0.0019, 0.0013),
    "sand_3d": (0.0022, 0.0019),
}
"""Final grid RMSE of arXiv:2505.18926, table control_nrmse: its constant force, its learned controller."""


def compared_with_aims(rows: Sequence[Row]) -> list[Row]:
    """Return a row for each aim and setting that runs exist of.

    `measured` is the ratio of means with its standard error over seeds, or the share of the seeds won.
    """
    found = []
    for aim in AIMS:
        for scenario in aim.scenarios:
            mine = [
                row
                for row in rows
                if row["family"] == "reversed"
                and (row["scenario"], row["sketch"]) == (scenario, aim.sketch)
                and (row["bodies"] == 1 or not aim.one_body)
            ]
            both = paired(mine, aim.method)
            if both:
                found.append(_beside(aim, scenario, mine, both))
    return found


def _beside(aim: Aim, scenario: str, rows: Sequence[Row], both: Sequence[tuple[Row, Row]]) -> Row:
    head = {
        "scenario": scenario,
        "sketch": aim.sketch,
        "bodies": "1" if aim.one_body else "all",
        "method": aim.method,
        "count": len(both),
    }
    if aim.ratio is None:
        share = float(np.mean(wins(rows, aim.method)))
        met = aim.wins is not None and share >= aim.wins
        return head | {"aim": f"wins {aim.wins:g}", "measured": significant(share, 3), "se": None, "met": met}
    mine, constant = (np.array([pair[k]["error"] for pair in both]) for k in (0, 1))
    ratio, error = ratio_of_means(mine, constant)
    return head | {
        "aim": f"ratio {aim.ratio:g}",
        "measured": significant(ratio, 3),
        "se": significant(error, 2),
        "met": ratio <= aim.ratio,
    }


def ratio_of_means(
    mine: np.typing.NDArray[np.float64], others: np.typing.NDArray[np.float64]
) -> tuple[float, float | None]:
    """Return mean(mine) / mean(others) of paired samples (K,), and its standard error to first order."""
    ratio = float(mine.mean() / others.mean())
    if len(mine) < 2:
        return ratio, None
    apart = mine - ratio * others
    return ratio, float(apart.std(ddof=1) / np.sqrt(len(apart)) / others.mean())


def compared_with_paper(means: Sequence[Row]) -> list[Row]:
    """Return the paper's final errors beside ours, for each setting with reversed runs.

    The paper tells the error of its constant force and of its learned controller as mean over its sketches.
    Ours are given in two readings of the formula: `nrmse`, as the paper's labels say, and `node_error`, its
    letter. `best` is the method without knowledge of the truth that has the smallest error.
    """
    found = []
    for scenario, (baseline, learned) in PAPER.items():
        for sketch in ("oval", "arrow"):
            mine = {
                row["method"]: row
                for row in means
                if (row["family"], row["scenario"], row["sketch"]) == ("reversed", scenario, sketch)
                and row["error"] is not None
            }
            rivals = [row for name, row in mine.items() if name not in {"oracle", "filled", "none"}]
            if "constant" not in mine or not rivals:
                continue
            best = min(rivals, key=lambda row: row["error"])
            row: Row = {
                "scenario": scenario,
                "sketch": sketch,
                "paper_baseline": baseline,
                "paper_learned": learned,
                "paper_ratio": significant(learned / baseline, 3),
                "best": best["method"],
            }
            for measure in ("nrmse", "node_error", "error"):
                ours = mine["constant"][measure], best[measure]
                row |= {
                    f"{measure}_constant": ours[0],
                    f"{measure}_best": ours[1],
                    f"{measure}_ratio": significant(ours[1] / ours[0], 3),
                }
            found.append(row)
    return found
