"""Laws: functions from the state before a frame to the force in it. All of them are plain data."""

import copy
import dataclasses
from dataclasses import dataclass
from typing import Any, ClassVar, Protocol, Self, TypedDict

import numpy as np
import numpy.typing as npt

from hybridmpm import _core
from hybridmpm.control.diffusion.law import Diffused
from hybridmpm.control.goal.cloud import Cloud, Floats
from hybridmpm.control.goal.paths import Motion
from hybridmpm.control.goal.room import RoomGrid
from hybridmpm.errors import SnapshotError
from hybridmpm.simulator import Simulator

Floats32 = npt.NDArray[np.float32]
OfIds = tuple[npt.NDArray[np.uint64], Floats32]

_AHEAD_FRAMES = 24
"""Distance ahead at which the force aims on a path with corners [frames]."""
BANDWIDTH = (100.0, 300.0)
"""Rate at which an error of the position decays, at the start and at the end [1/s]."""
_VELOCITY = 1.0
"""Weight of an error of the velocity, over that of an error of the position [-]."""
_ARRIVAL = 100.0
"""Weight of the last position over that of those before it [-]."""
_ROUNDING = 2.0**-22
"""Relative reduction of forces at the cap, so that float32 does not round them up beyond it [-]."""
_HALF = 0.5
"""Part of a frame's gain in velocity with which a particle moves in the frame, if the force is steady."""


@dataclass(frozen=True, eq=False)
class Retraced:
    """The force a = aim - k_x x - k_u u that keeps each particle on its path, from its actual state.

    The paper's eq. 2 closes in each frame the whole gap to the next position. But a constant force over a
    frame moves a particle by a dt^2 / 2 only. The remaining gap returns twice with the other sign, and the
    force grows to hundreds of g. This law minimises the sum of

        w^4 |x - q|^2 + w^2 |u - v|^2 + |a|^2

    over all frames instead, with a hundred times the weight on the last position. q and v are the path's
    positions and their rates of change, w is `BANDWIDTH`. A jump of the velocity, as at an impact, is spread
    over about 1 / w on both sides. Opposite velocities at the start are reversed within a few 1 / w. Pressure
    and friction are not in the plan; they act through x and u, which are those of the simulator.

    References
    ----------
    Anderson and Moore, Optimal Control: Linear Quadratic Methods, 1990, chapter 4.
    """

    name: ClassVar[str] = "retraced"
    aim: npt.NDArray[np.float32]
    """(T, N, D) [m/s^2]."""
    gains: Floats
    """k_x [1/s^2] and k_u [1/s] of each frame (T, 2)."""
    end: npt.NDArray[np.float32]
    """Last positions (N, D) [m], which are kept after the T frames."""
    gravity: Floats
    """(D,) [m/s^2]."""
    cap: float
    """Largest acceleration [m/s^2]; larger ones are clipped to it."""

    @classmethod
    def along(cls, way: Floats, *, frame_dt: float, gravity: Floats, cap: float) -> Self:
        """Return the law of a path.

        Parameters
        ----------
        way : (T + 1, N, D)
            Positions after each frame [m], the start first.
        frame_dt : float
            Length of a frame [s].
        gravity : (D,)
            [m/s^2]
        cap : float
            [m/s^2]
        """
        frames = len(way) - 1
        velocities = np.gradient(way, frame_dt, axis=0)
        step = np.array([[1.0, frame_dt], [0.0, 1.0]])
        push = frame_dt * np.array([_HALF * frame_dt, 1.0])
        bandwidth = np.geomspace(*BANDWIDTH, frames + 1)
        weights = np.stack([bandwidth**4, _VELOCITY * bandwidth**2], axis=1)
        ahead = np.diag(weights[-1] * [_ARRIVAL, 1.0])
        # The remaining cost is z' P z - 2 z' p of the present state z = (x, u); P is `ahead`, p is `pull`.
        pull = [ahead[0, 0] * way[-1], ahead[1, 1] * velocities[-1]]
        aim, gains = np.empty((frames, *way.shape[1:]), np.float32), np.empty((frames, 2))
        for frame in reversed(range(frames)):
            answer = ahead @ push / (1.0 + push @ ahead @ push)
            gains[frame] = answer @ step
            falling = np.outer(ahead @ push, gravity)
            pull = [pull[0] - falling[0], pull[1] - falling[1]]
            share = push / (1.0 + push @ ahead @ push)
            aim[frame] = share[0] * pull[0] + share[1] * pull[1]
            closed = step - np.outer(push, gains[frame])
            wanted = weights[frame]
            pull = [
                closed[0, 0] * pull[0] + closed[1, 0] * pull[1] + wanted[0] * way[frame],
                closed[0, 1] * pull[0] + closed[1, 1] * pull[1] + wanted[1] * velocities[frame],
            ]
            ahead = np.diag(wanted) + step.T @ ahead @ closed
        return cls(aim=aim, gains=gains, end=way[-1].astype(np.float32), gravity=np.asarray(gravity), cap=cap)

    def force(self, simulator: Simulator, index: int) -> npt.NDArray[np.float32]:
        """Return (N, D)."""
        x, u = simulator.positions.astype(np.float64), simulator.velocities.astype(np.float64)
        if index < len(self.aim):
            k_x, k_u = self.gains[index]
            wanted = self.aim[index] - k_x * x - k_u * u
        else:
            k_x, k_u = self.gains[0]
            wanted = k_x * (self.end - x) - k_u * u - self.gravity
        size = np.sqrt((wanted**2).sum(axis=1, keepdims=True))
        largest = self.cap * (1 - _ROUNDING)
        return np.asarray(wanted * np.minimum(1.0, largest / np.maximum(size, 1e-12)), dtype=np.float32)


