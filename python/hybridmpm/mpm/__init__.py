"""MLS-MPM on a scene: one solver, a batch of them, what a frame costs, and regions that sleep."""

from hybridmpm.mpm.batch import MpmBatch
from hybridmpm.mpm.cost import FrameCost, frame_cost
from hybridmpm.mpm.rigid import RigidBodies
from hybridmpm.mpm.sleep import Sleep
from hybridmpm.mpm.solver import MpmSolver, Substeps

__all__ = ["FrameCost", "MpmBatch", "MpmSolver", "RigidBodies", "Sleep", "Substeps", "frame_cost"]
