"""`Case`: the truth of one scene, as coarse levels are measured by it."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

from hybridmpm import scenarios
from hybridmpm._core import SOLVER_VERSION
from hybridmpm._support.files import replacing
from hybridmpm.mpm import MpmSolver
from hybridmpm.planner.calibrating.impact import LONGEST_FALL, first_impact
from hybridmpm.scene import Scene
from hybridmpm_lab.harness.rows import EVERY
from hybridmpm_lab.harness.grid import TrueGrids

SPAN = 200
"""Frames after the first impact over which errors are means."""
TRANSPORTED = (9, 19)
"""Rows of the states whose distance of transport counts: 100 and 200 frames after the first impact."""

_Floats = npt.NDArray[np.float32]


@dataclass(frozen=True, eq=False)
class Case:
    """A scene, and every tenth state of its truth in the `SPAN` frames after the first impact."""

    scene: Scene
    impact: int
    """Frame of the first impact."""
    mass: _Floats
    """Masses (N,) of the scene's particles [kg]."""
    grids: TrueGrids
    """Grids of the states."""
    transported: _Floats
    """Positions (rows, N, D) [m] of the states in `TRANSPORTED`."""

    @classmethod
    def of(cls, scenario: str, seed: int, folder: Path) -> "Case":
        """Read the truth of a scene from a folder, or simulate it and keep it there."""
        scene = scenarios.get(scenario, seed)
        file = folder / f"{scenario}-{seed}-v{SOLVER_VERSION}.npz"
        if not file.exists():
            impact, positions = _simulated(scene)
            with replacing(file) as part, part.open("wb") as stream:
                np.savez(stream, impact=impact, positions=positions)
        with np.load(file) as saved:
            impact, positions = int(saved["impact"]), saved["positions"]
        mass = scene.sample().mass
        return cls(
            scene=scene,
            impact=impact,
            mass=mass,
            grids=TrueGrids(positions, mass, scene.resolution),
            transported=positions[list(TRANSPORTED)],
        )


def _simulated(scene: Scene) -> tuple[int, _Floats]:
    """Return the frame of the first impact, and the positions of all states (states, N, D) [m]."""
    truth = MpmSolver(scene, substeps="reference")
    impact = first_impact(truth, LONGEST_FALL)
    states = []
    for _ in range(SPAN // EVERY):
        truth.advance(EVERY)
        states.append(truth.positions)
    return impact, np.stack(states)
