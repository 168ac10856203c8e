"""`Needs`: what it takes to follow a sketch, and what is in the way. Known before anything moves."""

from dataclasses import dataclass
from typing import Literal

Reason = Literal["wall", "obstacle", "time", "cap"]


@dataclass(frozen=True)
class Obstruction:
    """Why a goal is out of reach."""

    reason: Reason
    """wall: no room between the walls. obstacle: no way leads there. time: the frames are too few for the
    cap. cap: no number of frames is enough."""
    message: str
    """What is in the way, and what would help."""


@dataclass(frozen=True)
class Needs:
    """What it takes to follow a sketch. Accelerations are in g = 9.81 m/s^2 and come on top of gravity."""

    acceleration: float
    """Largest acceleration that 95 % of the mass needs, if it goes its way with the least force."""
    peak: float
    """Largest acceleration that any group of particles needs."""
    rms: float
    """Root mean square of the least force over mass and time: no force can do with less."""
    cap: float
    """Largest acceleration that is allowed."""
    frames: int
    """Number of frames in which the goal is to be reached."""
    suggested_frames: int
    """Fewest frames, in steps of 5 from 40 to 400, in which the goal is reached with ease."""
    scale: float
    """Size of the goal over that of the drawn oval: above 1 if it was grown to the fluid's volume, below 1 if
    it was shrunk to it, 1 for an arrow."""
    taken: float
    """Share of the drawn oval that walls and obstacles take; 0 for an arrow."""
    obstructions: tuple[Obstruction, ...]
    """Why the goal is out of reach; empty if it is within."""

    @property
    def reachable(self) -> bool:
        """Whether nothing is known to be in the way."""
        return not self.obstructions

    def __str__(self) -> str:
        need = f"{self.acceleration:.1f} g in {self.frames} frames, of {self.cap:g} g allowed"
        lines = [need, f"at ease in {self.suggested_frames} frames"]
        if self.scale != 1:
            lines.append(
                f"the oval is {'grown' if self.scale > 1 else 'shrunk'} to {self.scale:.2f} times its size"
            )
        if self.taken > 0:
            lines.append(f"walls and obstacles take {100 * self.taken:.0f} % of the oval")
        return "; ".join(lines + [obstruction.message for obstruction in self.obstructions])
