"""What other threads may see of a simulation: records of one instant that never change."""

from dataclasses import dataclass
from typing import Literal, TypeAlias

import numpy as np
import numpy.typing as npt

from hybridmpm.decisions import Mode
from hybridmpm.stream_frames import FrameMessage
from hybridmpm_service.sessions.safeguard_record import Safeguard

Phase: TypeAlias = Literal["preparing", "steering", "out_of_reach", "holding", "done"]
"""Phase of a sketch. out_of_reach: as steering, but something is known to be in the way of the goal."""


@dataclass(frozen=True, kw_only=True)
class Control:
    """The newest sketch of a session, and how far it has come. What is not known yet is None."""

    number: int
    """Number of the sketch, counted from 1 in each session."""
    kind: Literal["arrow", "ellipse"]
    """Kind of the sketch."""
    phase: Phase
    method: str | None = None
    """Name of the method that steers."""
    first_frame: int | None = None
    """Frame of the session at which the sketch began to steer."""
    frames_done: int = 0
    """Number of frames that have been steered so far, those of `hold` included."""
    frames: int | None = None
    """Number of frames in which the goal is to be reached."""
    hold: int | None = None
    """Number of frames for which the goal is kept after that."""
    inside: float | None = None
    """Share of the mass in the goal after `frames` [-]; None where an arrow carries the shape along."""
    inside_drawn: float | None = None
    """Share of the mass in the oval as it was drawn, at the same time; None for an arrow."""
    miss: float | None = None
    """Distance of the centre of mass from where the sketch asks it to be, at the same time [m]."""


@dataclass(frozen=True)
class LastFrame:
    """Report on the computation of the latest frame."""

    substeps: int | None
    """Number of MPM's substeps; None where a network made the frame."""
    bound: str | None
    """Bound that chose the length of the substeps, such as "sound"; None where a network made the frame."""
    ms: float
    """Time that the simulator took [ms]."""


@dataclass(frozen=True)
class Timing:
    """Times that frames take, and the pace that results."""

    ms_per_frame: float
    """Median time that the simulator took for one of the latest frames [ms]; 0 before the first frame.

    A network does all the work of a step in the first of the step's frames. Its times are therefore means
    over as many frames as a step spans.
    """
    ms_p95: float
    """95th percentile of the same times [ms]."""
    time_scale: float
    """Simulated seconds per second, measured over the last second."""


@dataclass(frozen=True, kw_only=True, eq=False)
class View:
    """What other threads may see of a simulation, taken at one instant and never changed."""

    frame: int
    """Number of frames since the start."""
    time: float
    """Simulated time since the start [s]."""
    particles: int
    """Number N of particles."""
    centroid: tuple[float, ...] | None
    """Centre of mass (D,) [m]; None where there is no particle."""
    control: Control | None
    """Newest sketch that has steered or steers; None where there was none since frame 0."""
    last_frame: LastFrame | None
    """Report on the latest frame; None before the first."""
    mode: Mode
    """Simulator of the next frame: "mpm" or "neural"."""
    safeguard: Safeguard | None
    """Safeguard of a hybrid session; None in other sessions."""
    message: FrameMessage
    """Binary frame for viewers, as docs/reference/http-api.md describes it."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Particles:
    """The state of all particles at one instant."""

    frame: int
    """Number of frames since the start."""
    time: float
    """Simulated time since the start [s]."""
    positions: npt.NDArray[np.float32]
    """(N, D) [m]."""
    velocities: npt.NDArray[np.float32]
    """(N, D) [m/s]."""
    types: npt.NDArray[np.uint8]
    """DeepMind's particle types (N,): 5 water, 6 sand, 7 elastic (goop)."""
    ids: npt.NDArray[np.uint64]
    """Numbers (N,) that the particles keep for good, ascending."""
