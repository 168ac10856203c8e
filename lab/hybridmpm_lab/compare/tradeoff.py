"""The trade-off: every method of the library, and peers, by error and time."""

import dataclasses
from collections.abc import Iterator
from dataclasses import dataclass
from functools import partial

from hybridmpm import scenarios
from hybridmpm.physics.manifest import default_model
from hybridmpm.physics.stepper import Stepper
from hybridmpm.planner.candidates import RATIOS
from hybridmpm_lab.compare import methods, peers
from hybridmpm_lab.compare.comparison import BOUNDS, Case, ComparisonSettings, seeds
from hybridmpm_lab.compare.methods import Method
from hybridmpm_lab.compare.truth import reference_scene
from hybridmpm_lab.harness.rows import FIRST_SEED
from hybridmpm_lab.harness.settings import setting
from hybridmpm_lab.speed.baselines import SOLVERS

THRESHOLDS = (0.0, 0.2, 0.4, 0.6, 0.8, 0.9)
"""r_c of the hybrids that the cosine alone guards."""
PAPER = {"paper r_p 1, r_t 1": ("1", 1), "paper r_p 1/1.75, r_t 2": ("1/1.75", 2)}
"""Label of r_p, and r_t, by the label of a setting of the paper: 10 layers of 128 numbers."""
_SPACINGS = {2: 2.9, 3: 2.0}
"""Connectivity radius in spacings of the particles, by dimension: some 26 neighbours."""


@dataclass(frozen=True, kw_only=True)
class TradeoffSettings(ComparisonSettings):
    """Settings of the chart of all methods."""

    peer: tuple[str, ...] = setting((), "Solver of others, for the scenes that it takes.", SOLVERS)
    paper: bool = setting(False, "Time networks of the paper's size, too. This needs torch.", bool)  # noqa: FBT003


def cases(settings: TradeoffSettings) -> list[Case]:
    """Return a case for each scenario."""
    return [
        Case(
            head={"scenario": name},
            scene=partial(scenarios.get, name),
            timed=partial(reference_scene, name),
            methods=methods.matching(_methods(name, settings), settings.method),
            bounds=BOUNDS,
            seeds=seeds(settings.scenes),
            warm_up=methods.warm_up(name),
            span=settings.span,
            threads=settings.threads,
        )
        for name in settings.scenario
    ]


def _methods(scenario: str, settings: TradeoffSettings) -> Iterator[Method]:
    yield methods.truth()
    yield from methods.planned(scenario).values()
    for r_c in THRESHOLDS:
        yield methods.cosine_hybrid(default_model(scenario), r_c)
    if peers.can_simulate(scenarios.get(scenario, FIRST_SEED)):
        for package in settings.peer:
            yield Method(method="peer", label=package)
    for label, (ratio, r_t) in PAPER.items() if settings.paper else ():
        yield Method(
            method="neural",
            label=label,
            variant="untrained",
            r_p=RATIOS[ratio],
            r_t=r_t,
            stepper=partial(_untrained, scenario, RATIOS[ratio], r_t),
        )


def _untrained(scenario: str, r_p: float, r_t: int, threads: int) -> Stepper:
    """Return a network of the paper's size with random weights; its answers mean nothing."""
    import torch  # noqa: PLC0415 - an extra

    from hybridmpm.physics.model import NeuralModel  # noqa: PLC0415
    from hybridmpm.physics.model_info import ModelInfo  # noqa: PLC0415
    from hybridmpm.physics.spec import NetworkSpec, Normalization  # noqa: PLC0415
    from hybridmpm.training.export import described, to_onnx  # noqa: PLC0415
    from hybridmpm.training.physics.network.simulator import LearnedSimulator  # noqa: PLC0415

    torch.manual_seed(0)
    spec = NetworkSpec(scenarios=(scenario,), radius=1.0, r_p=r_p, r_t=r_t)
    spec = dataclasses.replace(spec, radius=round(_SPACINGS[spec.dim] * spec.spacing, 6))
    # Small scales, so that all motion counts as a disturbance and the network is run.
    unit, none = (1e-3,) * spec.dim, (0.0,) * spec.dim
    scales = Normalization(
        velocity_mean=none, velocity_std=unit, acceleration_mean=none, acceleration_std=unit, noise_std=0.0
    )
    simulator = LearnedSimulator(spec, scales)
    parameters = sum(parameter.numel() for parameter in simulator.parameters())
    info = ModelInfo(spec=spec, scales=scales, parameters=parameters, training={})
    return NeuralModel(described(to_onnx(simulator, info), info), where=scenario, threads=threads)
