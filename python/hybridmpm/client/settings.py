"""Settings of calls, by name: a setting that is absent takes the service's default."""

from typing import Literal, TypedDict


class SketchSettings(TypedDict, total=False):
    """Options of a sketch."""

    method: str
    """"auto", or a method of `hybridmpm.control.METHODS`."""
    frames: int
    """Number of frames in which the goal is to be reached."""
    cap: float
    """Largest acceleration of a particle, in (0, 1000] [g]."""
    strength: float
    """Factor on `cap`, in (0, 1]."""
    hold: int
    """Number of frames for which the goal is kept."""
    fill: Literal["even", "shrink"]
    """Filling of an oval that is larger than the fluid."""
    seed: int
    """Seed of what a method draws at random, in [0, 2^32)."""


class RecordingSettings(TypedDict, total=False):
    """Content and look of a recording."""

    every: int
    """Number of frames from one recorded state to the next."""
    format: Literal["npz", "gif", "mp4", "png"]
    """File to write."""
    width: int
    """Width of a picture, in [64, 1280] [pixels]."""
    speed: float
    """Simulated seconds in a second of film, in [0.01, 10]."""


class DataSetSettings(TypedDict, total=False):
    """Content of a data set besides its training split."""

    valid: int
    """Number of trajectories for validation."""
    test: int
    """Number of trajectories for tests."""
    seed: int
    """First seed of each split, counted from the start of the split's seeds."""
    frames: int
    """Number of frames of a trajectory."""
    stride: int
    """Number of frames from one stored state to the next."""
    r_p: float
    """Number of particles over that of the scene, in (0, 1]."""


class SimulatorSettings(TypedDict, total=False):
    """Simulator of a new session."""

    solver: Literal["mpm", "hybrid", "neural"]
    coarse: str
    """Share of the particles that MPM simulates, from "1/64" to "1/4"; all particles are shown."""
    model: str
    """Name of a network."""
    r_c: float
    """Value below which the safeguard alarms, in [-1, 1]."""


class PlanSettings(TypedDict, total=False):
    """Bound of a plan: `max_error` or `budget_ms`."""

    max_error: float
    """Largest mean error."""
    budget_ms: float
    """Longest time of a frame [ms]."""
    measure: str
    """Measure of the error; "grid_rmse" if absent."""
