"""What other threads may see of a simulation: records of one instant that never change."""

from dataclasses import dataclass
from typing import Literal

import numpy as np
import numpy.typing as npt

from hybridmpm.decisions import Mode
from hybridmpm_service.sessions.safeguard_record import Safeguard


@dataclass(frozen=True)
class Control:
    """A sketch that steers, and how far it has come."""

    kind: Literal["arrow", "ellipse"]
    """Kind of the sketch."""
    first_frame: int
    """Frame of the session at which the sketch began to steer."""
    frames_done: int
    """Number of frames that have been steered so far."""
    frames: int
    """Number of frames that the sketch steers in all."""
    force: npt.NDArray[np.float32]
    """External acceleration besides gravity [m/s^2], (D,) where it is one constant, else (frames, N, D).

    Of the planned trajectory nothing else is kept: its positions would fill the memory while a session waits.
    """

    @property
    def next_force(self) -> npt.NDArray[np.float32]:
        """Force of the next frame, (D,) or (N, D) [m/s^2]."""
        return self.force if self.force.ndim == 1 else self.force[self.frames_done]


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
    centroid: tuple[float, ...]
    """Centre of mass (D,) [m]."""
    control: Control | None
    """Sketch that steers the next frame; None where nothing steers."""
    last_frame: LastFrame | None
    """Report on the latest frame; None before the first."""
    mode: Mode
    """Simulator of the next frame: "mpm" or "neural"."""
    safeguard: Safeguard | None
    """Safeguard of a hybrid session; None in other sessions."""
    message: bytes
    """Binary frame for viewers, as docs/http-api.md describes it."""


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