def is_whole(simulator: Simulator, count: int) -> bool:
    """Return whether `count` particles that are led are all that there are, always."""
    return not simulator.scene.is_open and count == simulator.particle_count


class Law(Protocol):
    """The force of each frame: a dataclass of arrays and numbers, so that a snapshot can contain it."""

    name: ClassVar[str]
    """Name of the law in a snapshot."""

    def force(self, simulator: Simulator, index: int) -> Floats32 | OfIds | None:
        """Return the force of the next frame in a form that `Simulator.advance` takes for one frame.

        Parameters
        ----------
        simulator : Simulator
            In the state before the frame.
        index : int
            Number of frames since the start.
        """


@dataclass(frozen=True, eq=False)
class Unforced:
    """No force at all."""

    name: ClassVar[str] = "unforced"

    def force(self, simulator: Simulator, index: int) -> None:
        """Return None."""


@dataclass(frozen=True, eq=False)
class Uniform:
    """The same acceleration for all particles that are led, in all frames."""

    name: ClassVar[str] = "uniform"
    acceleration: Floats32
    """(D,) [m/s^2]."""
    ids: npt.NDArray[np.uint64]
    """Particles (N,) that are led."""

    def force(self, simulator: Simulator, index: int) -> Floats32 | OfIds:  # noqa: ARG002 - always the same
        """Return (D,), or a pair where not all particles are led."""
        if is_whole(simulator, len(self.ids)):
            return self.acceleration
        return self.ids, np.tile(self.acceleration, (len(self.ids), 1))


class Settling(TypedDict, total=False):
    """Region in which particles are given places anew, as `_core.Ways` takes it."""

    cells: Floats
    side: float
    settling: tuple[int, int]


@dataclass(frozen=True, eq=False)
class Tracked:
    """The force that keeps particles on timed paths, from their actual states; see `_core.Ways`."""

    name: ClassVar[str] = "tracked"
    ways: _core.Ways

    @classmethod
    def along(
        cls,
        motion: Motion,
        cloud: Cloud,
        *,
        cells: int,
        cap: float,
        grid: RoomGrid | None,
        unit: float = 1.0,
        settling: Settling | None = None,
    ) -> Self:
        """Return the law of a motion.

        Parameters
        ----------
        motion : Motion
        cloud : Cloud
            The particles that are led.
        cells : int
            Cells along the longest side of the world of the grid on which the force is smoothed, or 0.
        cap : float
            Largest acceleration [m/s^2].
        grid : RoomGrid, optional
            The room, for paths around obstacles.
        unit : float
            Longest side of the world [m].
        settling : Settling, optional
            Region in which particles are given places anew at the end.
        """
        paths = motion.paths
        ways = _core.Ways(
            ids=cloud.ids,
            weight=cloud.weight,
            starts=paths.starts,
            times=motion.times,
            corners=paths.corners,
            v=motion.v,
            group=paths.group,
            places=paths.places,
            end=None if paths.end is None else paths.end.tolist(),
            gravity=cloud.gravity.tolist(),
            frame_dt=cloud.frame_dt,
            smoothing=cells,
            cap=cap,
            ahead=_AHEAD_FRAMES,
            unit=unit,
            lower=None if grid is None else grid.lower.tolist(),
            spacing=0.0 if grid is None else grid.spacing,
            distance=None if grid is None else grid.distance,
            **(Settling() if settling is None else settling),
        )
        return cls(ways)

    @property
    def places(self) -> Floats:
        """Ends of the particles' paths (N, D) [m]."""
        return self.ways.places

    def own(self) -> Self:
        """Return the law for a copy of the simulator, which may go another way.

        A law that leads into a shape keeps places that it matched on the way.
        """
        return dataclasses.replace(self, ways=copy.copy(self.ways)) if self.ways.settles else self

    def force(self, simulator: Simulator, index: int) -> Floats32 | OfIds:
        """Return (N, D), or a pair where not all particles are led."""
        ids = simulator.ids
        rows, force = self.ways.force(index, ids, simulator.positions, simulator.velocities)
        if is_whole(simulator, self.ways.count):
            return force
        return ids if rows is None else ids[rows], force


LAWS: dict[str, type[Unforced | Uniform | Tracked | Retraced | Diffused]] = {
    law.name: law for law in (Unforced, Uniform, Tracked, Retraced, Diffused)
}
"""Laws of the library by name."""


def law_to_dict(law: Law) -> dict[str, Any]:
    """Return a law as plain data.

    Raises
    ------
    SnapshotError
        The law is not one of the library's.
    """
    if type(law) is not LAWS.get(law.name):
        raise SnapshotError(f"a law of your own, {type(law).__name__}, cannot be kept in a snapshot")
    fields = dict(vars(law))
    if isinstance(law, Tracked):
        fields = {"dim": law.ways.dim, "ways": law.ways.to_bytes()}
    return {"name": law.name, "fields": fields}


def law_from_dict(data: dict[str, Any]) -> Law:
    """Return the law of plain data of `law_to_dict`."""
    fields = data["fields"]
    if data["name"] == Tracked.name:
        return Tracked(_core.Ways.from_bytes(fields["ways"], fields["dim"]))
    return LAWS[data["name"]](**fields)
