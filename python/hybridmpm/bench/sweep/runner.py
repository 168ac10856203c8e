"""`Laboratory`: makes the rows of a sweep. It needs torch, since it trains and exports networks."""

import functools
from collections.abc import Mapping
from pathlib import Path

import torch

from hybridmpm import metrics, scenarios
from hybridmpm.bench.accuracy.impact import LONGEST_FALL, first_impact
from hybridmpm.bench.accuracy.latency import Timing, measured, step_latency
from hybridmpm.bench.accuracy.methods import LADDER, RATIOS, Method, mpm, neural, reference_scene, zero
from hybridmpm.bench.accuracy.rollouts import FIRST_SEED, Truth, errors, excerpt, frozen, rollout
from hybridmpm.bench.accuracy.rows import latency_fields, measure_fields, zero_fields
from hybridmpm.bench.report.pareto import Row
from hybridmpm.bench.sweep.sweep import STRIDES, Point, Settings
from hybridmpm.bench.sweep.training import Network, trained, untrained
from hybridmpm.metrics import ErrorTable
from hybridmpm.mpm import MpmSolver
from hybridmpm.physics.track import warmup_frames
from hybridmpm.recording import Recording

LATEST = warmup_frames(max(STRIDES))
"""Frames. No scene's first impact comes before, so that every network has to predict it."""

_SECONDS = 5.0
"""For the timed calls of a method, beyond its first three."""
_FIELDS = (
    "scenario", "method", "label", "r_p", "r_t", "r_c", "mpm_share", "size", "spacings", "radius",
    "relaxations", "parameters", "trained", "minutes", "steps", "training_seconds", "scenes", "failed",
    "threads", "warm_up", "start",
)  # fmt: skip


