"""Real-time, interactive particle fluids: scenes, an MLS-MPM solver and errors between states.

The names in `__all__` are public, and so are the modules among them; the rest may move.
"""

from hybridmpm import control, data, metrics, scenarios
from hybridmpm._native import Diagnostics, FrameReport, RadiusGraph, __version__, radius_graph
from hybridmpm.batch import MpmBatch
from hybridmpm.errors import (
    BatchError,
    ConfigError,
    DataError,
    DomainError,
    ExportError,
    InvertedError,
    NonFiniteError,
    SceneError,
    SimulationError,
    SketchError,
    SnapshotError,
    StepSizeError,
    ThinObstacleWarning,
    UnknownScenarioError,
)
from hybridmpm.materials import Elastic, Sand, Water
from hybridmpm.motion import Motion
from hybridmpm.mpm import MpmSolver
from hybridmpm.sampling import Particles
from hybridmpm.scene import Scene, Walls
from hybridmpm.shapes import (
    Ball,
    BallObstacle,
    Box,
    BoxObstacle,
    HalfSpaceObstacle,
    Polygon,
    SegmentObstacle,
)
from hybridmpm.sleep import Sleep

__all__ = [
    "Ball",
    "BallObstacle",
    "BatchError",
    "Box",
    "BoxObstacle",
    "ConfigError",
    "DataError",
    "Diagnostics",
    "DomainError",
    "Elastic",
    "ExportError",
    "FrameReport",
    "HalfSpaceObstacle",
    "InvertedError",
    "Motion",
    "MpmBatch",
    "MpmSolver",
    "NonFiniteError",
    "Particles",
    "Polygon",
    "RadiusGraph",
    "Sand",
    "Scene",
    "SceneError",
    "SegmentObstacle",
    "SimulationError",
    "SketchError",
    "Sleep",
    "SnapshotError",
    "StepSizeError",
    "ThinObstacleWarning",
    "UnknownScenarioError",
    "Walls",
    "Water",
    "__version__",
    "control",
    "data",
    "metrics",
    "radius_graph",
    "scenarios",
]
