"""Laws: functions from the state before a frame to the force in it. All of them are plain data."""

import dataclasses
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, ClassVar, Protocol, Self

import numpy as np
import numpy.typing as npt

from hybridmpm import _core
from hybridmpm.control.diffusion.law import Diffused
from hybridmpm.control.goal.cloud import Cloud, Floats
from hybridmpm.control.goal.paths import SHORTEST_FRAMES, Motion, Paths
from hybridmpm.control.goal.room import RoomGrid
from hybridmpm.errors import SnapshotError
from hybridmpm.force import locate
from hybridmpm.simulator import Simulator

Floats32 = npt.NDArray[np.float32]
OfIds = tuple[npt.NDArray[np.uint64], Floats32]

ANEW = 20
"""Frames after which particles are given places in a shape anew."""
AHEAD_FRAMES = 24
"""`Tracked.ahead` if none is given."""
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


@dataclass(frozen=True, eq=False)
class Tracked:
    """The force that keeps particles on timed paths, from their actual states; see `_core.Tracks`."""

    name: ClassVar[str] = "tracked"
    ids: npt.NDArray[np.uint64]
    """Particles (N,) that are led, ascending."""
    starts: npt.NDArray[np.uint32]
    times: Floats32
    x: Floats32
    v: Floats32
    path: npt.NDArray[np.uint32]
    offset: Floats32
    weight: Floats32
    """Mass of each particle over that of all (N,) [-]."""
    gravity: Floats32
    frame_dt: float
    cells: int
    cap: float
    room: dict[str, Any] | None
    """Fields of a `RoomGrid`, for paths around obstacles; None without obstacles."""
    unit: float = 1.0
    """Longest side of the world [m]; the tracks are computed in such lengths."""
    ahead: int = AHEAD_FRAMES
    """Distance ahead at which the force aims on a path with corners [frames]."""

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
        ahead: int = AHEAD_FRAMES,
    ) -> "Tracked":
        """Return the law of a motion; `cells` are those along the longest side of the world, `unit` [m].

        Where the motion ends with a velocity, it is continued, so that the force can aim ahead until then.
        """
        motion = motion.onward(ahead * cloud.frame_dt)
        paths = motion.paths
        times = motion.times.astype(np.float32)
        # Corners in one place have times that are equal in float32.
        alike = 1 + np.flatnonzero(np.diff(times) == 0)
        for index in np.setdiff1d(alike, paths.starts):
            times[index] = np.nextafter(times[index - 1], np.float32(np.inf))
        return cls(
            ids=cloud.ids,
            starts=paths.starts,
            times=times,
            x=paths.corners.astype(np.float32),
            v=motion.v.astype(np.float32),
            path=paths.group,
            offset=paths.offset.astype(np.float32),
            weight=cloud.weight.astype(np.float32),
            gravity=cloud.gravity.astype(np.float32),
            frame_dt=cloud.frame_dt,
            cells=cells,
            cap=cap,
            room=None
            if grid is None
            else {"lower": grid.lower, "spacing": grid.spacing, "distance": grid.distance},
            unit=unit,
            ahead=ahead,
        )

    @property
    def places(self) -> Floats:
        """Ends of the particles' paths (N, D) [m]."""
        return np.asarray(self.x[self.starts[1:] - 1][self.path] + self.offset, dtype=np.float64)

    def __getstate__(self) -> dict[str, Any]:
        """Return the fields alone: the compiled tracks are made anew from them."""
        return {name: value for name, value in vars(self).items() if name != "_tracks"}

    @cached_property
    def _tracks(self) -> _core.Tracks:
        unit, room = self.unit, self.room
        if room is not None:
            room = {name: value / unit for name, value in room.items()}
        return _core.Tracks(
            starts=self.starts,
            times=self.times,
            x=self.x / unit,
            v=self.v / unit,
            path=self.path,
            offset=self.offset / unit,
            gravity=(self.gravity / unit).tolist(),
            shortest=SHORTEST_FRAMES * self.frame_dt,
            ahead=self.ahead * self.frame_dt,
            cells=self.cells,
            cap=self.cap / unit,
            space=None if room is None else RoomGrid(**room).space,
        )

    def force(self, simulator: Simulator, index: int) -> Floats32 | OfIds:
        """Return (N, D), or a pair where not all particles are led."""
        x, v = simulator.positions / self.unit, simulator.velocities / self.unit
        time = index * self.frame_dt
        if is_whole(simulator, len(self.ids)):
            return self.unit * self._tracks.force(x, v, self.weight, time)
        present = simulator.ids
        places, known = locate(present, self.ids)
        rows = places[known].astype(np.uint32)
        force = self.unit * self._tracks.force(x[known], v[known], self.weight[rows], time, rows)
        return present[known], force


