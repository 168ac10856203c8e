"""Hybrids beside MPM with as few particles: shares of the frames, and ratios of the errors."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np

from hybridmpm import scenarios
from hybridmpm.physics.manifest import default_model, models
from hybridmpm_lab.compare import comparison, methods
from hybridmpm_lab.compare.comparison import (
    Case,
    ComparisonSettings,
    comparison_command,
    ratios,
    samples,
    seeds,
)
from hybridmpm_lab.compare.truth import SHARES, reference_scene
from hybridmpm_lab.harness import charts
from hybridmpm_lab.harness.command import setting
from hybridmpm_lab.harness.provenance import ORIGIN
from hybridmpm_lab.harness.rows import AT, FIRST_SEED, Row, RowStore, significant

FRAMES = 400
"""Frames of each scene."""
HELD_IN = 0.9
"""Share of the scenes in which a bound is to hold."""
_COLUMNS = (
    "part", "scenario", "method", "label", "scenes", "mpm_share", "network", "free_fall", "rest", "contact",
    "ratio", "ratio_se", "worst",
)  # fmt: skip


@dataclass(frozen=True, kw_only=True)
class HybridSettings(ComparisonSettings):
    """Settings of the comparison of hybrids with MPM."""

    scenes: int = setting(20, "Number of scenes of each scenario.", low=1, high=100_000)
    bounded: int = setting(0, "Number of scenes that bounds are taken from, if more.", low=0, high=100_000)
    first: int = setting(FIRST_SEED, "Seed of the first scene.", low=0)


def cases(settings: HybridSettings) -> list[Case]:
    """Return a case for each scenario, and one for its further scenes that bounds alone are taken from."""
    found = []
    all_seeds = seeds(max(settings.scenes, settings.bounded), settings.first)
    for name in settings.scenario:
        model = default_model(name)
        entry, known = models()[model], methods.planned(name)
        base = f"coarse unfitted {methods.ratio_label(entry.r_p)}"
        main = [known[f"hybrid {model}"], known[base]]
        others = [
            methods.free_fall(entry.r_p, entry.r_t, is_guarded=True),
            methods.other_mpm(f"{known[base].label}, other jitter", entry.r_p),
            known[f"neural {model} all shown"],
        ]
        made = partial(
            Case,
            scene=partial(scenarios.get, name),
            timed=partial(reference_scene, name),
            base=base,
            until=FRAMES,
            is_full=False,
            threads=settings.threads,
        )
        some = methods.matching([*main, *others], settings.method)
        first, more = all_seeds[: settings.scenes], all_seeds[settings.scenes :]
        found.append(made(head={"part": "mean", "scenario": name}, methods=some, seeds=first))
        if more:
            some = {one.name: one for one in main}
            found.append(made(head={"part": "bound", "scenario": name}, methods=some, seeds=more))
    return found


def table(found: Sequence[Case], store: RowStore) -> list[Row]:
    """Return the rows of `comparison.table` as the part "mean", then rows of the part "bound".

    A last scenario "all" has the means over all scenarios. `mpm_share`, `network`, `free_fall` and `rest` are
    shares of all frames, `contact` that of the network in contact; see `truth.shares`.
    """
    rows = comparison.table([case for case in found if case.head["part"] == "mean"], store)
    groups: dict[tuple[str, str], list[Row]] = {}
    for row in rows:
        label = " ".join(word for word in row["label"].split() if word not in models())
        groups.setdefault((row["method"], label or "network"), []).append(row)
    every = [_over_scenarios(method, label, mine) for (method, label), mine in groups.items()]
    hybrids: dict[str, list[Case]] = {}
    for case in found:
        hybrids.setdefault(str(case.head["scenario"]).replace("_ramps", ""), []).append(case)
    return [*rows, *every, *(row for name, mine in hybrids.items() for row in _bounds(name, mine, store))]


def _over_scenarios(method: str, label: str, rows: Sequence[Row]) -> Row:
    spreads = [row["ratio_se"] for row in rows if row["ratio_se"] is not None]
    worst = [row["worst"] for row in rows if row["worst"] is not None]
    sums = {name: sum(row[name] for row in rows) for name in ("scenes", "failed")}
    means = {name: comparison.mean(rows, name) for name in (*SHARES, "error", "ratio")}
    spread = significant(float(np.sqrt(np.sum(np.square(spreads)))) / len(rows)) if spreads else None
    names = {"part": "mean", "scenario": "all", "method": method, "label": label}
    more = {"ratio_se": spread, "worst": max(worst, default=None)}
    return names | sums | means | more | {name: rows[0].get(name) for name in ORIGIN}


def _bounds(material: str, found: Sequence[Case], store: RowStore) -> Iterator[Row]:
    """Yield bounds of the ratio that hold in 90 % of the scenes, and the share of others in which they held.

    `bound` is the smallest number such that in scenes like those with even seeds the hybrid's error is at
    most so many times MPM's with a probability of 90 % (split conformal prediction; Vovk et al. 2005); None
    where there are too few. `held` is the share of the scenes with odd seeds in which it was.
    """
    of_first = (row for name in found[0].methods for row in samples(found[0], name, store).values())
    origin: Row = next(of_first, {})
    for after in AT:
        by_seed = [
            (seed, ratio)
            for case in found
            for name in case.methods
            if name.startswith("hybrid") and name != "hybrid free fall"
            for seed, ratio in ratios(case, name, store, f"error_{after}").items()
        ]
        known, fresh = ([ratio for seed, ratio in by_seed if seed % 2 == half] for half in (0, 1))
        yield {
            "part": "bound",
            "scenario": material,
            "method": "hybrid",
            "after": after,
            **bound(known, fresh),
            **{name: origin.get(name) for name in ORIGIN},
        }


def bound(known: Sequence[float], fresh: Sequence[float]) -> Row:
    """Return the bound of ratios, the share of other ratios below it, and both numbers; see `_bounds`."""
    rank = int(np.ceil(HELD_IN * (len(known) + 1)))
    limit = sorted(known)[rank - 1] if rank <= len(known) else None
    held = None if limit is None or not fresh else float(np.mean(np.array(fresh) <= limit))
    counts = {"calibrated_on": len(known), "tested_on": len(fresh)}
    return {"bound": significant(limit), "held": significant(held)} | counts


def chart(rows: Sequence[Row], file: Path) -> None:
    """Draw the shares of the frames by source, and the ratio of the errors; raises as `charts` does."""
    mine = [row for row in rows if row["part"] == "mean" and row["method"] == "hybrid"]
    mine = [row for row in mine if row["label"] != "free fall"]
    figure, axes = charts.panels(2, 1, width=5.6, height=4.0)
    left, right = axes[0]
    places, starts = range(len(mine)), [0.0] * len(mine)
    sources = {"network": "network", "free_fall": "free fall", "rest": "rest", "mpm_share": "MPM"}
    for (name, label), colour in zip(sources.items(), (*charts.COLOURS[:5:2], "0.85"), strict=True):
        widths = [100 * row[name] for row in mine]
        left.barh(places, widths, left=starts, color=colour, label=label, height=0.7)
        starts = [one + two for one, two in zip(starts, widths, strict=True)]
    left.set(xlabel="share of the frames [%]", xlim=(0, 100))
    left.legend(loc="upper center", bbox_to_anchor=(0.5, -0.16), ncols=4, frameon=False)
    to_worst = [[0.0] * len(mine), [row["worst"] - row["ratio"] for row in mine]]
    right.errorbar([row["ratio"] for row in mine], places, xerr=to_worst, marker="o", linestyle="none")
    right.axvline(1.0, color="0.4", linewidth=0.8)
    right.set(xlabel="error over that of MPM: mean, and line to the worst scene")
    for panel in (left, right):
        panel.set_yticks(places, [row["scenario"] for row in mine])
        panel.invert_yaxis()
    charts.save(figure, file)


hybrid = comparison_command(
    name="hybrid",
    settings=HybridSettings,
    cases=cases,
    summary="""Measure the share of the frames that a hybrid's network simulates, and its error over MPM's.

    MPM has as few particles. Rows of the part "bound" are ratios that are not exceeded in 90 % of the scenes,
    and the share of other scenes in which that held.
    """,
    columns=_COLUMNS,
    tabulated=table,
    draw=chart,
    is_timed=False,
)
