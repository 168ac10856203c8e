"""The shock of handing over from a network to MPM, with what state is carried and without.

A recording of MPM itself plays the network. Its motion is right to the last bit, so all that differs from
MPM going on undisturbed is what the handoff loses.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from hybridmpm import metrics
from hybridmpm._support import charts
from hybridmpm.bench.report.rows import Progress, Row, significant
from hybridmpm.decisions import Decision, Mode
from hybridmpm.hybrid import HybridSimulator
from hybridmpm.hybrid.handoff import KINDS
from hybridmpm.mpm import MpmSolver
from hybridmpm.scene import Box, Scene

MATERIALS = ("water", "sand", "elastic")
PHASES = {"free fall": 60, "impact": 94, "at rest": 3000}
"""Frame of the handoff by what happens then; MPM feels the floor from about frame 85 on."""
AFTER = (1, 4, 16)
"""Frames after the handoff whose state is compared."""
COUNT = len(MATERIALS) * len(PHASES) * len(KINDS)
"""Number of rows."""
NEURAL = 20
"""Frames that the network computes before the handoff."""

_R_T = 2
_DROP = 0.25
"""Height of the block above the floor [m]."""
_SMALLEST = 1e-5
"""Smallest height that is drawn; smaller values are drawn at it."""
_Floats = npt.NDArray[np.float32]


@dataclass(frozen=True, kw_only=True)
class _Recorded:
    """A network that answers what MPM did in one run from frame 0."""

    path: _Floats
    """Positions of MPM at each frame (F, N, D) [m]."""
    r_p: float = 1.0
    r_t: int = _R_T

    def check(self, scene: Scene) -> None:
        """Accept the scene that was recorded."""

    def step(
        self,
        history: _Floats,
        types: npt.NDArray[np.int64],  # noqa: ARG002 - of the protocol
        acceleration: _Floats,  # noqa: ARG002
        walls: _Floats,  # noqa: ARG002
    ) -> _Floats:
        """Return the recorded positions one step after those that `history` ends with."""
        apart = np.abs(self.path[:: self.r_t] - history[-1]).max(axis=(1, 2))
        return np.asarray(self.path[self.r_t * (int(np.argmin(apart)) + 1)])


def block(material: str) -> Scene:
    """Return a scene with a block of 512 particles in the air."""
    body = Box(material=material, lower=(0.35, 0.1 + _DROP), upper=(0.6, 0.35 + _DROP))
    return Scene(name=f"a block of {material}", dim=2, resolution=64, bodies=(body,))


def measure(on_progress: Progress, materials: Sequence[str] = MATERIALS) -> Iterator[Row]:
    """Hand over in each phase of each material's fall, in each way, and yield a row for each handoff.

    `kinetic_1` is the difference of the kinetic energy, 1 frame after the handoff, to that of MPM
    undisturbed, over the energy of the fall; `grid_1` is the grid RMSE between the two. `acceleration` is the
    power mean of order 4 of the accelerations in the first frame, which the largest dominate [m/s^2];
    `acceleration_mpm` is that of MPM undisturbed. `on_progress` counts rows.
    """
    for material in materials:
        scene = block(material)
        states = _undisturbed(scene)
        network = _Recorded(path=states.pop("path"))
        for phase, frame in PHASES.items():
            for kind in KINDS:
                shock = _shock(HybridSimulator(scene, network, handoff=kind, shortcuts=False), frame, states)
                head = {"material": material, "phase": phase, "handoff": kind}
                yield head | shock
                on_progress(1)


def _undisturbed(scene: Scene) -> dict[Any, Any]:
    """Return the positions of each frame by "path", and positions, velocities, kinetic energy by frame."""
    solver = MpmSolver(scene)
    kept = {frame + after for frame in PHASES.values() for after in (0, *AFTER)}
    path = np.empty((max(kept) + _R_T + 1, solver.particle_count, scene.dim), dtype=np.float32)
    states: dict[Any, Any] = {"path": path}
    for frame in range(len(path)):
        path[frame] = solver.positions
        if frame in kept:
            states[frame] = _state(solver)
        solver.advance(1)
    return states


def _state(simulator: Any) -> tuple[_Floats, _Floats, float]:
    return simulator.positions, simulator.velocities, simulator.diagnostics().kinetic_energy


def _shock(sim: HybridSimulator, frame: int, states: dict[Any, Any]) -> Row:
    modes: dict[int, Mode] = {frame - NEURAL: "neural", frame: "mpm"}
    log = [
        Decision(frame=at, mode=mode, value=None, reason="appointed", noticed=at)
        for at, mode in modes.items()
    ]
    found: dict[str, float] = {}
    fall = 9.81 * _DROP * float(sim.mass.sum(dtype=np.float64))
    sim.replay(log, frame)
    before = sim.velocities
    for after in AFTER:
        sim.advance(frame + after - sim.frame)
        x, v, kinetic = _state(sim)
        true_x, true_v, true_kinetic = states[frame + after]
        if after == 1:
            dt = sim.scene.frame_dt
            found["acceleration"] = _largest(v - before, dt)
            found["acceleration_mpm"] = _largest(true_v - states[frame][1], dt)
        found[f"kinetic_{after}"] = (kinetic - true_kinetic) / fall
        masses = [metrics.grid_mass(one, sim.mass, sim.scene.resolution) for one in (x, true_x)]
        found[f"grid_{after}"] = metrics.grid_rmse(*masses)
    return {name: significant(value) for name, value in found.items()}


def _largest(change: _Floats, dt: float) -> float:
    squares = np.sum((change.astype(np.float64) / dt) ** 2, axis=1)
    return float(np.mean(squares**2) ** 0.25)


def chart(rows: Sequence[Row], file: Path) -> None:
    """Draw the jumps of kinetic energy, grid mass and acceleration, as SVG and PNG, a row a material."""
    materials = list(dict.fromkeys(row["material"] for row in rows))
    figure, axes = charts.panels(3, len(materials), width=3.3, height=2.4)
    for line, material in zip(axes, materials, strict=True):
        mine = [row for row in rows if row["material"] == material]
        _dots(line[0], mine, lambda row: abs(row["kinetic_1"]))
        _dots(line[1], mine, lambda row: row["grid_1"])
        _dots(line[2], mine, lambda row: row["acceleration"])
        undisturbed = {row["phase"]: row["acceleration_mpm"] for row in mine}
        line[2].plot(range(len(PHASES)), [undisturbed[phase] for phase in PHASES], "k_", markersize=26)
        line[0].set_ylabel(f"{material}\nchange of kinetic energy\n[energy of the fall]")
        line[1].set_ylabel("grid RMSE [-]")
        line[2].set_ylabel("acceleration [m/s$^2$]")
    handles, labels = axes[0][0].get_legend_handles_labels()
    handles += axes[0][2].get_lines()[-1:]
    labels += ["MPM undisturbed (acceleration)"]
    figure.legend(handles, labels, loc="outside lower center", ncols=len(labels))
    figure.suptitle("One frame after the handoff, against MPM undisturbed", fontsize=11)
    charts.save(figure, file)


def _dots(panel: Any, rows: Sequence[Row], read: Callable[[Row], float]) -> None:
    for index, kind in enumerate(KINDS):
        values = {row["phase"]: read(row) for row in rows if row["handoff"] == kind}
        places = [place + 0.18 * (index - 1) for place in range(len(PHASES))]
        heights = [max(values[phase], _SMALLEST) for phase in PHASES]
        panel.plot(places, heights, charts.MARKERS[index], color=charts.COLOURS[index], label=kind)
    panel.set_xticks(range(len(PHASES)), PHASES)
    panel.set(yscale="log", xlim=(-0.5, len(PHASES) - 0.5))