@dataclass(frozen=True, eq=False)
class Settled:
    """The force along paths that leads particles, near to the end, to places that are matched anew.

    A fluid that is torn in order to fill a shape does not get everywhere as planned: parts that meet stay
    about a cell apart, and between two arms some of it is left. So optimal transport from the present state
    gives each particle a place of the same region anew, every `ANEW` frames from `start` on. To it the force
    leads in the shortest time of a plan.

    The places of the last two times are kept, so that a snapshot goes on to the same bits. Where they are not
    there, as for a copy of the simulator from another law, they are found from the present state.
    """

    name: ClassVar[str] = "settled"
    moving: Tracked
    """Force until `start`."""
    cells: Floats
    """Centres (M, D) of the cells of the region [m]."""
    side: float
    """Side of a cell [m]."""
    start: int
    """Number of frames after which places are matched anew for the first time."""
    frames: int
    """Number of frames in which the region is to be reached."""
    velocity: Floats | None = None
    """Velocity (D,) [m/s] with which the filled region moves then, and from `start` on; None for rest."""
    found: list[list[Any]] = field(default_factory=list)
    """The last times: number of each, frame in which places were matched, and force to them."""

    def own(self) -> "Settled":
        """Return the law for a copy of the simulator."""
        return dataclasses.replace(self, found=list(self.found))

    def force(self, simulator: Simulator, index: int) -> Floats32 | OfIds | None:
        """Return (N, D), or a pair where not all particles are led."""
        if index < self.start:
            return self.moving.force(simulator, index)
        time, after = divmod(index - self.start, ANEW)
        known = [one for one in self.found if one[0] == time and one[1] <= index]
        # In its first frame nothing known counts: the simulator may have returned to it on another way.
        if not known or after == 0:
            known = [[time, index, self._matched(simulator, self.frames - index)]]
            self.found[:] = [one for one in self.found if one[0] == time - 1] + known
        _, first, tracked = known[0]
        force: Floats32 | OfIds | None = tracked.force(simulator, index - first)
        return force

    def _matched(self, simulator: Simulator, left: int) -> Tracked:
        """Return the force to places that are matched from the present state, with some frames left."""
        law = self.moving
        x = law.places.copy()  # of particles that are gone
        v = np.zeros_like(x)
        places, known = locate(simulator.ids, law.ids)
        x[places[known]], v[places[known]] = simulator.positions[known], simulator.velocities[known]
        cloud = Cloud(
            ids=law.ids,
            x=x,
            v=v,
            weight=law.weight.astype(np.float64),
            types=np.empty(0, dtype=np.uint8),
            volume=0.0,
            gravity=law.gravity.astype(np.float64),
            frame=simulator.frame,
            frame_dt=law.frame_dt,
            partial=not is_whole(simulator, len(law.ids)),
        )
        grid = None if law.room is None else RoomGrid(**law.room)
        soon = (SHORTEST_FRAMES + 1) * law.frame_dt
        if self.velocity is None:
            motion = Paths.matched(cloud, self.cells, grid, self.side).timed(soon)
        else:
            seconds = left * law.frame_dt
            paths = Paths.matched(cloud, self.cells - seconds * self.velocity, grid, self.side)
            paths = dataclasses.replace(paths.shifted(soon * self.velocity), end=self.velocity)
            motion = paths.timed(soon).onward(seconds)
        # What smooths the force would lead what is left between two arms like the arms.
        unit, ahead = law.unit, SHORTEST_FRAMES
        return Tracked.along(motion, cloud, cells=0, cap=law.cap, grid=grid, unit=unit, ahead=ahead)


LAWS: dict[str, type[Unforced | Uniform | Tracked | Settled | Retraced | Diffused]] = {
    law.name: law for law in (Unforced, Uniform, Tracked, Settled, Retraced, Diffused)
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
    fields = {name: _plain(value) for name, value in vars(law).items() if not name.startswith("_")}
    return {"name": law.name, "fields": fields}


def law_from_dict(data: dict[str, Any]) -> Law:
    """Return the law of plain data of `law_to_dict`."""
    return LAWS[data["name"]](**{name: _full(value) for name, value in data["fields"].items()})


def _plain(value: Any) -> Any:
    """Return a field of a law as plain data; a law within it is marked by its key."""
    if isinstance(value, list):
        return [_plain(one) for one in value]
    return {"law": law_to_dict(value)} if isinstance(value, Tracked) else value


def _full(value: Any) -> Any:
    if isinstance(value, list):
        return [_full(one) for one in value]
    return law_from_dict(value["law"]) if isinstance(value, dict) and set(value) == {"law"} else value
