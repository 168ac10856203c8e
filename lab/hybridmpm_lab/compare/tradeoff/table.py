"""From single runs to the table of the chart: means, paired differences, fronts, and who dominates whom."""

from collections.abc import Mapping, Sequence

import numpy as np

from hybridmpm import metrics
from hybridmpm_lab.compare.accuracy.conventions import LADDER
from hybridmpm_lab.compare.tradeoff import errors, times
from hybridmpm_lab.compare.tradeoff.entrants import entrants
from hybridmpm_lab.compare.tradeoff.measures import FRONTS, MEASURES
from hybridmpm_lab.compare.tradeoff.settings import PAPER, PAPER_PART, TradeoffSettings, warm_up
from hybridmpm_lab.harness.pareto import cheapest_as_good, dominating
from hybridmpm_lab.harness.rows import Row, significant
from hybridmpm_lab.harness.store import RowStore

BOUNDS = (errors.JITTER, errors.STILL, errors.MERGED)
"""Methods that are floors and ceilings: nobody can run them."""
_RIVALS = ("mpm", "coarse")
"""Methods that a learned one has to beat."""
_ORIGIN = ("machine", "date", "commit", "command")


def table(settings: TradeoffSettings, runs: RowStore) -> list[Row]:
    """Return a row for each method of each scenario of which there is at least one run.

    `error` is the mean of `grid_rmse` over every tenth state of the `span` frames after `start`, `error_40`
    that of one frame; see `measures.errors` for the others. Each is a mean over the scenes, with its standard
    error in `..._se`; all are None where the method failed in a scene. `mpm_share` is the share of the
    counted frames that MPM simulated.

    `ms_per_frame` and `ms_p95` are median and 95th percentile over pieces of 8 frames of the scenario's
    reference scene, each frame looked at, so that carrying and interpolation count; `ms_mean` is their mean,
    `ms_frame_p95` the 95th percentile of single frames. Of a peer the quickest `setting` counts, and nobody
    looks at it. The paper's networks have a latency alone: median and 95th percentile of single steps, by
    frame.

    `on_front` tells whether no other is both quicker and better by `error`, `on_front_transport` the same by
    `transport`, and so on. `dominated_by` is the quickest that is neither slower nor worse by `error`,
    `minus_dominator` the mean difference to it on the same scenes. `as_good` is the quickest MPM, carrying or
    not, with at most the row's error, `as_good_ms` the latency below which the row's method would pay, and
    `minus_as_good` the difference of the errors on the same scenes.
    """
    rows: list[Row] = []
    for scenario in settings.scenarios:
        rows += _of_scenario(scenario, settings, runs)
    return rows


def _of_scenario(scenario: str, settings: TradeoffSettings, runs: RowStore) -> list[Row]:
    samples: dict[str, dict[int, Row]] = {}
    for name in errors.names(scenario, settings):
        keys = {seed: (errors.PART, scenario, seed, name) for seed in settings.seeds}
        samples[name] = {seed: runs[key] for seed, key in keys.items() if key in runs}
    paper = [f"neural {label}" for label in PAPER]
    names = [name for name in samples if samples[name] or (times.PART, scenario, name) in runs]
    names += [name for name in paper if (PAPER_PART, scenario, name) in runs]
    by_scene = metrics.ErrorTable()
    for name, mine in samples.items():
        if mine and not any(row["failed"] for row in mine.values()):
            for seed, row in mine.items():
                found = {measure: row[measure] for measure in MEASURES if measure in row}
                by_scene.add(name, str(seed), found)
    rows = [_row(name, scenario, samples.get(name, {}), by_scene, runs) for name in names]
    return _compared(rows, by_scene)


