"""The truth of training and test scenes, and the errors of a solver against it."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

from hybridmpm import SOLVER_VERSION, scenarios
from hybridmpm._support.files import replacing
from hybridmpm.metrics import density_percentile, sliced_distance
from hybridmpm.mpm import MpmSolver
from hybridmpm.planner.calibrating.impact import LONGEST_FALL, first_impact
from hybridmpm.scene import Scene
from hybridmpm_lab.harness.grid import TrueGrids
from hybridmpm_lab.harness.rows import EVERY

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
        """Read the truth of a scene from a folder, or simulate it and save it there."""
        scene = scenarios.get(scenario, seed)
        file = folder / f"{scenario}-{seed}-v{SOLVER_VERSION}.npz"
        if not file.exists():
            impact, positions = _simulated(scene)
            with replacing(file) as part, part.open("wb") as stream:
                np.savez(stream, impact=impact, positions=positions)
        with np.load(file) as saved:
            impact, positions = int(saved["impact"]), saved["positions"]
        mass = scene.sample().mass
        grids = TrueGrids(positions, mass, scene.resolution)
        return cls(scene, impact, mass, grids, positions[list(TRANSPORTED)])


@dataclass(frozen=True, kw_only=True)
class Outcome:
    """Errors and costs of a run."""

    error: float
    """grid_rmse, mean over the states [-]."""
    transport: float
    """Sliced Wasserstein distance to the truth [m], mean of the states in `TRANSPORTED`."""
    density: float
    """99th percentile of the density at the shown particles over that at rest, in the last state [-]."""
    substeps: float
    """Substeps of a frame."""
    simulated: int
    """Simulated particles."""
    redone: int
    """Frames that were repeated at the safe step."""


def measure(case: Case, solver: MpmSolver) -> Outcome:
    """Run a solver at frame 0 over the frames of a case; raises `SimulationError` where a frame fails."""
    mass = solver.mass
    errors, transports, substeps = [], [], []
    solver.advance(case.impact)
    for row in range(SPAN // EVERY):
        solver.advance(EVERY)
        x = solver.positions
        errors.append(case.grids.rmse(row, x, mass))
        if row in TRANSPORTED:
            true = case.transported[TRANSPORTED.index(row)]
            transports.append(float(sliced_distance(x, mass, true, case.mass)))
        substeps.append(solver.last_frame.substeps if solver.last_frame else 0)
    rest = {material.type_id: material.density for material in solver.scene.materials}
    volumes = mass / np.array([rest[kind] for kind in solver.materials.tolist()])
    return Outcome(
        error=float(np.mean(errors)),
        transport=float(np.mean(transports)),
        density=float(density_percentile(solver.positions, volumes, solver.scene.resolution)),
        substeps=float(np.mean(substeps)),
        simulated=len(solver.coarse_positions),
        redone=len(solver.redone_frames),
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
