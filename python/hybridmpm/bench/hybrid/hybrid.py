"""Error and time of one rollout of the network alone, of the hybrid, and of MPM.

Rows of the hybrid also tell who simulated each frame.
"""

import itertools
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from hybridmpm import metrics, scenarios
from hybridmpm._support import charts
from hybridmpm.bench.accuracy.conventions import FIRST_SEED
from hybridmpm.bench.accuracy.grid import present_grid_mass
from hybridmpm.bench.report.rows import Progress, Row
from hybridmpm.bench.report.timing import Clock
from hybridmpm.decisions import without_undone
from hybridmpm.errors import SimulationError
from hybridmpm.hybrid import HybridSimulator
from hybridmpm.hybrid.guards import Safeguard
from hybridmpm.mpm import MpmSolver
from hybridmpm.physics.load import as_stepper, model_for
from hybridmpm.physics.simulator import NeuralPhysics
from hybridmpm.simulator import Simulator

LABELS = {"neural": "network alone", "hybrid": "hybrid", "mpm": "MPM"}
"""Methods, with their names in the chart."""
_EVERY = 5
"""Frames between two rows of a method."""


@dataclass(frozen=True, kw_only=True)
class HybridSettings:
    """The rollout, and the switches of the hybrid."""

    model: str | None = None
    """Name of the network, or "zero" for free fall; None takes the first that serves the scenario."""
    scenario: str = "water_2d"
    """Scenario of the scene."""
    seed: int = FIRST_SEED
    """Seed of the scene."""
    frames: int = 600
    """Number of frames."""
    r_c: float | None = None
    """Cosine below which MPM takes over; None without the cosine guard."""
    safeguard: Safeguard = "ours"
    """Reading of the cosine."""
    threads: int = 1
    """Threads of every simulator."""

    @property
    def count(self) -> int:
        """Number of simulators, the truth among them."""
        return len(LABELS) + 1


def measure(settings: HybridSettings, on_progress: Progress) -> Iterator[Row]:
    """Simulate, and yield a row for every few frames of each method; `on_progress` counts simulators.

    All three methods simulate as few particles as the network does, and carry the others along; the truth
    has all particles and the ground truth's substeps.
    `error` is the grid RMSE, None after a failure; `seconds` is the time of the whole rollout; `mode` tells
    who simulated the frame, the network or MPM; `mpm_share` is the share of the frames by MPM.
    """
    scene = scenarios.get(settings.scenario, settings.seed)
    truth, _ = _rollout(MpmSolver(scene, substeps="reference"), settings.frames)
    on_progress(1)
    network = as_stepper(model_for(settings.model, settings.scenario), scene, threads=settings.threads)
    hybrid = HybridSimulator(
        scene,
        network,
        r_c=settings.r_c,
        safeguard=settings.safeguard,
        carry=True,
        threads=settings.threads,
    )
    simulators: dict[str, Simulator] = {
        "neural": NeuralPhysics(scene, network, carry=True, threads=settings.threads),
        "hybrid": hybrid,
        "mpm": MpmSolver(scene, r_p=network.r_p, carry=True, threads=settings.threads),
    }
    for method, simulator in simulators.items():
        states, seconds = _rollout(simulator, settings.frames)
        share = {"neural": 0.0, "hybrid": hybrid.mpm_share, "mpm": 1.0}[method]
        common = {
            "scenario": settings.scenario,
            "method": method,
            "r_c": settings.r_c if method == "hybrid" else None,
            "seconds": round(seconds, 4),
            "ms_per_frame": round(1e3 * seconds / settings.frames, 4),
            "mpm_share": round(share, 4),
        }
        for index, frame in enumerate(range(0, settings.frames + 1, _EVERY)):
            known = index < len(states)
            yield {
                **common,
                "frame": frame,
                "error": round(metrics.grid_rmse(states[index], truth[index]), 5) if known else None,
                "mode": _mode(hybrid, frame) if method == "hybrid" else method,
            }
        on_progress(1)


def _rollout(simulator: Simulator, frames: int) -> tuple[list[npt.NDArray[np.float32]], float]:
    """Return grid masses every few frames, and the time that the frames alone took [s]."""
    seconds: list[float] = []
    states = []
    for frame in range(0, frames + 1, _EVERY):
        states.append(present_grid_mass(simulator))
        try:
            with Clock(seconds):
                simulator.advance(min(_EVERY, frames - frame))
        except SimulationError:
            break
    return states, sum(seconds)


def _mode(hybrid: HybridSimulator, frame: int) -> str:
    """Return who simulated the way to a frame, after all corrections."""
    held = [decision.mode for decision in without_undone(hybrid.log) if decision.frame < frame]
    return held[-1] if held else "mpm"


def chart(rows: Sequence[Row], file: Path) -> None:
    """Draw the errors over the frames, as SVG and PNG, with MPM's frames of the hybrid shaded."""
    figure, axes = charts.panels(1, 1, width=7.5, height=3.8)
    panel = axes[0, 0]
    _shade(panel, [row for row in rows if row["method"] == "hybrid"])
    for index, (method, label) in enumerate(LABELS.items()):
        mine = [row for row in rows if row["method"] == method and row["error"] is not None]
        text = f"{label}: {mine[0]['seconds']:.2f} s"
        if method == "hybrid":
            text += f", {100 * mine[0]['mpm_share']:.0f} % of the frames by MPM"
        frames, errors = [row["frame"] for row in mine], [row["error"] for row in mine]
        panel.plot(frames, errors, ("-", "-", "--")[index], color=charts.COLOURS[index], label=text)
    panel.set(xlabel="frame", ylabel="error (grid RMSE)", xlim=(0, rows[-1]["frame"]), ylim=(0, None))
    panel.set_title(rows[0]["scenario"])
    figure.legend(loc="outside lower center", ncols=2)
    charts.save(figure, file)


def _shade(panel: Any, mine: Sequence[Row]) -> None:
    label: str | None = "the hybrid's frames by MPM"
    for before, row in itertools.pairwise(mine):
        if row["mode"] == "mpm":
            panel.axvspan(before["frame"], row["frame"], color="#f0dfa8", linewidth=0, label=label)
            label = None
