"""Hybrids beside MPM with as few particles: shares of the frames, and ratios of the errors."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np

from hybridmpm import metrics, scenarios
from hybridmpm._support import charts
from hybridmpm.physics.manifest import default_model, models
from hybridmpm_lab.compare import methods
from hybridmpm_lab.compare.comparison import ORIGIN, Case, ComparisonSettings, mean, samples, seeds
from hybridmpm_lab.compare.truth import reference_scene
from hybridmpm_lab.harness.rows import AT, FIRST_SEED, Row, significant
from hybridmpm_lab.harness.settings import setting
from hybridmpm_lab.harness.store import RowStore

FRAMES = 400
"""Frames of each scene."""
HELD_IN = 0.9
"""Share of the scenes in which a bound is to hold."""


@dataclass(frozen=True, kw_only=True)
class HybridSettings(ComparisonSettings):
    """Settings of the comparison of hybrids with MPM."""

    scenes: int = setting(20, "Number of scenes of each scenario.", low=1, high=100_000)
    bounded: int = setting(
        0, "Number of scenes of each scenario that bounds are taken from, if more.", low=0, high=100_000
    )
    first: int = setting(FIRST_SEED, "Seed of the first scene.", low=0)

    def shared(self) -> Row:
        """Return the settings that runs must share to stand in one table."""
        return {"frames": FRAMES, "threads": self.threads}


def cases(settings: HybridSettings) -> list[Case]:
    """Return a case for each scenario, and one for its further scenes that bounds alone are taken from."""
    found = []
    for name in settings.scenario:
        model = default_model(name)
        entry = models()[model]
        few = f"unfitted {methods.ratio_label(entry.r_p)}"
        known = methods.planned(name)
        main = [known[f"hybrid {model}"], known[f"coarse {few}"]]
        others = [
            methods.free_fall(entry.r_p, entry.r_t, is_guarded=True),
            methods.other_mpm(f"{few}, other jitter", entry.r_p),
            known[f"neural {model} all shown"],
        ]
        all_seeds = seeds(max(settings.scenes, settings.bounded), settings.first)
        for mine, some in (
            ([*main, *others], all_seeds[: settings.scenes]),
            (main, all_seeds[settings.scenes :]),
        ):
            if some:
                found.append(
                    Case(
                        head={"scenario": name},
                        scene=partial(scenarios.get, name),
                        timed=partial(reference_scene, name),
                        methods=methods.matching(mine, settings.method),
                        seeds=some,
                        until=FRAMES,
                        is_full=False,
                        threads=settings.threads,
                    )
                )
    return found


def table(found: Sequence[Case], store: RowStore) -> list[Row]:
    """Return a row of the part "mean" for each method of each scenario, then rows of the part "bound".

    `mpm_share`, `network`, `free_fall` and `rest` are shares of all frames, `contact` that of the network in
    contact; see `truth.shares`. `error` is the mean of `grid_rmse` from the first impact on, `ratio` its mean
    ratio to the error of MPM with as few particles on the same scene, `worst` the largest of these ratios. A
    last scenario "all" has the means over all scenes.
    """
    runs = [
        (name, one, case, samples(case, name, store)) for case in found for name, one in case.methods.items()
    ]
    base = {
        (case.key, seed): row
        for _, one, case, rows in runs
        if one.method == "coarse" and "jitter" not in one.label
        for seed, row in rows.items()
    }
    widest = max((len(case.methods) for case in found), default=0)
    groups: dict[tuple[str, str, str], list[tuple[Row, Row | None]]] = {}
    hybrids: dict[str, dict[int, list[tuple[Row, Row | None]]]] = {}
    for _, one, case, rows in runs:
        for seed, row in rows.items():
            pair = (row, base.get((case.key, seed)))
            label = one.label if one.method != "neural" and one.label == "free fall" else _plain(one.label)
            if len(case.methods) == widest:
                for scenario in (case.head["scenario"], "all"):
                    groups.setdefault((scenario, one.method, label), []).append(pair)
            if one.method == "hybrid" and label != "free fall":
                material = str(case.head["scenario"]).replace("_ramps", "")
                hybrids.setdefault(material, {}).setdefault(seed % 2, []).append(pair)
    ordered = sorted(groups.items(), key=lambda item: item[0][0] == "all")
    means = [_mean_row(*key, pairs) for key, pairs in ordered]
    return [*means, *(row for name, halves in hybrids.items() for row in _bounds(name, halves))]


def _plain(label: str) -> str:
    """Return a label without the name of the network, which differs by dimension."""
    return " ".join(word for word in label.split() if word not in models()) or "network"


def _mean_row(scenario: str, method: str, label: str, pairs: Sequence[tuple[Row, Row | None]]) -> Row:
    rows = [row for row, _ in pairs]
    ratios = _ratios(pairs, "error")
    spread = metrics.Estimate.of(ratios) if ratios else None
    fields = ("mpm_share", "network", "free_fall", "rest", "contact", "error", "grid_nrmse")
    return {
        "part": "mean",
        "scenario": scenario,
        "method": method,
        "label": label,
        "scenes": len(rows),
        "failed": sum(bool(row["failed"]) for row in rows),
        **{name: mean(rows, name) for name in fields},
        "ratio": significant(spread.mean if spread else None),
        "ratio_se": significant(spread.standard_error if spread else None),
        "worst": significant(max(ratios)) if ratios else None,
        **{name: rows[0].get(name) for name in ORIGIN},
    }


def _ratios(pairs: Sequence[tuple[Row, Row | None]], name: str) -> list[float]:
    return [
        row[name] / base[name]
        for row, base in pairs
        if base is not None and row.get(name) is not None and base.get(name) is not None
    ]


def _bounds(material: str, halves: Mapping[int, Sequence[tuple[Row, Row | None]]]) -> Iterator[Row]:
    """Yield bounds of the ratio that hold in 90 % of the scenes, and the share of others in which they held.

    `bound` is the smallest number such that in scenes like those with even seeds the hybrid's error is at
    most so many times MPM's with a probability of 90 % (split conformal prediction; Vovk et al. 2005); None
    where there are too few. `held` is the share of the scenes with odd seeds in which it was.
    """
    for after in AT:
        known, fresh = (_ratios(halves.get(half, ()), f"error_{after}") for half in (0, 1))
        rank = int(np.ceil(HELD_IN * (len(known) + 1)))
        bound = sorted(known)[rank - 1] if rank <= len(known) else None
        held = None if bound is None or not fresh else float(np.mean(np.array(fresh) <= bound))
        origin = next(iter(halves.values()))[0][0]
        yield {
            "part": "bound",
            "scenario": material,
            "method": "hybrid",
            "after": after,
            "bound": significant(bound),
            "held": significant(held),
            "calibrated_on": len(known),
            "tested_on": len(fresh),
            **{name: origin.get(name) for name in ORIGIN},
        }


def chart(rows: Sequence[Row], file: Path) -> None:
    """Draw the shares of the frames by source, and the errors over MPM's; raises as `charts` does."""
    means = [row for row in rows if row["part"] == "mean"]
    names = list(dict.fromkeys(row["scenario"] for row in means))
    figure, axes = charts.panels(2, 1, width=5.6, height=4.0)
    left, right = axes[0]
    sources = {"network": "network", "free_fall": "free fall", "rest": "rest", "mpm_share": "MPM"}
    hybrids = [row for row in means if (row["method"], row["label"]) == ("hybrid", "network")]
    starts = [0.0] * len(hybrids)
    for (name, label), colour in zip(sources.items(), (*charts.COLOURS[:5:2], "0.85"), strict=True):
        widths = [100 * row[name] for row in hybrids]
        left.barh(range(len(hybrids)), widths, left=starts, color=colour, label=label, height=0.7)
        starts = [one + two for one, two in zip(starts, widths, strict=True)]
    left.set(xlabel="share of the frames [%]", xlim=(0, 100))
    kinds = [
        key for key in dict.fromkeys((row["method"], row["label"]) for row in means) if key[0] != "neural"
    ]
    for place, key in enumerate(kinds):
        mine = [row for row in means if (row["method"], row["label"]) == key and row["ratio"] is not None]
        right.errorbar(
            [row["ratio"] for row in mine],
            [names.index(row["scenario"]) + 0.2 * (place - 1) for row in mine],
            xerr=[[0.0] * len(mine), [row["worst"] - row["ratio"] for row in mine]],
            marker=charts.MARKERS[place],
            linestyle="none",
            label=" ".join(key),
        )
    right.axvline(1.0, color="0.4", linewidth=0.8)
    right.set(xlabel="error over MPM's: mean, and line to the worst scene")
    for panel in (left, right):
        panel.set_yticks(range(len(names)), names)
        panel.invert_yaxis()
        panel.legend(loc="upper center", bbox_to_anchor=(0.5, -0.16), ncols=2, frameon=False)
    charts.save(figure, file)
