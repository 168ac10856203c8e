"""Error and time of one rollout: the network alone, the hybrid and MPM, with who simulated when."""

import dataclasses
import itertools
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from hybridmpm import metrics, scenarios
from hybridmpm._support import charts
from hybridmpm.bench.accuracy.rollouts import FIRST_SEED
from hybridmpm.bench.report.provenance import Provenance
from hybridmpm.decisions import without_undone
from hybridmpm.errors import SimulationError
from hybridmpm.hybrid import HybridSimulator
from hybridmpm.hybrid.guards import Safeguard
from hybridmpm.mpm import MpmSolver
from hybridmpm.physics.load import as_stepper, model_for
from hybridmpm.physics.simulator import NeuralPhysics
from hybridmpm.simulator import Simulator

LABELS = {"neural": "network alone", "hybrid": "hybrid", "mpm": "MPM"}
_EVERY = 5


@dataclass(frozen=True, kw_only=True)
class Settings:
    """What is simulated."""

    model: str | None = None
    scenario: str = "water_2d"
    seed: int = FIRST_SEED
    frames: int = 600
    r_c: float = 0.8
    safeguard: Safeguard = "ours"
    threads: int = 1

    @property
    def methods(self) -> int:
        """How many simulators take their turn, the truth among them."""
        return len(LABELS) + 1


def rows(
    settings: Settings, source: Provenance, on_progress: Callable[[int], object]
) -> Iterator[dict[str, Any]]:
    """Simulate, and yield a row for every few frames of each method.

    All three methods have the same particles; the truth has all, and the ground truth's substeps. `error` is
    the grid RMSE, None after a failure; `seconds` the time of the whole rollout, `mode` who of the hybrid
    simulated the frame, `value` its safeguard, `mpm_share` the share of the frames by MPM.
    """
    scene = scenarios.get(settings.scenario, settings.seed)
    truth, _ = _rollout(MpmSolver(scene, substeps="reference"), settings.frames)
    on_progress(1)
    network = as_stepper(model_for(settings.model, settings.scenario), scene, threads=settings.threads)
    hybrid = HybridSimulator(
        scene, network, r_c=settings.r_c, safeguard=settings.safeguard, threads=settings.threads
    )
    simulators: dict[str, Simulator] = {
        "neural": NeuralPhysics(scene, network, threads=settings.threads),
        "hybrid": hybrid,
        "mpm": MpmSolver(scene, r_p=network.r_p, threads=settings.threads),
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
                **dataclasses.asdict(source),
            }
        on_progress(1)


def _rollout(simulator: Simulator, frames: int) -> tuple[list[npt.NDArray[np.float32]], float]:
    """Grid masses every few frames, and the time without taking them [s]."""
    resolution = simulator.scene.resolution
    seconds, states = 0.0, []
    for frame in range(0, frames + 1, _EVERY):
        x = np.clip(simulator.positions, 0, 1)
        states.append(metrics.grid_mass(x, simulator.mass, resolution))
        began = time.perf_counter()
        try:
            simulator.advance(min(_EVERY, frames - frame))
        except SimulationError:
            break
        seconds += time.perf_counter() - began
    return states, seconds


def _mode(hybrid: HybridSimulator, frame: int) -> str:
    """Who simulated the way to this frame, after all corrections."""
    held = [decision.mode for decision in without_undone(hybrid.log) if decision.frame < frame]
    return held[-1] if held else "mpm"


def chart(found: Sequence[dict[str, Any]], path: Path) -> None:
    """Draw the errors over the frames, with the hybrid's phases by MPM shaded, and the total times."""
    figure, axes = charts.panels(1, 1, width=7.5, height=3.8)
    panel = axes[0, 0]
    _shade(panel, [row for row in found if row["method"] == "hybrid"])
    for index, (method, label) in enumerate(LABELS.items()):
        mine = [row for row in found if row["method"] == method and row["error"] is not None]
        text = f"{label}: {mine[0]['seconds']:.2f} s"
        if method == "hybrid":
            text += f", {100 * mine[0]['mpm_share']:.0f} % of the frames by MPM"
        frames, errors = [row["frame"] for row in mine], [row["error"] for row in mine]
        panel.plot(frames, errors, ("-", "-", "--")[index], color=charts.COLOURS[index], label=text)
    panel.set(xlabel="frame", ylabel="error (grid RMSE)", xlim=(0, found[-1]["frame"]), ylim=(0, None))
    panel.set_title(found[0]["scenario"])
    figure.legend(loc="outside lower center", ncols=2)
    charts.save(figure, path)


def _shade(panel: Any, mine: Sequence[dict[str, Any]]) -> None:
    label: str | None = "the hybrid's frames by MPM"
    for before, row in itertools.pairwise(mine):
        if row["mode"] == "mpm":
            panel.axvspan(before["frame"], row["frame"], color="#f0dfa8", linewidth=0, label=label)
            label = None
