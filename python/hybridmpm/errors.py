"""Every error that hybridmpm raises on purpose; all descend from `SimulationError`. And its warnings.

Those of the solver come from the compiled core, those of scenes, sketches and files are added here.
"""

from collections.abc import Sequence

from hybridmpm._core import (
    BatchError,
    ConfigError,
    DomainError,
    FrameCancelledError,
    GraphSizeError,
    InvertedError,
    NonFiniteError,
    SimulationError,
    SnapshotError,
    StepSizeError,
)

__all__ = [
    "BatchError",
    "ConfigError",
    "DataError",
    "DomainError",
    "ExportError",
    "ForceError",
    "FrameCancelledError",
    "GraphSizeError",
    "InvertedError",
    "NonFiniteError",
    "SceneError",
    "SimulationError",
    "SketchError",
    "SnapshotError",
    "StepSizeError",
    "UnknownScenarioError",
]


class SceneError(ConfigError):
    """A scene is malformed; the message names each field and what it allows.

    Parameters
    ----------
    message : str
        One line for a reader.
    problems : sequence of (field, message)
        Each fault by its path in the scene, e.g. ("bodies[0].material.density", "must be ...").
        Empty where the fault belongs to no field, e.g. text that is not JSON.
    """

    problems: list[tuple[str, str]]

    def __init__(self, message: str, problems: Sequence[tuple[str, str]] = ()) -> None:
        super().__init__(message)
        self.problems = list(problems)

    @classmethod
    def of(cls, problems: Sequence[tuple[str, str]]) -> "SceneError":
        """Build the error whose message lists `problems`, as "field: message; field: message"."""
        return cls("; ".join(f"{field}: {text}" if field else text for field, text in problems), problems)


class ForceError(ConfigError):
    """A force has a wrong shape, is not finite, or its function raised; the message says what is allowed."""


class UnknownScenarioError(SceneError):
    """No scenario has this name; the message lists those there are."""


class SketchError(ConfigError):
    """A sketch cannot be read as one arrow or one ellipse; the message says what is allowed."""


class ExportError(SimulationError):
    """A result could not be written: unknown format, missing encoder or a folder that refuses it."""


class DataError(SimulationError, ValueError):
    """A data set is damaged, incomplete or foreign; the message names file and key."""


class CostlyMaterialWarning(UserWarning):
    """A body is so light or so stiff that each frame takes 200 substeps or more.

    Issued when a solver is built. Not an error: the frames are right, only slow.
    """


class RoundedWorldWarning(UserWarning):
    """The size of the world is no whole number of grid cells, so the grid reaches beyond it.

    The message says how far. Walls and obstacles stay where they are.
    """


class SoftMaterialWarning(UserWarning):
    """A material is so soft that its own weight compresses it by a tenth or more.

    It runs, and stably, but what settles loses its volume. The message names the bodies and says how stiff
    they should be.
    """


class ThinObstacleWarning(UserWarning):
    """An obstacle is thinner than half a grid cell, so that fast material may pass through it.

    Issued when a solver is built. Not an error: slow material respects a thin obstacle too.
    """


class CoarseWarning(UserWarning):
    """A scene is outside the bounds of its coarse level, or a frame was repeated at the safe step.

    The scene is faster than those that the level was fitted to, or an obstacle is thinner than a cell of its
    grid, for example. Frames are valid, but their errors may be larger than the table of levels says.
    """


class ReplayWarning(UserWarning):
    """A run that was computed again from its log ends in another state than before.

    The message says why: another version of the solver made the log, or the log was changed.
    """


class TornBodyWarning(UserWarning):
    """An elastic body has come apart: pieces of it are so far from each other that nothing joins them.

    Elastic solids have no strength of their own. They part where they are stretched until the particles share
    no grid nodes. The message names the body; `MpmSolver.torn_bodies` lists all.
    """
