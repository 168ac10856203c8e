"""Real-time, interactive particle fluids: scenes, an MLS-MPM solver and errors between states.

The names in `__all__` are public, and so are the modules among them; the rest may move.
"""

from hybridmpm import control, data, downsampling, hybrid, metrics, physics, scenarios
from hybridmpm._native import (
    Diagnostics,
    FrameReport,
    PaddedGraph,
    RadiusGraph,
    VerletList,
    __version__,
    radius_graph,
)
from hybridmpm.batch import MpmBatch
from hybridmpm.errors import (
    BatchError,
    ConfigError,
    DataError,
    DomainError,
    ExportError,
    GraphSizeError,
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
from hybridmpm.hybrid import HybridSimulator
from hybridmpm.materials import Elastic, Sand, Water
from hybridmpm.motion import Motion
from hybridmpm.mpm import MpmSolver
from hybridmpm.physics import NeuralPhysics
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
from hybridmpm.sources import (
    BallSink,
    BoxSink,
    ParticleLimitWarning,
    RectangularEmitter,
    RoundEmitter,
)

__all__ = [
    "Ball",
    "BallObstacle",
    "BallSink",
    "BatchError",
    "Box",
    "BoxObstacle",
    "BoxSink",
    "ConfigError",
    "DataError",
    "Diagnostics",
    "DomainError",
    "Elastic",
    "ExportError",
    "FrameReport",
    "GraphSizeError",
    "HalfSpaceObstacle",
    "HybridSimulator",
    "InvertedError",
    "Motion",
    "MpmBatch",
    "MpmSolver",
    "NeuralPhysics",
    "NonFiniteError",
    "PaddedGraph",
    "ParticleLimitWarning",
    "Particles",
    "Polygon",
    "RadiusGraph",
    "RectangularEmitter",
    "RoundEmitter",
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
    "VerletList",
    "Walls",
    "Water",
    "__version__",
    "control",
    "data",
    "downsampling",
    "hybrid",
    "metrics",
    "physics",
    "radius_graph",
    "scenarios",
]
