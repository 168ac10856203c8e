"""From single runs to the table of the crossing: who is as good, and how much quicker a network has to be."""

from collections.abc import Iterator

import numpy as np

from hybridmpm_lab.compare.crossing.cases import Case, CrossingSettings, cases
from hybridmpm_lab.compare.crossing.entrants import Entrant, entrants, networks
from hybridmpm_lab.compare.crossing.measure import ALONE, ERRORS, TIMES, particles_of
from hybridmpm_lab.compare.tradeoff.times import FIELDS
from hybridmpm_lab.harness.pareto import cheapest_as_good
from hybridmpm_lab.harness.rows import Row, significant
from hybridmpm_lab.harness.store import RowStore

LEARNED = ("neural", "hybrid")
"""Methods that have to be quicker than MPM of equal error."""
LATENCY_ALONE = "latency alone"
"""Variant of a network that would have to be trained for a case: it has no error of its own."""
_ORIGIN = ("machine", "date", "commit", "command")


def table(settings: CrossingSettings, runs: RowStore) -> list[Row]:
    """Return a row for each method of each case of which there is a run.

    `error` is the mean over the scenes of the mean `grid_rmse` at every tenth of the `span` frames from the
    first impact on, or from the end of the longest warm-up of the scenario's networks, `error_se` its
    standard error, None from one scene; `transport` [m] is the sliced distance of transport, a mean of 40,
    100 and 200 frames after the start. Times are those of the first scene, each frame looked at.

    Of learned methods `refused` tells whether the library refuses the case. `as_good` is the cheapest MPM,
    carrying or not, that errs no more, `as_good_ms` its time: below it the method would pay. `times_slower`
    is the method's time over that. A network of the variant "latency alone" simulates the share of the
    particles that it was trained with, so it would have to be trained anew; it is held against the coarse level that
    errs no more than the same network does on its own scenes, and `error` is None.
    """
    return [row for case in cases(settings) for row in _of_case(case, settings, runs)]


def _of_case(case: Case, settings: CrossingSettings, runs: RowStore) -> Iterator[Row]:
    particles = particles_of(case)
    rows = [
        row
        for one in entrants(case, settings, particles).values()
        if (row := _row(one, case, particles, settings, runs)) is not None
    ]
    alone = [_alone(case, particles, name, runs) for name in networks(case) if case.finer != 1]
    levels = [row for row in rows if row["method"] not in LEARNED]
    own = Case(scenario=case.scenario, resolution=round(case.resolution / case.finer))
    for row in [*rows, *(one for one in alone if one is not None)]:
        bar = row
        if row["variant"] == LATENCY_ALONE:
            mine = _samples(own, f"neural {row['label']}", settings, runs)
            bar = row | {"error": _mean(mine, "error")}
        level = cheapest_as_good(bar, levels) if row["method"] in LEARNED else None
        pays_below = level and level["ms_per_frame"]
        slower = row["ms_per_frame"] / pays_below if level and row["ms_per_frame"] else None
        name = level and f"{level['method']} {level['label']}"
        yield row | {"as_good": name, "as_good_ms": pays_below, "times_slower": significant(slower)}


def _samples(case: Case, name: str, settings: CrossingSettings, runs: RowStore) -> list[Row]:
    keys = ((ERRORS, *case.key, seed, name) for seed, _ in case.scenes(settings))
    return [runs[key] for key in keys if key in runs]


def _row(one: Entrant, case: Case, particles: int, settings: CrossingSettings, runs: RowStore) -> Row | None:
    samples = _samples(case, one.name, settings, runs)
    key = (TIMES, *case.key, one.name)
    time = runs[key] if key in runs else {}
    if not samples and not time:
        return None
    first = samples[0] if samples else time
    return (
        _head(case, particles)
        | {
            "method": one.method,
            "label": one.label,
            "variant": None,
            "r_p": significant(one.r_p),
            "refused": one.method in LEARNED and not case.is_trained,
            "scenes": len(samples),
            "failed": sum(bool(row["failed"]) for row in samples),
            "warned": sum(bool(row["warned"]) for row in samples),
        }
        | {field: _mean(samples, field) for field in ("simulated", "error", "transport")}
        | {"error_se": _standard_error(samples)}
        | {field: time.get(field) for field in FIELDS}
        | {field: first.get(field) for field in _ORIGIN}
        | {"timed_date": time.get("date"), "timed_commit": time.get("commit")}
    )


def _alone(case: Case, particles: int, name: str, runs: RowStore) -> Row | None:
    key = (ALONE, *case.key, name)
    if key not in runs:
        return None
    time = runs[key]
    none = dict.fromkeys(("r_p", "simulated", "error", "error_se", "transport", *FIELDS))
    return (
        _head(case, particles)
        | none
        | {"method": "neural", "label": name, "variant": LATENCY_ALONE, "refused": True}
        | {"scenes": 0, "failed": 0, "warned": 0, "ms_per_frame": time["ms_per_frame"]}
        | {field: time.get(field) for field in _ORIGIN}
        | {"timed_date": time.get("date"), "timed_commit": time.get("commit")}
    )


def _head(case: Case, particles: int) -> Row:
    return {
        "scenario": case.scenario,
        "resolution": case.resolution,
        "compression": case.compression,
        "particles": particles,
    }


def _mean(samples: list[Row], field: str) -> float | None:
    """Return the mean of a field; None without samples, or where one of them failed."""
    if not samples or any(row["failed"] for row in samples) or field not in samples[0]:
        return None
    return significant(float(np.mean([row[field] for row in samples])))


def _standard_error(samples: list[Row]) -> float | None:
    if len(samples) < 2 or any(row["failed"] for row in samples):
        return None
    spread = float(np.std([row["error"] for row in samples], ddof=1))
    return significant(spread / len(samples) ** 0.5)
