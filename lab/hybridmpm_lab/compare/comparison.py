"""The comparison of methods on scenes: errors scene by scene, times by turns, and the table of both."""

import time
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from contextlib import ExitStack
from dataclasses import dataclass
from functools import partial
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import click
import numpy as np

from hybridmpm import metrics
from hybridmpm._support.machine import usable_cores
from hybridmpm.cli.progress import progress
from hybridmpm.coarse import CoarseSimulator
from hybridmpm.errors import ConfigError, SimulationError
from hybridmpm.mpm import MpmSolver
from hybridmpm.planner.calibrating.impact import first_frame
from hybridmpm.planner.candidates import RATIOS
from hybridmpm.scene import Scene
from hybridmpm_lab.compare import chart, peers
from hybridmpm_lab.compare.methods import Method
from hybridmpm_lab.compare.truth import MEASURES, SHARES, Truth, errors, grid_errors, shares
from hybridmpm_lab.harness.command import Measurement, number_option, runs_option, scenarios_setting, setting
from hybridmpm_lab.harness.provenance import ORIGIN, Provenance
from hybridmpm_lab.harness.rows import (
    FIRST_SEED,
    Key,
    Progress,
    Row,
    RowStore,
    dominating,
    equal_error,
    is_on_front,
    mean_fields,
    row_name,
    significant,
)
from hybridmpm_lab.harness.timing import QUIET, Calibration, TimedCall, seconds_by_turns
from hybridmpm_lab.speed.baselines import baseline_process, require_installed

FIELDS = ("ms_per_frame", "ms_p95", "slowdown")
"""Fields of a row about its time."""
PIECE = 8
"""Frames of a piece: two updates of the shown particles, and one or two steps of each shipped network."""
_APART = 2 * PIECE
"""Frames from the start of a piece to that of the next."""
BOUNDS = ("jitter", "still", *(f"merged {label}" for label, r_p in RATIOS.items() if r_p < 1))
"""Floors and ceiling of the error, which nobody can run: the truth with other jitter, the initial state held,
the truth merged state by state."""
RIVALS = ("mpm", "coarse")
"""Methods that a learned one has to beat."""
FRONTS = ("error", "transport")
"""Errors by which rows have a Pareto front."""
_COLUMNS = (
    "scenario", "method", "label", "ms_per_frame", "ms_p95", "error", "error_se", "error_40", "error_100",
    "error_200", "transport", "mpm_share", "failed", "on_front", "dominated_by", "equal_mpm_ms",
)  # fmt: skip
_OPTIONS = (
    runs_option,
    number_option("--jobs", 1, 1024, usable_cores(), "Processes for the errors; times are taken by one."),
    number_option("--passes", 1, 1000, 9, "Timings of each piece; their lower quartile counts."),
    click.Option(
        ["--only"],
        type=click.Choice(["errors", "times", "table"]),
        help="Do this part alone. Errors may be measured on a busy machine, times need an idle one; the "
        "table is made of the rows in the file of --runs.",
    ),
)


@dataclass(frozen=True, kw_only=True)
class ComparisonSettings:
    """Scenes, length and methods of a comparison; the defaults are those of docs/results."""

    scenario: tuple[str, ...] = scenarios_setting()
    scenes: int = setting(10, "Number of held-out scenes of each scenario.", low=1, high=1000)
    span: int = setting(200, "Number of frames that count, and are timed.", low=40, high=10_000)
    threads: int = setting(1, "Number of threads of every simulator of ours.", low=1, high=1024)
    method: tuple[str, ...] = setting(
        (), "Measure only methods whose name matches this pattern, such as 'coarse 1/*' or 'mpm 1'.", str
    )

    def shared(self) -> Row:
        """Return the settings that runs must share to stand in one table."""
        return {"first_seed": FIRST_SEED, "span": self.span, "threads": self.threads}


@dataclass(frozen=True, kw_only=True)
class Case:
    """Scenes, and the methods that are compared on them."""

    head: Row
    """First fields of the rows, which tell cases apart."""
    scene: Callable[[int], Scene]
    """Function of a seed."""
    timed: Callable[[], Scene]
    """Function that returns the scene on which times are taken."""
    methods: dict[str, Method]
    """Methods by name."""
    bounds: tuple[str, ...] = ()
    """Some of `BOUNDS`."""
    seeds: tuple[int, ...]
    """Seeds of the scenes."""
    warm_up: int = 0
    """Frame before which no errors count."""
    span: int = 200
    """Number of frames that errors count over, and that are timed."""
    until: int | None = None
    """Last frame; errors count up to it, and shares from the first frame on, where given."""
    is_full: bool = True
    """Whether all errors are measured, or the grid error alone."""
    base: str | None = None
    """Name of the method to whose error on the same scene ratios are taken, if any."""
    threads: int = 1
    """Threads of every simulator."""

    @property
    def key(self) -> Key:
        """Values of `head`."""
        return tuple(self.head.values())

    @property
    def names(self) -> list[str]:
        """Names of the methods whose errors are measured, and of the bounds."""
        return [*self.methods, *self.bounds]


