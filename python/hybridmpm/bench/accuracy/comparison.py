"""`Contest`: methods against the truth of many scenes, as rows of errors and latencies."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from hybridmpm import metrics
from hybridmpm.bench.accuracy.latency import Latency, Timing, measured
from hybridmpm.bench.accuracy.methods import LADDER, Method, mpm, ratio_label, reference_scene, zero
from hybridmpm.bench.accuracy.rollouts import Truth, errors, excerpt, frozen, rollout
from hybridmpm.bench.accuracy.rows import latency_fields, measure_fields, zero_fields
from hybridmpm.bench.report.pareto import compared
from hybridmpm.metrics import ErrorTable
from hybridmpm.mpm import MpmSolver
from hybridmpm.recording import Recording
from hybridmpm.scene import Scene


@dataclass(frozen=True, kw_only=True)
class Settings:
    """Scenes, length and threads of the measurement."""

    scenes: int = 10
    """Of each scenario."""
    span: int = 200
    """Frames counted in each scene."""
    threads: int = 1
    """Of every simulator."""
    passes: int = 2
    """How often the rollout that is timed is repeated."""
    seconds: float = 5.0
    """Time for the timed calls of a method, beyond its first three."""


class Contest:
    """Models, and what they have to be compared with, on the scenes of one scenario.

    Parameters
    ----------
    scenario : str
    models : sequence of Method
    settings : Settings
    others : sequence of Method
        To be compared as well, each with the warm-up of a model; one of a name is enough.
    """

    def __init__(
        self, scenario: str, models: Sequence[Method], settings: Settings, others: Sequence[Method] = ()
    ) -> None:
        self._scenario, self._settings = scenario, settings
        zeros = {(one.r_p, one.r_t): zero(one.r_p, one.r_t, threads=settings.threads) for one in models}
        self._zeros = {one.name: zeros[one.r_p, one.r_t].name for one in models}
        ratios = LADDER | {ratio_label(one.r_p): one.r_p for one in models}
        ladder = [mpm(label, r_p, threads=settings.threads) for label, r_p in ratios.items()]
        unique = {one.name: one for one in others}
        self._methods = [*models, *unique.values(), *zeros.values(), *ladder]
        self._tables = {one.warm_up: ErrorTable() for one in models}
        self._starts: dict[int, list[int]] = {warm_up: [] for warm_up in self._tables}
        self._failures = dict.fromkeys((one.name for one in self._methods), 0)

    def play(self, scene: Scene) -> None:
        """Roll every method out on a scene and enter its errors."""
        span = self._settings.span
        truth = Truth.of(scene, latest_warm_up=max(self._tables), span=span)
        runs = {one.name: rollout(one.make(scene), truth.frames) for one in self._methods}
        for name, run in runs.items():
            self._failures[name] += run is None
        jitter = rollout(MpmSolver(metrics.other_jitter(scene), substeps="reference"), truth.frames)
        for warm_up, table in self._tables.items():
            start = truth.start(warm_up)
            self._starts[warm_up].append(start)
            true = excerpt(truth.states, start, span)
            for method in self._present(warm_up):
                if (run := runs[method.name]) is not None:
                    table.add(
                        method.name,
                        scene.name,
                        errors(excerpt(run, start, span), true, transport=method.kind != "relaxed"),
                    )
            for name, bound in self._bounds(truth, jitter, start, true, warm_up).items():
                table.add(name, scene.name, errors(bound, true, transport=False))

    def _bounds(
        self, truth: Truth, jitter: Recording | None, start: int, true: Recording, warm_up: int
    ) -> dict[str, Recording]:
        """Return floors and ceilings, counted from a start."""
        span = self._settings.span
        bounds = {f"merged {label}": metrics.merged_states(true, r_p) for label, r_p in self._sizes(warm_up)}
        bounds["still"] = excerpt(frozen(truth.states, 0), start, span)
        bounds["frozen"] = excerpt(frozen(truth.states, start), start, span)
        if jitter is not None:
            bounds["jitter"] = excerpt(jitter, start, span)
        return bounds

    def rows(self) -> Iterator[dict[str, Any]]:
        """Time the methods, and give a row for each of them and of the bounds, table by table."""
        latencies = self._latencies()
        for warm_up, table in self._tables.items():
            methods = {one.name: one for one in self._present(warm_up)}
            entries = {row["method"]: row for row in table.rows()}
            yield from compared(
                [
                    {
                        **self._head(name, methods.get(name), warm_up),
                        **latency_fields(latencies.get(name)),
                        **self._errors(name, entries.get(name, {}), table),
                    }
                    for name in dict.fromkeys((*methods, *entries))
                ]
            )

    def _present(self, warm_up: int) -> list[Method]:
        """Return the methods of a table: MPM, and the networks with this warm-up."""
        return [one for one in self._methods if one.kind == "mpm" or one.warm_up == warm_up]

    def _sizes(self, warm_up: int) -> list[tuple[str, float]]:
        """Return each r_p of a table's models, after its label."""
        ratios = {one.r_p for one in self._present(warm_up) if one.kind == "neural"}
        return [(ratio_label(r_p), r_p) for r_p in sorted(ratios, reverse=True)]

    def _latencies(self) -> dict[str, Latency | None]:
        settings = self._settings
        scene = reference_scene(self._scenario)
        start = Truth.of(scene, latest_warm_up=0, span=0).start(max(self._tables))
        found = measured(
            [Timing(one.make(scene), one.r_t) for one in self._methods],
            start=start,
            span=settings.span,
            passes=settings.passes,
            seconds=settings.seconds,
        )
        return dict(zip((one.name for one in self._methods), found, strict=True))

    def _head(self, name: str, method: Method | None, warm_up: int) -> dict[str, Any]:
        kind, _, label = name.partition(" ")
        starts = self._starts[warm_up]
        r_p = method.r_p if method else dict(self._sizes(warm_up)).get(label)
        return {
            "scenario": self._scenario,
            "method": kind,
            "label": label or None,
            "r_p": None if r_p is None else round(r_p, 4),
            "r_t": None if method is None else method.r_t,
            "r_c": None,
            "mpm_share": None if method is None else float(method.kind == "mpm"),
            "parameters": None if method is None else method.parameters,
            "scenes": len(starts),
            "failed": self._failures.get(name, 0),
            "threads": None if method is None else self._settings.threads,
            "warm_up": warm_up,
            "start": round(sum(starts) / len(starts), 1),
        }

    def _errors(self, name: str, entry: Mapping[str, Any], table: ErrorTable) -> dict[str, float | None]:
        if self._failures.get(name):
            return measure_fields({}) | zero_fields(table, None, None)
        return measure_fields(entry) | zero_fields(table, name, self._zeros.get(name))
