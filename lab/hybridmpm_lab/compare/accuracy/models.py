"""Learned simulators against the truth, beside the zero network, the floors and the ladder of MPM."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from hybridmpm import scenarios as library
from hybridmpm.physics.spec import NetworkSpec
from hybridmpm.physics.stepper import Stepper
from hybridmpm_lab.compare.accuracy.comparison import Comparison, ComparisonSettings
from hybridmpm_lab.compare.accuracy.conventions import FIRST_SEED
from hybridmpm_lab.compare.accuracy.methods import neural, relaxed
from hybridmpm_lab.harness.rows import Progress, Row


@dataclass(frozen=True, kw_only=True)
class Candidate:
    """A model to be measured."""

    label: str
    """Name of the model in the rows."""
    stepper: Stepper
    """The model itself."""
    scenarios: tuple[str, ...]
    """Scenarios that the model is measured in."""
    parameters: int
    """Number of parameters of the model."""
    spec: NetworkSpec | None = None
    """Architecture of a network; None of other steppers."""


def measure(
    candidates: Sequence[Candidate], settings: ComparisonSettings, on_progress: Progress
) -> Iterator[Row]:
    """Measure the models scenario by scenario and yield a row a method; `on_progress` counts scenes.

    Methods are `neural`, the models; `relaxed`, the models without what they learned (`RelaxedFreeFall`),
    where they relax densities; `zero`, free fall between walls in their place (`FreeFall`); `mpm`
    with all particles and with fewer, at CFL substeps; `merged`, the truth merged state by state, which no
    method with so many particles can beat but by chance; `jitter`, the truth with other jitter; `still`, the
    initial state held; `frozen`, the state held in which the count begins.

    Errors are taken over `span` frames from the first impact of the truth on, or from the end of the models'
    warm-up where that is later; models of one `warm_up` are compared with methods counted from the same
    frames. Errors are means over the scenes, and the fields ending in `_se` the standard errors. `error` is
    the mean of `grid_rmse` over the span; `error_40` is that of frame 40 of the span. `below_zero_40` is the
    part of the zero network's error that a model does without, `minus_zero_40` the mean difference of the two
    on the same scenes. Latencies are those of a rollout of the scene with the most particles; for `as_good`
    and `dominated_by` see `pareto.compared`.
    """
    for scenario in served(candidates):
        mine = [one for one in candidates if scenario in one.scenarios]
        methods = [
            neural(one.label, one.stepper, threads=settings.threads, parameters=one.parameters)
            for one in mine
        ]
        unlearned = [
            relaxed(one.spec, threads=settings.threads) for one in mine if one.spec and one.spec.relaxations
        ]
        comparison = Comparison(scenario, methods, settings, unlearned)
        for seed in range(FIRST_SEED, FIRST_SEED + settings.scenes):
            comparison.run(library.get(scenario, seed))
            on_progress(1)
        yield from comparison.rows()


def served(candidates: Sequence[Candidate]) -> list[str]:
    """Return the scenarios that at least one of the models serves, in the order of `scenarios.NAMES`."""
    return [name for name in library.NAMES if any(name in one.scenarios for one in candidates)]
