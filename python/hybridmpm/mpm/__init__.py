"""MLS-MPM on a scene: one solver, a batch of them, snapshot files and regions that sleep."""

from hybridmpm.mpm.batch import MpmBatch
from hybridmpm.mpm.sleep import Sleep
from hybridmpm.mpm.snapshots import Substeps
from hybridmpm.mpm.solver import MpmSolver

__all__ = ["MpmBatch", "MpmSolver", "Sleep", "Substeps"]
