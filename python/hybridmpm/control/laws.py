"""Laws: what says which force acts in a frame, from the state before it. All of them are plain data."""

from dataclasses import dataclass
from functools import cached_property
from typing import Any, ClassVar, Protocol

import numpy as np
import numpy.typing as npt

from hybridmpm import _core
from hybridmpm.control.diffusion.law import Diffused
from hybridmpm.control.goal.cloud import Cloud
from hybridmpm.control.goal.paths import SHORTEST_FRAMES, Motion
from hybridmpm.control.goal.room import RoomGrid
from hybridmpm.control.reversal.retrace import Retraced
from hybridmpm.errors import SnapshotError
from hybridmpm.force import locate
from hybridmpm.simulator import Simulator

AHEAD_FRAMES = 24
"""How far ahead of the present the force aims on a way with corners [frames]."""

Floats32 = npt.NDArray[np.float32]
OfIds = tuple[npt.NDArray[np.uint64], Floats32]


class Law(Protocol):
    """What gives the force of each frame. A dataclass of arrays and numbers, so that it can be kept."""

    name: ClassVar[str]
    """Name under which a snapshot knows the law."""

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
    """The same acceleration for all particles that were there at the start, in all frames."""

    name: ClassVar[str] = "uniform"
    acceleration: Floats32
    """(D,) [m/s^2]."""
    ids: npt.NDArray[np.uint64]
    """Particles (N,) that were there at the start."""

    def force(self, simulator: Simulator, index: int) -> Floats32 | OfIds:  # noqa: ARG002 - always the same
        """Return (D,), or a pair where particles have come or gone."""
        if not simulator.scene.is_open:
            return self.acceleration
        return self.ids, np.tile(self.acceleration, (len(self.ids), 1))


@dataclass(frozen=True, eq=False)
class Tracked:
    """The force that keeps particles on timed paths, from where they really are; see `_core.Tracks`."""

    name: ClassVar[str] = "tracked"
    ids: npt.NDArray[np.uint64]
    """Particles (N,) that were there at the start, ascending."""
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
    """Fields of a `RoomGrid`, for particles that obstacles keep from their aim; None without obstacles."""

    @classmethod
    def along(
        cls,
        motion: Motion,
        cloud: Cloud,
        *,
        cells: int,
        cap: float,
        grid: RoomGrid | None,
    ) -> "Tracked":
        """Return the law of a motion; `cells`, `cap` [m/s^2] and `grid` as `_core.Tracks` takes them."""
        paths = motion.paths
        times = motion.times.astype(np.float32)
        # Corners in one place are passed at times that float32 cannot tell apart.
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
        )

    @cached_property
    def _tracks(self) -> _core.Tracks:
        return _core.Tracks(
            starts=self.starts,
            times=self.times,
            x=self.x,
            v=self.v,
            path=self.path,
            offset=self.offset,
            gravity=self.gravity.tolist(),
            shortest=SHORTEST_FRAMES * self.frame_dt,
            ahead=AHEAD_FRAMES * self.frame_dt,
            cells=self.cells,
            cap=self.cap,
            space=None if self.room is None else RoomGrid(**self.room).space,
        )

    def force(self, simulator: Simulator, index: int) -> Floats32 | OfIds:
        """Return (N, D), or a pair where particles have come or gone."""
        x, v = simulator.positions, simulator.velocities
        time = index * self.frame_dt
        if not simulator.scene.is_open:
            return self._tracks.force(x, v, self.weight, time)
        present = simulator.ids
        places, known = locate(present, self.ids)
        rows = places[known].astype(np.uint32)
        force = self._tracks.force(x[known], v[known], self.weight[rows], time, rows)
        return present[known], force


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
    fields = {name: value for name, value in vars(law).items() if not name.startswith("_")}
    return {"name": law.name, "fields": fields}


def law_from_dict(data: dict[str, Any]) -> Law:
    """Return the law that `law_to_dict` described."""
    return LAWS[data["name"]](**data["fields"])
