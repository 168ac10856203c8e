"""The lists of methods and scenes of the trade-off, of coarse modes and of networks."""

from collections.abc import Iterable
from dataclasses import dataclass
from functools import partial

from hybridmpm import scenarios
from hybridmpm.errors import ConfigError
from hybridmpm.physics import manifest
from hybridmpm.physics.manifest import default_model
from hybridmpm.physics.track import warmup_frames
from hybridmpm.planner.candidates import RATIOS, loaded
from hybridmpm_lab.compare import methods
from hybridmpm_lab.compare.comparison import (
    BOUNDS,
    RIVALS,
    Case,
    ComparisonSettings,
    comparison_command,
    seeds,
)
from hybridmpm_lab.compare.methods import Method
from hybridmpm_lab.compare.truth import reference_scene
from hybridmpm_lab.harness.command import scenarios_setting, setting
from hybridmpm_lab.harness.rows import FIRST_SEED
from hybridmpm_lab.speed.baselines import SOLVERS

THRESHOLDS = (0.0, 0.2, 0.4, 0.6, 0.8, 0.9)
"""r_c of the hybrids that the cosine alone guards."""
_LADDER = [f"mpm {label}" for label in RATIOS]
"""Names of MPM with all and with fewer particles."""


@dataclass(frozen=True, kw_only=True)
class TradeoffSettings(ComparisonSettings):
    """Settings of the chart of all methods."""

    peer: tuple[str, ...] = setting((), "Solver of others, for the scenes that it takes.", SOLVERS)


@dataclass(frozen=True, kw_only=True)
class CoarseSettings(ComparisonSettings):
    """Settings of the comparison of coarse modes, in scenarios of one material without obstacles."""

    scenario: tuple[str, ...] = scenarios_setting(("water_2d", "sand_2d", "water_3d", "sand_3d"))


@dataclass(frozen=True, kw_only=True)
class ModelsSettings(ComparisonSettings):
    """Settings of the comparison of networks."""

    scenario: tuple[str, ...] = scenarios_setting(())
    model: tuple[str, ...] = setting(
        (), "Name of a network, or its ONNX file; if absent, all that ship.", str
    )


def tradeoff_cases(settings: TradeoffSettings) -> list[Case]:
    """Return a case for each scenario, with every method of the library, and peers."""
    found = []
    for name in settings.scenario:
        cosines = [methods.cosine_hybrid(default_model(name), r_c) for r_c in THRESHOLDS]
        some = [methods.truth(), *methods.planned(name).values(), *cosines]
        scene = scenarios.get(name, FIRST_SEED)
        if not scene.obstacles and len(scene.materials) == 1:  # Solvers of others take no other scenes.
            some += [Method(method="peer", label=package) for package in settings.peer]
        found.append(_case(name, some, settings, methods.warm_up(name)))
    return found


def coarse_cases(settings: CoarseSettings) -> list[Case]:
    """Return a case for each scenario, with MPM of all and of fewer particles, from the first impact on."""
    return [
        _case(name, [one for one in methods.planned(name).values() if one.method in RIVALS], settings, 0)
        for name in settings.scenario
    ]


def models_cases(settings: ModelsSettings) -> list[Case]:
    """Return a case for each scenario that one of the networks serves, of `settings.scenario` where given.

    Raises
    ------
    ConfigError
        No network serves a scenario that is given, or two networks have one label.
    """
    names = settings.model or tuple(manifest.models())
    labels = [methods.network(name).label for name in names]
    twins = [label for label in labels if labels.count(label) > 1]
    if twins:
        raise ConfigError(f"two models are called {twins[0]}; give each once, and rename files of one name")
    served = {
        scenario: [name for name in names if scenario in loaded(name, 1).spec.scenarios]
        for scenario in scenarios.NAMES
    }
    wanted = settings.scenario or tuple(scenario for scenario, mine in served.items() if mine)
    unserved = [scenario for scenario in wanted if not served[scenario]]
    if unserved or not wanted:
        missing, listed = ", ".join(unserved) or "any scenario", ", ".join(names) or "none yet"
        raise ConfigError(f"no model serves {missing}; the models are {listed}")
    found = []
    for scenario in wanted:
        networks = [methods.network(name) for name in served[scenario]]
        falling = [methods.free_fall(one.r_p, one.r_t) for one in networks]
        ladder = [one for name, one in methods.planned(scenario).items() if name in _LADDER]
        warm_up = max(warmup_frames(one.r_t) for one in networks)
        found.append(_case(scenario, [*networks, *falling, *ladder], settings, warm_up))
    return found


def _case(scenario: str, some: Iterable[Method], settings: ComparisonSettings, warm_up: int) -> Case:
    return Case(
        head={"scenario": scenario},
        scene=partial(scenarios.get, scenario),
        timed=partial(reference_scene, scenario),
        methods=methods.matching(some, settings.method),
        bounds=BOUNDS,
        seeds=seeds(settings.scenes),
        warm_up=warm_up,
        span=settings.span,
        threads=settings.threads,
    )


tradeoff = comparison_command(
    name="tradeoff",
    settings=TradeoffSettings,
    cases=tradeoff_cases,
    summary="""Compare all methods by error and time.

    Methods are MPM in full and with fewer particles, alone, showing all and fitted; softer; each
    network of the library, and hybrids with it. Errors are taken against the truth in scenes that no data set
    and no fit contains. Methods that another one beats in both are dominated, all others are the Pareto
    front. equal_mpm_ms is the time of the quickest MPM that errs no more: a network pays only below it.
    """,
)
coarse = comparison_command(
    name="coarse",
    settings=CoarseSettings,
    cases=coarse_cases,
    summary="""Compare MPM with fewer particles by error and time: alone, showing all, and fitted.

    Beside them stand the floors of the error (jitter: the truth with other jitter; merged: the truth shown by
    as few particles) and its ceiling (still: the initial state held).
    """,
)
models = comparison_command(
    name="models",
    settings=ModelsSettings,
    cases=models_cases,
    summary="""Compare networks by error and time, beside MPM and free fall.

    equal_mpm_ms is the time of the quickest MPM that errs no more: a network pays only below it.
    """,
)
