"""`measure`: how well a solver of few particles does on a case, and at what price."""

from dataclasses import dataclass

import numpy as np

from hybridmpm.metrics import density_percentile, sliced_distance
from hybridmpm.mpm import MpmSolver
from hybridmpm_lab.harness.rows import EVERY
from hybridmpm_lab.fitting.cases import SPAN, TRANSPORTED, Case


@dataclass(frozen=True, kw_only=True)
class Outcome:
    """What a run showed."""

    error: float
    """grid_rmse, mean over the states [-]."""
    transport: float
    """Sliced Wasserstein distance to the truth [m], mean of the states in `TRANSPORTED`."""
    density: float
    """99th percentile of the density at the particles shown over that at rest, in the last state [-]."""
    substeps: float
    """Substeps of a frame."""
    simulated: int
    """Particles that are simulated."""
    redone: int
    """Frames that were done again at the safe step."""


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
            known = case.transported[TRANSPORTED.index(row)]
            transports.append(float(sliced_distance(x, mass, known, case.mass)))
        substeps.append(solver.last_frame.substeps if solver.last_frame else 0)
    return Outcome(
        error=float(np.mean(errors)),
        transport=float(np.mean(transports)),
        density=highest_density(solver),
        substeps=float(np.mean(substeps)),
        simulated=len(solver.coarse_positions),
        redone=len(solver.redone_frames),
    )


def highest_density(solver: MpmSolver) -> float:
    """Return the 99th percentile of the density at the particles shown, over that at rest [-]."""
    rest = {material.type_id: material.density for material in solver.scene.materials}
    volumes = solver.mass / np.array([rest[kind] for kind in solver.materials.tolist()])
    return float(density_percentile(solver.positions, volumes, solver.scene.resolution))
