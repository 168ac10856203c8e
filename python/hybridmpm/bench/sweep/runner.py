"""`SweepRunner`: makes the rows of a sweep. It needs torch, since it trains and exports networks."""

import functools
from collections.abc import Mapping, Sequence
from pathlib import Path

import torch

from hybridmpm import scenarios
from hybridmpm.bench.accuracy.conventions import FIRST_SEED, LADDER, RATIOS
from hybridmpm.bench.accuracy.impact import LONGEST_FALL, first_impact
from hybridmpm.bench.accuracy.latency import latency_fields, step_latency
from hybridmpm.bench.accuracy.methods import Method, method_latencies, mpm, neural, reference_scene, zero
from hybridmpm.bench.accuracy.rollouts import Truth, rollout
from hybridmpm.bench.accuracy.scores import Scores
from hybridmpm.bench.report.rows import Row
from hybridmpm.bench.sweep.family import STRIDES, Point, SweepSettings
from hybridmpm.bench.sweep.training import Network, trained, untrained
from hybridmpm.mpm import MpmSolver
from hybridmpm.physics.track import warmup_frames

LATEST = warmup_frames(max(STRIDES))
"""Warm-up of all networks [frames]: no first impact comes before, so every network has to predict it."""

_SECONDS = 5.0
"""Time for the timed calls of a method, beyond its first three [s]."""
_FIELDS = (
    "scenario", "method", "label", "r_p", "r_t", "r_c", "mpm_share", "size", "spacings", "radius",
    "relaxations", "parameters", "trained", "minutes", "steps", "training_seconds", "scenes", "failed",
    "threads", "warm_up", "start",
)  # fmt: skip
"""Fields of all rows besides errors and latencies, in their order; those of networks are None elsewhere."""


class SweepRunner:
    """Trains, exports and measures the points of a sweep.

    Parameters
    ----------
    folder : Path
        Folder that gets a folder for each training.
    settings : SweepSettings
    device : torch.device
        Device that networks are trained on; they are measured on the CPU.
    """

    def __init__(self, folder: Path, settings: SweepSettings, device: torch.device) -> None:
        self._folder, self._settings, self._device = folder, settings, device

    def references(self, scenario: str) -> list[Row]:
        """Return the errors of MPM, of zero networks and of the bounds; methods as in `models.measure`."""
        threads = self._settings.threads
        zeros = [zero(r_p, r_t, threads=threads) for r_p in RATIOS.values() for r_t in STRIDES]
        scores = self._scores(scenario, [*self._rungs(), *zeros])
        for truth in self._entered(scores, scenario).values():
            scores.enter_bounds(truth, truth.with_other_jitter())
        return [_row(scores.head(name)) | scores.errors(name) for name in scores.names]

    def ladder(self, scenario: str) -> list[Row]:
        """Return the latencies of MPM, by `label`."""
        rungs = self._rungs()
        latencies = method_latencies(
            rungs, scenario, earliest=LATEST, span=self._settings.span, seconds=_SECONDS
        )
        return [{"label": one.label, **latency_fields(latencies[one.name])} for one in rungs]

    def errors(self, point: Point, minutes: float) -> Row:
        """Train a network for some minutes, and return its errors."""
        network = trained(point, minutes, self._settings, self._folder, self._device)
        method = self._method(point, network)
        rival = zero(method.r_p, method.r_t, threads=self._settings.threads)
        scores = self._scores(point.scenario, [method, rival])
        self._entered(scores, point.scenario)
        head = _row(scores.head(method.name)) | _network_fields(point, network, minutes)
        return head | scores.errors(method.name, rival.name)

    def latency(self, point: Point) -> Row:
        """Return the latency of a network with random weights: trained ones have the same."""
        network = untrained(point, self._settings)
        latency, yardstick = step_latency(
            network.model,
            reference_scene(point.scenario),
            earliest=LATEST,
            span=self._settings.span,
            threads=self._settings.threads,
            seconds=_SECONDS,
        )
        method = self._method(point, network)
        return (
            _row(self._scores(point.scenario, [method]).head(method.name))
            | _network_fields(point, network, 0.0)
            | {"ms_mpm": latency_fields(yardstick)["ms_per_frame"]}
            | latency_fields(latency)
        )

    def _method(self, point: Point, network: Network) -> Method:
        parameters = network.model.info.parameters
        return neural(point.name, network.model, threads=self._settings.threads, parameters=parameters)

    def _rungs(self) -> list[Method]:
        return [mpm(label, r_p, threads=self._settings.threads) for label, r_p in LADDER.items()]

    def _scores(self, scenario: str, methods: Sequence[Method]) -> Scores:
        settings = self._settings
        return Scores(
            scenario, methods, warm_up=LATEST, span=settings.span, threads=settings.threads, merged=RATIOS
        )

    def _entered(self, scores: Scores, scenario: str) -> Mapping[str, Truth]:
        """Enter the errors of all methods on all scenes, and return the truths of the scenes by name."""
        truths = _truths(scenario, self._settings)
        for method in scores.methods:
            for truth in truths.values():
                run = rollout(method.make(truth.states.scene), truth.frames)
                scores.enter(method, run, truth)
        return truths


def _row(head: Row) -> Row:
    return dict.fromkeys(_FIELDS) | head


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
def _truths(scenario: str, settings: SweepSettings) -> dict[str, Truth]:
    """Simulate the first test scenes whose impact comes late enough, and return their truths by name."""
    found: dict[str, Truth] = {}
    seed = FIRST_SEED
    while len(found) < settings.scenes:
        scene = scenarios.get(scenario, seed)
        # The solver at CFL substeps is several times as fast and falls alike.
        if first_impact(MpmSolver(scene), LONGEST_FALL) >= LATEST:
            found[scene.name] = Truth.of(scene, latest_warm_up=LATEST, span=settings.span)
        seed += 1
    return found
