"""`Method`: the surface of all methods of following a sketch."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

from hybridmpm.control.goal.cloud import EARTH
from hybridmpm.control.goal.goal import Goal
from hybridmpm.control.goal.paths import Paths
from hybridmpm.control.goal.region import Fill
from hybridmpm.control.laws import Law, Settling, Tracked
from hybridmpm.simulator import Simulator


@dataclass(frozen=True, eq=False)
class Task:
    """The task of a method."""

    goal: Goal
    frames: int
    """Number of frames in which the goal is to be reached."""
    hold: int
    """Number of frames for which the goal is kept after that."""
    fill: Fill
    """Filling of an oval larger than the fluid."""
    cap: float
    """Largest acceleration besides gravity [g]."""
    resolution: int
    """Cells along the longest side of the world of the grid on which a force is smoothed; 0 leaves it as it
    is."""
    seed: int
    """Seed of the random numbers of a method."""
    on_frame: Callable[[], object]
    """Called before each frame of a trial; an exception that it raises ends the planning."""

    @property
    def cap_si(self) -> float:
        """`cap` in m/s^2."""
        return self.cap * EARTH

    def tracked(self, paths: Paths, *, share: float = 1.0, settling: Settling | None = None) -> Tracked:
        """Return the law that leads the particles along paths, within a share of the frames of the task.

        `settling` is as of `Tracked.along`.
        """
        cloud = self.goal.cloud
        return Tracked.along(
            paths.timed(share * self.frames * cloud.frame_dt),
            cloud,
            cells=self.resolution,
            cap=self.cap_si,
            grid=self.goal.room.grid(),
            unit=self.goal.room.unit,
            settling=settling,
        )


class FallBack(Exception):  # noqa: N818 - no error: another method is better for the task
    """Raised by a method that leaves a task to analytic control; the message says why."""


class Method(Protocol):
    """Finds the law that follows a sketch.

    An object with this surface may be given to `follow` in place of a name, e.g. one that plays back recorded
    forces.
    """

    @property
    def name(self) -> str:
        """Name of the method in results."""

    def plan(self, simulator: Simulator, task: Task) -> Law:
        """Return the law for a task; the simulator, in the state of the task's cloud, must not change.

        Raises
        ------
        SimulationError
            No law was found.
        FallBack
            Analytic control is to find the law.
        """
