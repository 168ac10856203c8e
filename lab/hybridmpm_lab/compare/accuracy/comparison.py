"""`Comparison`: methods against the truth of many scenes, as rows of errors and latencies."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from hybridmpm.scene import Scene
from hybridmpm_lab.compare.accuracy.conventions import LADDER, ratio_label
from hybridmpm_lab.compare.accuracy.latency import latency_fields
from hybridmpm_lab.compare.accuracy.methods import Method, method_latencies, mpm, zero
from hybridmpm_lab.compare.accuracy.rollouts import Truth, rollout
from hybridmpm_lab.compare.accuracy.scores import Scores
from hybridmpm_lab.harness.pareto import compared
from hybridmpm_lab.harness.rows import Row


@dataclass(frozen=True, kw_only=True)
class ComparisonSettings:
    """Scenes, length and threads of a comparison."""

    scenes: int = 10
    """Number of scenes of each scenario."""
    span: int = 200
    """Number of frames of each scene that errors count over."""
    threads: int = 1
    """Threads of every simulator."""
    passes: int = 2
    """Number of rollouts that are timed."""
    seconds: float = 5.0
    """Time for the timed calls of a method, beyond its first three [s]."""


class Comparison:
    """Models on the scenes of one scenario, and the methods that they have to be compared with.

    Parameters
    ----------
    scenario : str
    models : sequence of Method
    settings : ComparisonSettings
    others : sequence of Method
        Further methods, each with the warm-up of a model; of those with equal names one is kept.
    """

    def __init__(
        self,
        scenario: str,
        models: Sequence[Method],
        settings: ComparisonSettings,
        others: Sequence[Method] = (),
    ) -> None:
        self._scenario, self._settings = scenario, settings
        zeros = {(one.r_p, one.r_t): zero(one.r_p, one.r_t, threads=settings.threads) for one in models}
        self._zeros = {one.name: zeros[one.r_p, one.r_t].name for one in models}
        ratios = LADDER | {ratio_label(one.r_p): one.r_p for one in models}
        ladder = [mpm(label, r_p, threads=settings.threads) for label, r_p in ratios.items()]
        unique = {one.name: one for one in others}
        self._methods = [*models, *unique.values(), *zeros.values(), *ladder]
        self._scores = {
            warm_up: self._empty_scores(warm_up) for warm_up in dict.fromkeys(one.warm_up for one in models)
        }

    def run(self, scene: Scene) -> None:
        """Roll every method out on a scene and enter its errors."""
        truth = Truth.of(scene, latest_warm_up=max(self._scores), span=self._settings.span)
        runs = {one.name: rollout(one.make(scene), truth.frames) for one in self._methods}
        jittered = truth.with_other_jitter()
        for scores in self._scores.values():
            for method in scores.methods:
                scores.enter(method, runs[method.name], truth)
            scores.enter_bounds(truth, jittered)

    def rows(self) -> Iterator[Row]:
        """Time the methods, and yield a row for each method and each bound, warm-up by warm-up."""
        settings = self._settings
        latencies = method_latencies(
            self._methods,
            self._scenario,
            earliest=max(self._scores),
            span=settings.span,
            passes=settings.passes,
            seconds=settings.seconds,
        )
        for scores in self._scores.values():
            yield from compared(
                [
                    scores.head(name)
                    | latency_fields(latencies.get(name))
                    | scores.errors(name, self._zeros.get(name))
                    for name in scores.names
                ]
            )

    def _empty_scores(self, warm_up: int) -> Scores:
        """Return the scores of MPM and of the networks with this warm-up."""
        methods = [one for one in self._methods if one.kind == "mpm" or one.warm_up == warm_up]
        ratios = {one.r_p for one in methods if one.kind == "neural"}
        return Scores(
            self._scenario,
            methods,
            warm_up=warm_up,
            span=self._settings.span,
            threads=self._settings.threads,
            merged={ratio_label(r_p): r_p for r_p in sorted(ratios, reverse=True)},
            transport=True,
        )