def seeds(count: int, first: int = FIRST_SEED) -> tuple[int, ...]:
    """Return the seeds of the first test scenes."""
    return tuple(range(first, first + count))


def measure_errors(
    cases: Sequence[Case], store: RowStore, origin: Provenance, jobs: int, on_progress: Progress
) -> None:
    """Add the errors that the store lacks, by ("errors", *case.key, seed, name); `on_progress` counts scenes.

    `jobs` processes each measure one scene at a time; the errors do not depend on them.
    """
    for case, seed, found in _all_errors(cases, store, jobs, on_progress):
        for name, row in found:
            method = case.methods.get(name)
            mine = origin.using(*(method.ingredients if method else ()))
            store.add(("errors", *case.key, seed, name), mine.stamped(row))
        on_progress(1)


def measure_times(
    cases: Sequence[Case], store: RowStore, origin: Provenance, passes: int, on_progress: Progress
) -> None:
    """Add the times that the store lacks, by ("times", *case.key, name); `on_progress` counts cases.

    All methods of a case are timed together, each piece in each of the `passes`.
    """
    for case in cases:
        if not all(("times", *case.key, name) in store for name in case.methods):
            given = {"warm_up": case.warm_up, "span": case.span, "threads": case.threads}
            for name, row in timed_rows(case.methods, case.timed(), passes=passes, **given):
                store.add(("times", *case.key, name), origin.stamped(row))
        on_progress(1)


def _all_errors(
    cases: Sequence[Case], store: RowStore, jobs: int, on_progress: Progress
) -> Iterator[tuple[Case, int, list[tuple[str, Row]]]]:
    missing: list[tuple[Case, int, list[str]]] = []
    for case in cases:
        for seed in case.seeds:
            names = [name for name in case.names if ("errors", *case.key, seed, name) not in store]
            if names:
                missing.append((case, seed, names))
            else:
                on_progress(1)
    if jobs == 1:
        for case, seed, names in missing:
            yield case, seed, scene_errors(case, seed, names)
        return
    # A fresh interpreter each: threads of onnxruntime do not survive a fork.
    with ProcessPoolExecutor(jobs, mp_context=get_context("spawn")) as pool:
        waiting = {pool.submit(scene_errors, *one): one[:2] for one in missing}
        try:
            for done in as_completed(waiting):
                yield *waiting[done], done.result()
        except BaseException:
            pool.shutdown(cancel_futures=True)
            raise


def scene_errors(case: Case, seed: int, names: Sequence[str]) -> list[tuple[str, Row]]:
    """Return the rows of some methods and bounds of a case in one of its scenes."""
    truth = Truth.of(
        case.scene(seed),
        warm_up=case.warm_up,
        span=case.span,
        until=case.until,
        threads=case.threads,
    )
    head = {"impact": truth.impact, "start": truth.start}
    return [(name, head | _one(name, case, truth)) for name in names]


def _one(name: str, case: Case, truth: Truth) -> Row:
    kind, _, label = name.partition(" ")
    compared = errors if case.is_full else grid_errors
    facts: Row = {}
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        try:
            if kind == "jitter":
                other = metrics.other_jitter(truth.states.scene)
                run, _ = truth.rollout(MpmSolver(other, substeps="reference"))
            elif kind == "still":
                run = truth.still()
            elif kind == "merged":
                run = metrics.merged_states(truth.states, RATIOS[label])
            elif kind == "peer":
                run = peers.states(label, truth)
            else:
                simulator = case.methods[name].make(truth.states.scene, case.threads)
                run, counts = truth.rollout(simulator)
                facts = shares(truth, counts, is_whole=case.until is not None)
                facts["particles"] = len(simulator.coarse_positions)
        except SimulationError:
            return {"failed": True, "warned": bool(caught)}
    facts |= compared(run, truth)
    return {"failed": False, "warned": bool(caught)} | {
        key: significant(one, 6) for key, one in facts.items()
    }


