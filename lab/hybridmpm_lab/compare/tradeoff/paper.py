"""The paper's two settings of a network, with random weights: their latency alone."""

import dataclasses

import torch

from hybridmpm.physics.model import NeuralModel
from hybridmpm.physics.model_info import ModelInfo
from hybridmpm.physics.spec import NetworkSpec, Normalization
from hybridmpm.training.export import described, to_onnx
from hybridmpm.training.physics.network.simulator import LearnedSimulator
from hybridmpm_lab.compare.accuracy.conventions import RATIOS
from hybridmpm_lab.compare.accuracy.latency import latency_fields, step_latency
from hybridmpm_lab.compare.accuracy.methods import reference_scene
from hybridmpm_lab.compare.tradeoff.settings import PAPER as SETTINGS
from hybridmpm_lab.compare.tradeoff.settings import PAPER_PART as PART
from hybridmpm_lab.compare.tradeoff.settings import TradeoffSettings, warm_up
from hybridmpm_lab.harness.provenance import Provenance
from hybridmpm_lab.harness.rows import Progress
from hybridmpm_lab.harness.store import RowStore

_SPACINGS = {2: 2.9, 3: 2.0}
"""Connectivity radius in spacings of the particles, by dimension: some 26 neighbours."""
_SECONDS = 5.0


def measure_paper(
    settings: TradeoffSettings, runs: RowStore, origin: Provenance, on_progress: Progress
) -> None:
    """Time single steps of the paper's networks where they are missing; `on_progress` counts scenarios."""
    for scenario in settings.scenarios:
        for label, (ratio, r_t) in SETTINGS.items():
            key = (PART, scenario, f"neural {label}")
            if key in runs:
                continue
            latency, _ = step_latency(
                _network(scenario, ratio, r_t, settings.threads),
                reference_scene(scenario),
                earliest=warm_up(scenario),
                span=settings.span,
                threads=settings.threads,
                seconds=_SECONDS,
            )
            runs.add(key, origin.stamped({**latency_fields(latency), "threads": settings.threads}))
        on_progress(1)


def _network(scenario: str, ratio: str, r_t: int, threads: int) -> NeuralModel:
    """Return a network of the paper's size with random weights; its answers mean nothing."""
    torch.manual_seed(0)
    spec = NetworkSpec(scenarios=(scenario,), radius=1.0, r_p=RATIOS[ratio], r_t=r_t)
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
