"""Real-time, interactive particle fluids: scenes, an MLS-MPM solver and errors between states.

The names in `__all__` are public, and so are the modules among them; the rest may move. What a scene and MPM
do not need is imported when it is first used.
"""

from importlib import import_module as _import_module
from typing import TYPE_CHECKING as _TYPE_CHECKING
from typing import Any as _Any

from hybridmpm import coarse, probes, recording, scenarios
from hybridmpm._core import (
    SOLVER_VERSION,
    CancelFlag,
    Diagnostics,
    FrameReport,
    RadiusGraph,
    __version__,
    radius_graph,
)
from hybridmpm._support.machine import usable_cores
from hybridmpm.errors import (
    BatchError,
    CoarseWarning,
    ConfigError,
    CostlyMaterialWarning,
    DataError,
    DomainError,
    ExportError,
    ForceError,
    FrameCancelledError,
    GraphSizeError,
    InvertedError,
    NonFiniteError,
    ReplayWarning,
    RoundedWorldWarning,
    SceneError,
    SimulationError,
    SketchError,
    SnapshotError,
    SoftMaterialWarning,
    StepSizeError,
    ThinObstacleWarning,
    TornBodyWarning,
    UnknownScenarioError,
)
from hybridmpm.mpm import MpmBatch, MpmSolver, RigidBodies, Sleep
from hybridmpm.scene import (
    Ball,
    BallObstacle,
    BallSink,
    Box,
    BoxObstacle,
    BoxSink,
    Cylinder,
    CylinderObstacle,
    Elastic,
    HalfSpaceObstacle,
    Liquid,
    Mesh,
    MeshObstacle,
    Motion,
    ParticleLimitWarning,
    Particles,
    Polygon,
    PolygonObstacle,
    RectangularEmitter,
    RigidBall,
    RigidBox,
    RigidCylinder,
    RigidHull,
    RoundEmitter,
    Sand,
    Scene,
    SegmentObstacle,
    Wall,
    WallFaces,
    Walls,
    Water,
    World,
)
from hybridmpm.simulator import Simulator

if _TYPE_CHECKING:
    from hybridmpm import control, data, hybrid, metrics, physics, planner, simulators
    from hybridmpm.checking import SceneCheck, check
    from hybridmpm.hybrid import HybridSimulator
    from hybridmpm.physics import NeuralPhysics
    from hybridmpm.planner import AutoSolver, CalibrationWarning, Plan, plan
    from hybridmpm.playing import play
    from hybridmpm.replaying import replay
    from hybridmpm.simulators import load

__all__ = [
    "SOLVER_VERSION",
    "AutoSolver",
    "Ball",
    "BallObstacle",
    "BallSink",
    "BatchError",
    "Box",
    "BoxObstacle",
    "BoxSink",
    "CalibrationWarning",
    "CancelFlag",
    "CoarseWarning",
    "ConfigError",
    "CostlyMaterialWarning",
    "Cylinder",
    "CylinderObstacle",
    "DataError",
    "Diagnostics",
    "DomainError",
    "Elastic",
    "ExportError",
    "ForceError",
    "FrameCancelledError",
    "FrameReport",
    "GraphSizeError",
    "HalfSpaceObstacle",
    "HybridSimulator",
    "InvertedError",
    "Liquid",
    "Mesh",
    "MeshObstacle",
    "Motion",
    "MpmBatch",
    "MpmSolver",
    "NeuralPhysics",
    "NonFiniteError",
    "ParticleLimitWarning",
    "Particles",
    "Plan",
    "Polygon",
    "PolygonObstacle",
    "RadiusGraph",
    "RectangularEmitter",
    "ReplayWarning",
    "RigidBall",
    "RigidBodies",
    "RigidBox",
    "RigidCylinder",
    "RigidHull",
    "RoundEmitter",
    "RoundedWorldWarning",
    "Sand",
    "Scene",
    "SceneCheck",
    "SceneError",
    "SegmentObstacle",
    "SimulationError",
    "Simulator",
    "SketchError",
    "Sleep",
    "SnapshotError",
    "SoftMaterialWarning",
    "StepSizeError",
    "ThinObstacleWarning",
    "TornBodyWarning",
    "UnknownScenarioError",
    "Wall",
    "WallFaces",
    "Walls",
    "Water",
    "World",
    "__version__",
    "check",
    "coarse",
    "control",
    "data",
    "hybrid",
    "load",
    "metrics",
    "physics",
    "plan",
    "planner",
    "play",
    "probes",
    "radius_graph",
    "recording",
    "replay",
    "scenarios",
    "simulators",
    "usable_cores",
]

_ROOMS_ON_DEMAND = ("control", "data", "hybrid", "metrics", "physics", "planner", "simulators")
_NAMES_ON_DEMAND = {
    "AutoSolver": "planner",
    "CalibrationWarning": "planner",
    "HybridSimulator": "hybrid",
    "NeuralPhysics": "physics",
    "Plan": "planner",
    "SceneCheck": "checking",
    "check": "checking",
    "load": "simulators",
    "plan": "planner",
    "play": "playing",
    "replay": "replaying",
}
"""Room that has each name."""

if not _TYPE_CHECKING:  # a type checker would take any name to be there

    def __getattr__(name: str) -> _Any:
        if name in _ROOMS_ON_DEMAND:
            return _import_module(f"hybridmpm.{name}")
        if name in _NAMES_ON_DEMAND:
            return getattr(_import_module(f"hybridmpm.{_NAMES_ON_DEMAND[name]}"), name)
        from hybridmpm._support.suggestions import did_you_mean  # noqa: PLC0415 - of use to mistakes alone

        near = did_you_mean(name, __all__)
        raise AttributeError(f"module 'hybridmpm' has no attribute {name!r}{near}", name=name)


def __dir__() -> list[str]:
    return sorted(__all__)
