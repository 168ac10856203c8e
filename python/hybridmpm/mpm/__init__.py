"""MLS-MPM on a scene: one solver, a batch of them, snapshot files and regions that sleep."""

from hybridmpm.mpm.batch import MpmBatch
from hybridmpm.mpm.sleep import Sleep
from hybridmpm.mpm.solver import MpmSolver, Substeps

__all__ = ["MpmBatch", "MpmSolver", "Sleep", "Substeps"]
