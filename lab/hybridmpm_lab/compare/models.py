"""Learned simulators beside MPM, free fall, and the bounds of the error."""

from dataclasses import dataclass
from functools import partial

from hybridmpm import scenarios
from hybridmpm.errors import ConfigError
from hybridmpm.physics.manifest import models
from hybridmpm.physics.track import warmup_frames
from hybridmpm.planner.candidates import loaded
from hybridmpm_lab.compare import methods
from hybridmpm_lab.compare.comparison import BOUNDS, Case, ComparisonSettings, seeds
from hybridmpm_lab.compare.truth import reference_scene
from hybridmpm_lab.harness.settings import scenarios_setting, setting


@dataclass(frozen=True, kw_only=True)
class ModelsSettings(ComparisonSettings):
    """Settings of the comparison of networks."""

    scenario: tuple[str, ...] = scenarios_setting(())
    model: tuple[str, ...] = setting(
        (), "Name of a network, or its ONNX file. If absent, the library's networks.", str
    )


def cases(settings: ModelsSettings) -> list[Case]:
    """Return a case for each scenario that one of the networks serves, of `settings.scenario` where given.

    Raises
    ------
    ConfigError
        No network serves a scenario that is given, or two networks have one label.
    """
    names = settings.model or tuple(models())
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
    return [_case(scenario, served[scenario], settings) for scenario in wanted]


def _case(scenario: str, names: list[str], settings: ModelsSettings) -> Case:
    networks = [methods.network(name) for name in names]
    falling = [methods.free_fall(one.r_p, one.r_t) for one in networks]
    ladder = [
        one for one in methods.planned(scenario).values() if (one.method, one.variant) == ("mpm", "plain")
    ]
    return Case(
        head={"scenario": scenario},
        scene=partial(scenarios.get, scenario),
        timed=partial(reference_scene, scenario),
        methods=methods.matching([*networks, *falling, *ladder], settings.method),
        bounds=BOUNDS,
        seeds=seeds(settings.scenes),
        warm_up=max(warmup_frames(one.r_t) for one in networks),
        span=settings.span,
        threads=settings.threads,
    )
