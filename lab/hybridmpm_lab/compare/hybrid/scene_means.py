"""Means over the scenes of `python -m hybridmpm_lab hybrid`, and what holds in nine scenes of ten."""

from collections.abc import Iterator, Sequence

import numpy as np

from hybridmpm_lab.compare.accuracy.conventions import AT
from hybridmpm_lab.harness.rows import Row, significant

HYBRID, FREE_FALL, MPM = "hybrid", "free-fall", "mpm"
"""Methods that others are compared with: the hybrid, the same with free fall in the network's place, and MPM
with as few particles."""
KEY = ("scenario", "seed", "method", "show_all")
"""Fields that tell runs apart."""
PROMISED = 0.9
"""Share of the scenes that a promise is about."""
_MEANS = ("network", "free_fall", "rest", "mpm", "contact", "ms_per_frame", "error", "nrmse")


def means(rows: Sequence[Row]) -> Iterator[Row]:
    """Yield a row for each scenario, and one for all, of each method and `show_all`.

    `ratio` is the mean of the error over that of MPM on the same scene, `ratio_se` its standard error,
    `worst` the largest. `to_free_fall` is the mean of the error over that of the hybrid with free fall in the
    network's place. `nrmse_var` is the variance of the `nrmse` of single scenes. `kinetic_met` is the share
    of the scenes at rest whose kinetic energy at the end is at most twice the truth's, or 1e-4 of the energy
    of the fall; None where no scene is at rest.
    """
    runs = {tuple(row[name] for name in KEY): row for row in rows}
    groups: dict[tuple[str, bool], list[Row]] = {}
    for row in rows:
        groups.setdefault((row["method"], row["show_all"]), []).append(row)
    for (method, carry), mine in groups.items():
        for scenario in (*dict.fromkeys(row["scenario"] for row in mine), "all"):
            chosen = [row for row in mine if scenario in (row["scenario"], "all")]
            yield {"part": "mean", "scenario": scenario, "method": method, "show_all": carry} | _mean(
                chosen, runs
            )


def _mean(chosen: Sequence[Row], runs: dict[tuple[object, ...], Row]) -> Row:
    ratios = _over(chosen, runs, MPM, "error")
    fallen = _over(chosen, runs, FREE_FALL, "error")
    at_rest = [row for row in chosen if row["calm"] < row["frames"] and row["kinetic"] is not None]
    met = [row["kinetic"] <= max(2 * row["kinetic_true"], 1e-4) for row in at_rest]
    known = {name: [row[name] for row in chosen if row[name] is not None] for name in _MEANS}
    return {
        "scenes": len(chosen),
        **{name: significant(float(np.mean(values))) if values else None for name, values in known.items()},
        "nrmse_var": significant(float(np.var(known["nrmse"], ddof=1))) if len(known["nrmse"]) > 1 else None,
        "ratio": significant(float(np.mean(ratios))) if ratios else None,
        "ratio_se": significant(_standard_error(ratios)),
        "worst": significant(max(ratios)) if ratios else None,
        "to_free_fall": significant(float(np.mean(fallen))) if fallen else None,
        "to_free_fall_se": significant(_standard_error(fallen)),
        "kinetic_met": significant(float(np.mean(met))) if met else None,
        "failed": sum(row["error"] is None for row in chosen),
    }


def _standard_error(values: Sequence[float]) -> float | None:
    return float(np.std(values, ddof=1) / np.sqrt(len(values))) if len(values) > 1 else None


def _over(chosen: Sequence[Row], runs: dict[tuple[object, ...], Row], other: str, field: str) -> list[float]:
    """Return the values of a field over those of another method on the same scenes, where both are known."""
    pairs = (
        (row[field], runs.get((row["scenario"], row["seed"], other, row["show_all"]), {}).get(field))
        for row in chosen
    )
    return [one / two for one, two in pairs if one is not None and two is not None]


def promises(rows: Sequence[Row]) -> Iterator[Row]:
    """Yield what holds in 90 % of the scenes, and whether it held in others.

    For each dimension and material, and 40, 100 and 200 frames after the first impact: `bound` is the
    smallest number such that in scenes like those with even seeds the error of the hybrid is at most so many
    times MPM's with a probability of 90 % (split conformal prediction; Vovk et al. 2005); None where there
    are too few. `held` is the share of the scenes with odd seeds in which it was.
    """
    runs = {tuple(row[name] for name in KEY): row for row in rows}
    hybrids = [row for row in rows if row["method"] == HYBRID]
    groups: dict[tuple[str, bool], list[Row]] = {}
    for row in hybrids:
        groups.setdefault((_material(row["scenario"]), row["show_all"]), []).append(row)
    for (material, carry), mine in groups.items():
        for after in AT:
            halves = [[row for row in mine if row["seed"] % 2 == half] for half in (0, 1)]
            known, fresh = (_over(half, runs, MPM, f"error_{after}") for half in halves)
            rank = int(np.ceil(PROMISED * (len(known) + 1)))
            bound = sorted(known)[rank - 1] if rank <= len(known) else None
            held = None if bound is None or not fresh else float(np.mean(np.array(fresh) <= bound))
            yield {
                "part": "promise",
                "scenario": material,
                "show_all": carry,
                "after": after,
                "bound": significant(bound),
                "held": significant(held),
                "calibrated_on": len(known),
                "tested_on": len(fresh),
            }


def _material(scenario: str) -> str:
    """Return what a scenario's particles are made of, with its dimension: water_ramps_2d is water_2d."""
    return scenario.replace("_ramps", "")