def table(cases: Sequence[Case], store: RowStore) -> list[Row]:
    """Return a row for each method and bound of each case of which there is a measurement.

    Each error is a mean over the scenes, with its standard error in `..._se`; all are None where the method
    failed in a scene. `warned` and `failed` count scenes, `mpm_share` and other shares are those of
    `truth.shares`. `ms_per_frame` is the median over pieces of 8 frames of the timed scene, each frame looked
    at, `ms_p95` their 95th percentile, `slowdown` that of the machine meanwhile.

    `on_front` is whether no other method is as quick and as accurate by `error`, `on_front_transport` the
    same by `transport`. `dominated_by` is the quickest that is neither slower nor worse, `equal_mpm` the
    quickest MPM that errs no more, and `equal_mpm_ms` its time, below which the method would pay.

    Machine, date, commit, command and ingredients are those of the errors, `timed_...` those of the time.
    """
    return [row for case in cases for row in _of_case(case, store)]


def samples(case: Case, name: str, store: RowStore) -> dict[int, Row]:
    """Return the rows of a method by seed."""
    found = {seed: store.get(("errors", *case.key, seed, name)) for seed in case.seeds}
    return {seed: row for seed, row in found.items() if row is not None}


def ratios(case: Case, name: str, store: RowStore, measure_: str = "error") -> dict[int, float]:
    """Return the errors of a method over those of the base by seed, where both are known."""
    base = samples(case, str(case.base), store)
    pairs = {
        seed: (row.get(measure_), base.get(seed, {}).get(measure_))
        for seed, row in samples(case, name, store).items()
    }
    return {seed: one / two for seed, (one, two) in pairs.items() if one is not None and two is not None}


def _of_case(case: Case, store: RowStore) -> list[Row]:
    names = dict.fromkeys((*case.methods, *case.bounds))
    known = {name: samples(case, name, store) for name in names}
    whole = {
        name: [] if any(row["failed"] for row in mine.values()) else list(mine.values())
        for name, mine in known.items()
    }
    there = [one for one in MEASURES if any(one in row for mine in whole.values() for row in mine)]
    rows = []
    for name in names:
        time = store.get(("times", *case.key, name)) or {}
        if known[name] or time:
            estimates: Row = {}
            for one in there or ["error"]:
                estimates |= mean_fields(one, (row.get(one) for row in whole[name]))
            row = _row(case, name, list(known[name].values()), time, estimates)
            if case.base:
                found = list(ratios(case, name, store).values())
                tail = significant(float(np.quantile(found, 0.9)) if found else None)
                row |= mean_fields("ratio", found) | {"ratio_p90": tail}
                row |= {"worst": significant(max(found, default=None))}
            rows.append(row)
    real = [row for row in rows if row_name(row) not in BOUNDS]
    rivals = [row for row in real if row["method"] in RIVALS]
    for row in rows:
        can_run = row_name(row) not in BOUNDS
        for measure_ in FRONTS:
            if measure_ in row:
                name = "on_front" if measure_ == "error" else f"on_front_{measure_}"
                row[name] = can_run and is_on_front(row, real, measure_)
        better = dominating(row, real) if can_run else None
        equal = equal_error(row, rivals) if can_run else None
        row["dominated_by"] = better and row_name(better)
        row["equal_mpm"], row["equal_mpm_ms"] = equal and row_name(equal), equal and equal["ms_per_frame"]
    return rows


def _row(case: Case, name: str, known: Sequence[Row], time: Row, estimates: Row) -> Row:
    kind, _, label = name.partition(" ")
    method = case.methods.get(name)
    first = known[0] if known else time
    return {
        **case.head,
        "method": method.method if method else kind,
        "label": method.label if method else label or None,
        "variant": (method and method.variant) or None,
        "r_p": significant(method.r_p if method else RATIOS.get(label)),
        "r_t": method and method.r_t,
        "r_c": method and method.settings.get("r_c"),
        "threads": time.get("threads", case.threads),
        "warm_up": case.warm_up,
        "scenes": len(known),
        "failed": sum(bool(row["failed"]) for row in known),
        "warned": sum(bool(row["warned"]) for row in known),
        **{one: mean(known, one) for one in ("start", "particles", *(SHARES if case.base else SHARES[:1]))},
        **{one: time.get(one) for one in FIELDS},
        **estimates,
        **{one: first.get(one) for one in ORIGIN},
        **{f"timed_{one}": time.get(one) for one in ("date", "commit")},
    }


def mean(rows: Sequence[Row], name: str) -> float | None:
    """Return the mean of a field over the rows that have it; None without any."""
    values = [row[name] for row in rows if row.get(name) is not None]
    return significant(float(np.mean(values))) if values else None