def _row(
    name: str,
    scenario: str,
    samples: Mapping[int, Row],
    by_scene: metrics.ErrorTable,
    runs: RowStore,
) -> Row:
    kind, _, label = name.partition(" ")
    entrant = entrants(scenario).get(name)
    time = next(
        (runs[key] for key in ((times.PART, scenario, name), (PAPER_PART, scenario, name)) if key in runs),
        {},
    )
    known = list(samples.values())
    first = known[0] if known else time
    mean = {field: _mean(known, field) for field in ("particles", "mpm_share", "start")}
    estimates = {}
    for measure in MEASURES:
        there = name in by_scene.methods and measure in by_scene.measures
        one = by_scene.estimate(name, measure) if there else None
        estimates[measure] = significant(one.mean if one else None)
        estimates[f"{measure}_se"] = significant(one.standard_error if one else None)
    return {
        "scenario": scenario,
        "method": kind,
        "label": label or None,
        "variant": entrant.variant if entrant else ("untrained" if label in PAPER else None),
        "r_p": None if (r_p := _r_p(name, scenario)) is None else round(r_p, 4),
        "r_t": entrant.r_t if entrant else PAPER[label][1] if label in PAPER else None,
        "r_c": entrant.settings.get("r_c") if entrant else None,
        "setting": time.get("setting"),
        "threads": time.get("threads"),
        "warm_up": warm_up(scenario),
        "scenes": len(known),
        "failed": sum(bool(row["failed"]) for row in known),
        "warned": sum(bool(row.get("warned")) for row in known),
        **mean,
        **{field: time.get(field) for field in times.FIELDS},
        **estimates,
        **{field: first.get(field) for field in _ORIGIN},
        "timed_date": time.get("date"),
        "timed_commit": time.get("commit"),
    }


def _r_p(name: str, scenario: str) -> float | None:
    kind, _, label = name.partition(" ")
    entrant = entrants(scenario).get(name)
    if entrant:
        return entrant.r_p
    if label in PAPER:
        return LADDER[PAPER[label][0]]
    return LADDER[label] if kind == errors.MERGED else 1.0 if kind == errors.PEER else None


def _mean(rows: Sequence[Row], field: str) -> float | None:
    values = [row[field] for row in rows if row.get(field) is not None]
    return significant(float(np.mean(values))) if values else None


def _compared(rows: list[Row], by_scene: metrics.ErrorTable) -> list[Row]:
    """Add to the rows of a scenario who is on which front, and whom each has to be read against."""
    real = [row for row in rows if row["method"] not in BOUNDS]
    rivals = [row for row in real if row["method"] in _RIVALS]
    for row in rows:
        runs_at_all = row["method"] not in BOUNDS
        for measure in FRONTS:
            field = "on_front" if measure == "error" else f"on_front_{measure}"
            row[field] = runs_at_all and on_front(row, real, measure)
        better = dominating(row, real) if runs_at_all else None
        level = cheapest_as_good(row, rivals) if runs_at_all else None
        row["dominated_by"] = better and _name(better)
        row.update(_apart(by_scene, row, better, "minus_dominator"))
        row["as_good"] = level and _name(level)
        row["as_good_ms"] = level and level["ms_per_frame"]
        row.update(_apart(by_scene, row, level, "minus_as_good"))
    return rows


def on_front(row: Row, others: Sequence[Row], measure: str) -> bool:
    """Tell whether a row has time and error, and none of the others is neither slower nor worse.

    Parameters
    ----------
    row : Row
    others : sequence of Row
        Rows of one scenario, the row itself may be among them.
    measure : str
        One of `FRONTS`.
    """
    viewed, all_viewed = _by(row, measure), [_by(other, measure) for other in others]
    return None not in viewed.values() and dominating(viewed, all_viewed) is None


def _by(row: Row, measure: str) -> Row:
    return {"ms_per_frame": row["ms_per_frame"], "error": row[measure]}


def _name(row: Row) -> str:
    return f"{row['method']} {row['label']}"


def _apart(by_scene: metrics.ErrorTable, row: Row, other: Row | None, field: str) -> Row:
    """Return the mean difference of the errors of two rows on the same scenes, and its standard error."""
    apart = None
    if other is not None and other is not row:
        apart = by_scene.difference(_name(row), _name(other), "error")
    return {
        field: significant(apart.mean if apart else None),
        f"{field}_se": significant(apart.standard_error if apart else None),
    }
