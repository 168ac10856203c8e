"""`ControlledTrajectory`: the motion and the forces of a followed sketch."""

from dataclasses import dataclass
from typing import Literal

import numpy as np
import numpy.typing as npt

from hybridmpm.control.goal.cloud import Floats
from hybridmpm.control.goal.region import FULL

Ending = Literal["done", "cancelled", "superseded", "failed"]
"""End of a followed sketch. superseded: another caller advanced or reset the simulator."""


@dataclass(frozen=True)
class SketchResult:
    """Distance from the goal, of the particles that were there at the start."""

    inside: float | None
    """Share of the mass in the goal at the end of the sketch's frames; None where the fluid keeps its shape
    along an arrow."""
    inside_drawn: float | None
    """Share of the mass in the oval as it was drawn, in 3D in the front view, at that time; None for an
    arrow."""
    miss: float
    """Distance of the centre of mass at that time from the tip, or from the middle of the oval's goal [m]."""
    rms: float
    """Root mean square of the force over mass and time, the frames of `hold` left out [g]."""
    peak: float
    """Largest force on a particle [g]."""
    near: float
    """Largest `miss` at which the end counts as reached, 1 % of the longest side of the world [m]."""
    fills: bool = True
    """Whether the method fills the goal. Learned plans do not: they give the fluid the middle and the extent
    that the sketch tells, in the shape that it may have had there."""

    @property
    def goal(self) -> bool:
        """Whether the drawn end was reached.

        The centre of mass is `near`, and where the method fills the goal, 95 % of the mass is in it.
        """
        return self.miss <= self.near and (not self.fills or self.inside is None or self.inside >= FULL)

    def __str__(self) -> str:
        parts = []
        if self.inside is not None:
            parts.append(f"{100 * self.inside:.1f} % of the mass in the goal")
        if self.inside_drawn is not None:
            parts.append(f"{100 * self.inside_drawn:.1f} % in the goal as drawn")
        parts.append(f"centre of mass {1000 * self.miss:.1f} mm off")
        return ", ".join([*parts, f"force {self.rms:.2f} g rms, {self.peak:.1f} g at most"])


@dataclass(frozen=True, eq=False)
class ControlledTrajectory:
    """Motion of particles under the force that followed a sketch.

    N is the number of particles at the start, D the dimension, T the number of frames that were computed.
    """

    ids: npt.NDArray[np.uint64]
    """Numbers (N,) of the particles."""
    positions: npt.NDArray[np.float32]
    """Positions (T + 1, N, D) [m]; row 0 is the state at the start. NaN for particles that are gone."""
    force: npt.NDArray[np.float32]
    """External acceleration besides gravity [m/s^2], in a form that `Simulator.advance` takes over T frames:
    (D,) where it is one constant, else (T, N, D). Where not all particles are led it takes (ids, force)."""
    mean_force: Floats
    """Mean of `force` over the mass of the particles, in each frame, (T, D) [m/s^2]."""
    target_displacement: Floats
    """Displacement of the centre of mass in the sketch, (D,) [m]."""
    displacement: Floats
    """Displacement of the centre of mass over the T frames, (D,) [m]."""
    centroids: Floats
    """Centre of mass at the start and after each frame, (T + 1, D) [m]."""
    first_frame: int
    """Frame number of the simulator at the start."""
    reached: SketchResult
    """Distance from the goal."""
    ending: Ending
    """End of the run."""
    passed: tuple[SketchResult, ...] = ()
    """Distances from the goals of several in turn, each at its time."""

    def __repr__(self) -> str:
        run = f"{len(self.ids)} particles, {self.frames} frames from frame {self.first_frame}"
        return f"ControlledTrajectory({run}, {self.ending}: {self.reached})"

    @property
    def frames(self) -> int:
        """Number T of frames."""
        return len(self.positions) - 1

    def force_at(self, index: int) -> npt.NDArray[np.float32]:
        """Return the force (D,) or (N, D) [m/s^2] of a frame; the first frame has `index` 0.

        `simulator.advance(T, trajectory.force)` from the state at the start gives `positions` bit for bit,
        and so does `simulator.advance(1, trajectory.force_at(index))` for each frame in turn.
        """
        return self.force if self.force.ndim == 1 else self.force[index]