def timed_rows(
    methods: Mapping[str, Method], scene: Scene, *, warm_up: int, span: int, passes: int, threads: int
) -> Iterator[tuple[str, Row]]:
    """Yield the name and the fields of the time of each method on a scene; None where it fails.

    The pieces lie in the `span` frames after the first impact, or after the warm-up where that is later. All
    pieces of all methods are timed once in each of the `passes`. Of the settings of a peer the quickest
    counts.
    """
    start = first_frame(scene, warm_up)
    timed: list[tuple[str, int, list[TimedCall]]] = []
    with ExitStack() as stack, warnings.catch_warnings():
        warnings.simplefilter("ignore")  # the rows of errors count them
        for name, method in methods.items():
            try:
                if method.method != "peer":
                    timed.append((name, threads, _pieces(method.make(scene, threads), start, span)))
                else:
                    baseline = stack.enter_context(baseline_process(method.label))
                    settings = peers.pieces(baseline, scene, start, span, PIECE)
                    timed += [(name, its_threads, calls) for its_threads, calls in settings]
            except SimulationError:
                yield name, dict.fromkeys(FIELDS) | {"threads": threads}
        calls = [call for *_, mine in timed for call in mine]
        seconds = seconds_by_turns([*calls, TimedCall(call=Calibration(threads).slowdown)], passes)
    quartiles = [float(np.percentile(mine, 25)) for mine in seconds]
    slowdown = significant(quartiles.pop(), 3)
    rows: dict[str, Row] = {}
    for name, its_threads, mine in timed:
        ms = [1e3 * quartiles.pop(0) for _ in mine]
        row = {
            "ms_per_frame": significant(float(np.median(ms))),
            "ms_p95": significant(float(np.percentile(ms, 95))),
            "slowdown": slowdown,
            "threads": its_threads,
        }
        rows[name] = min(rows.get(name, row), row, key=lambda one: one["ms_per_frame"])
    yield from rows.items()


def _pieces(simulator: CoarseSimulator, start: int, span: int) -> list[TimedCall]:

    def prepare(snapshot: bytes) -> None:
        """Return to a state, and touch the memory that the others used meanwhile by one frame."""
        simulator.restore(snapshot)
        simulator.advance(1)
        _ = simulator.positions

    def shown() -> float:
        """Return the time of a frame of a piece [s], each looked at."""
        began = time.perf_counter()
        for _ in range(PIECE):
            simulator.advance(1)
            _ = simulator.positions
        return (time.perf_counter() - began) / PIECE

    calls = []
    for frame in range(start, start + span - PIECE, _APART):
        simulator.advance(frame - simulator.frame)
        calls.append(TimedCall(prepare=partial(prepare, simulator.snapshot()), call=shown))
    simulator.advance(start + span - simulator.frame)
    return calls


def comparison_command(
    *,
    cases: Callable[[Any], list[Case]],
    columns: Sequence[str] = _COLUMNS,
    tabulated: Callable[[Sequence[Case], RowStore], list[Row]] | None = None,
    draw: Callable[[Sequence[Row], Path], object] = chart.chart,
    is_timed: bool = True,
    **named: Any,
) -> click.Command:
    """Return the command of a comparison of methods on the scenes of cases."""

    def measure(
        settings: ComparisonSettings,
        origin: Provenance,
        *,
        only: str | None,
        passes: int,
        jobs: int,
        runs_file: Path | None,
    ) -> list[Row]:
        if only == "table" and runs_file is None:
            raise ConfigError(
                "--only table makes the table of runs that are there: name their file by --runs"
            )
        for peer in getattr(settings, "peer", ()):
            require_installed(peer)
        found, store = cases(settings), RowStore(settings.shared(), runs_file)
        if only in (None, "errors"):
            with progress("Errors", sum(len(case.seeds) for case in found)) as bar:
                measure_errors(found, store, origin, jobs, bar.update)
        if only in (None, "times") and is_timed:
            with progress("Times", len(found)) as bar:
                measure_times(found, store, origin, passes, bar.update)
        rows = (tabulated or table)(found, store)
        if not rows:
            raise ConfigError(f"{runs_file} has no runs of these cases; measure them first")
        if busy := {str(row["scenario"]) for row in rows if (row.get("slowdown") or 0) > QUIET}:
            click.echo(f"The machine was busy while these were timed, so time them again: {', '.join(busy)}")
        return rows

    return Measurement(measure=measure, columns=columns, draw=draw, options=_OPTIONS, **named).command()