class Laboratory:
    """Trains, exports and measures the points of a sweep.

    Parameters
    ----------
    folder : Path
        Gets a folder for each training.
    settings : Settings
    device : torch.device
        That networks are trained on; they are measured on the CPU.
    """

    def __init__(self, folder: Path, settings: Settings, device: torch.device) -> None:
        self._folder, self._settings, self._device = folder, settings, device

    def references(self, scenario: str) -> list[Row]:
        """Return the errors of MPM, of zero networks and of the bounds; methods as in `bench.models.rows`."""
        threads = self._settings.threads
        table, truths = ErrorTable(), _truths(scenario, self._settings)
        zeros = [zero(r_p, r_t, threads=threads) for r_p in RATIOS.values() for r_t in STRIDES]
        methods = (*self._rungs(), *zeros)
        for method in methods:
            self._enter(table, method, truths)
        for truth in truths.values():
            self._enter_bounds(table, truth)
        known = {one.name: one for one in methods}
        return [
            self._row(scenario, name, known.get(name), truths)
            | measure_fields(entry)
            | zero_fields(table, None, None)
            for entry in table.rows()
            for name in [entry["method"]]
        ]

    def ladder(self, scenario: str) -> list[Row]:
        """Return the latencies of MPM, by `label`."""
        scene, rungs = reference_scene(scenario), self._rungs()
        start = max(LATEST, first_impact(MpmSolver(scene), LONGEST_FALL))
        latencies = measured(
            [Timing(one.make(scene)) for one in rungs],
            start=start, span=self._settings.span, passes=2, seconds=_SECONDS,
        )  # fmt: skip
        return [
            {"label": one.label, **latency_fields(latency)}
            for one, latency in zip(rungs, latencies, strict=True)
        ]

    def errors(self, point: Point, minutes: float) -> Row:
        """Train a network for so long, and return its errors."""
        network = trained(point, minutes, self._settings, self._folder, self._device)
        truths, method = _truths(point.scenario, self._settings), self._method(point, network)
        table, rival = ErrorTable(), zero(method.r_p, method.r_t, threads=self._settings.threads)
        failed = self._enter(table, method, truths)
        self._enter(table, rival, truths)
        entries = {row["method"]: row for row in table.rows()}
        name = None if failed else method.name
        return (
            self._row(point.scenario, method.name, method, truths)
            | _network_fields(point, network, minutes)
            | {"failed": failed}
            | measure_fields(entries[name] if name else {})
            | zero_fields(table, name, rival.name)
        )

    def latency(self, point: Point) -> Row:
        """Return the latency of a network with random weights: it is that of any."""
        network, scene = untrained(point, self._settings), reference_scene(point.scenario)
        latency, yardstick = step_latency(
            network.model, scene, earliest=LATEST, span=self._settings.span, threads=self._settings.threads,
            seconds=_SECONDS,
        )  # fmt: skip
        method = self._method(point, network)
        return (
            self._row(point.scenario, method.name, method, {})
            | _network_fields(point, network, 0.0)
            | {"ms_mpm": latency_fields(yardstick)["ms_per_frame"]}
            | latency_fields(latency)
        )

    def _method(self, point: Point, network: Network) -> Method:
        parameters = network.model.info.parameters
        return neural(point.name, network.model, threads=self._settings.threads, parameters=parameters)

    def _rungs(self) -> list[Method]:
        return [mpm(label, r_p, threads=self._settings.threads) for label, r_p in LADDER.items()]

    def _enter(self, table: ErrorTable, method: Method, truths: Mapping[str, Truth]) -> int:
        """Enter a method's errors in each scene; returns in how many it failed."""
        failures = 0
        for truth in truths.values():
            run = rollout(method.make(truth.states.scene), truth.frames)
            if run is None:
                failures += 1
            else:
                self._compare(table, method.name, run, truth)
        return failures

    def _compare(self, table: ErrorTable, name: str, states: Recording, truth: Truth) -> None:
        start, span = truth.start(LATEST), self._settings.span
        scene, true = truth.states.scene.name, excerpt(truth.states, start, span)
        table.add(name, scene, errors(excerpt(states, start, span), true, transport=False))

    def _enter_bounds(self, table: ErrorTable, truth: Truth) -> None:
        scene = truth.states.scene
        start, span = truth.start(LATEST), self._settings.span
        true = excerpt(truth.states, start, span)
        for label, r_p in RATIOS.items():
            merged = metrics.merged_states(true, r_p)
            table.add(f"merged {label}", scene.name, errors(merged, true, transport=False))
        self._compare(table, "still", frozen(truth.states, 0), truth)
        self._compare(table, "frozen", frozen(truth.states, start), truth)
        jitter = rollout(MpmSolver(metrics.other_jitter(scene), substeps="reference"), truth.frames)
        if jitter is not None:
            self._compare(table, "jitter", jitter, truth)

    def _row(self, scenario: str, name: str, method: Method | None, truths: Mapping[str, Truth]) -> Row:
        """Return the fields besides errors and latencies; those of networks are None."""
        kind, _, label = name.partition(" ")
        r_p = method.r_p if method else RATIOS.get(label)
        starts = [truth.start(LATEST) for truth in truths.values()]
        return {
            **dict.fromkeys(_FIELDS),
            "scenario": scenario,
            "method": kind,
            "label": label or None,
            "r_p": None if r_p is None else round(r_p, 4),
            "r_t": None if method is None else method.r_t,
            "mpm_share": None if method is None else float(method.kind == "mpm"),
            "parameters": None if method is None else method.parameters,
            "scenes": len(truths),
            "failed": 0,
            "threads": None if method is None else self._settings.threads,
            "warm_up": LATEST,
            "start": round(sum(starts) / len(starts), 1) if starts else None,
        }


def _network_fields(point: Point, network: Network, minutes: float) -> Row:
    spec = network.model.spec
    return {
        "size": point.size,
        "spacings": point.spacings,
        "radius": spec.radius,
        "relaxations": spec.relaxations,
        "trained": minutes > 0,
        "minutes": minutes,
        "steps": network.steps,
        "training_seconds": round(network.seconds, 1),
    }


@functools.lru_cache(maxsize=1)
def _truths(scenario: str, settings: Settings) -> dict[str, Truth]:
    """Simulate the first test scenes whose impact comes late enough, by name."""
    found: dict[str, Truth] = {}
    seed = FIRST_SEED
    while len(found) < settings.scenes:
        scene = scenarios.get(scenario, seed)
        # The solver at CFL substeps is several times as fast and falls alike.
        if first_impact(MpmSolver(scene), LONGEST_FALL) >= LATEST:
            found[scene.name] = Truth.of(scene, latest_warm_up=LATEST, span=settings.span)
        seed += 1
    return found
