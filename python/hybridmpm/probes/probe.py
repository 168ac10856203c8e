"""`Probe`: the interface of all probes, and the part of a simulator that they read."""

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import Any, ClassVar, Protocol

import numpy as np
import numpy.typing as npt

from hybridmpm._support.arguments import float64
from hybridmpm.errors import ConfigError
from hybridmpm.scene import Scene

Floats = npt.NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class PressureSamples:
    """Pressures of the n particles that are simulated."""

    x: npt.NDArray[np.float32]
    """Positions (n, D) [m]."""
    pressure: npt.NDArray[np.float32]
    """Pressures (n,) [Pa], above 0 in compression."""
    spacing: float
    """Distance of these particles at rest [m]."""


class Probed(Protocol):
    """The part of a simulator that a probe reads."""

    @property
    def scene(self) -> Scene:
        """The scene that it simulates."""

    @property
    def time(self) -> float:
        """Simulated time since the start [s]."""

    @property
    def particle_spacing(self) -> float:
        """Distance of the particles at rest [m]."""

    @property
    def positions(self) -> npt.NDArray[np.float32]:
        """Positions (N, D) [m]."""

    @property
    def velocities(self) -> npt.NDArray[np.float32]:
        """Velocities (N, D) [m/s]."""

    @property
    def mass(self) -> npt.NDArray[np.float32]:
        """Masses (N,) [kg]."""

    def rigid_numbers(self) -> Floats:
        """Numbers (B, 13) of the scene's rigid bodies."""

    def pressure_samples(self) -> PressureSamples:
        """Pressures of the particles that are simulated; a `ConfigError` where there are none."""

    def keep_forces(self) -> None:
        """Sum the forces in all later frames; a `ConfigError` where there are none."""

    def frame_forces(self) -> Floats:
        """Return the forces of the latest frame; a `ConfigError` where there are none."""


class Probe(ABC):
    """Something that reads one number, or K numbers, off the state of a simulator."""

    unit: ClassVar[str]
    """Unit of the numbers, such as "kg/m^3"."""
    is_mean: ClassVar[bool] = False
    """Whether a reading is the mean over a frame, not the state at its end."""

    @abstractmethod
    def check(self, scene: Scene) -> None:
        """Raise a `ConfigError`, which says what is allowed, unless the probe fits into a scene."""

    def prepare(self, simulator: Probed) -> None:  # noqa: B027 - most probes read what is there
        """Let a simulator keep what later readings need."""

    @abstractmethod
    def read(self, simulator: Probed) -> Floats:
        """Return the reading at this instant, of shape () or (K,)."""

    def plain(self, simulator: Probed) -> dict[str, Any]:  # noqa: ARG002 - for probes of the library
        """Return the kind and the geometry as plain data, from which a page that plays reads as `read` does.

        `marks` are lines through points [m] that show where the probe is.

        Raises
        ------
        ConfigError
            It is a probe of one's own, which no page can read.
        """
        raise ConfigError(
            f"a page reads probes of hybridmpm.probes, got {type(self).__name__}: record this one in Python"
        )


def checked_points(name: str, points: npt.ArrayLike, scene: Scene) -> Floats:
    """Return points (K, D) of one point (D,) or several, or raise `ConfigError`."""
    array = float64(name, points)
    rows = array.reshape(1, -1) if array.ndim == 1 else array
    if rows.ndim != 2 or rows.shape[1] != scene.dim or not len(rows):
        raise ConfigError(
            f"{name} must be one point of {scene.dim} numbers, or K of them, got shape {array.shape}"
        )
    lower, upper = np.array(scene.walls.lower), np.array(scene.walls.upper)
    outside = ~((rows >= lower - ROUNDING) & (rows <= upper + ROUNDING)).all(axis=1)
    if outside.any():
        raise ConfigError(
            f"{name} must lie inside the walls, {_text(lower)} to {_text(upper)} m, got "
            f"{_text(rows[outside][0])}: move it, or the walls"
        )
    return rows


def checked_patch(lower: npt.ArrayLike, upper: npt.ArrayLike, scene: Scene) -> tuple[Floats, Floats]:
    """Return the corners (D,) of a box within the walls, or raise `ConfigError`."""
    low, high = checked_points("lower", lower, scene)[0], checked_points("upper", upper, scene)[0]
    if not (low < high).all():
        raise ConfigError(f"upper must be above lower along each axis, got {_text(low)} and {_text(high)}")
    return low, high


def outline(lower: Floats, upper: Floats) -> list[list[float]]:
    """Return a line around a box, in 3D around its front in the middle of its depth."""
    corners = [(0, 0), (1, 0), (1, 1), (0, 1), (0, 0)]
    middle = (lower + upper)[2:] / 2
    return [[(lower, upper)[i][0], (lower, upper)[j][1], *middle] for i, j in corners]


def overlap(x: Floats, size: float, lower: Floats, upper: Floats) -> Floats:
    """Return which part (N,) of cubes of a side `size` [m] around points (N, D) lies in a box, in [0, 1]."""
    inside = np.minimum(x + size / 2, upper) - np.maximum(x - size / 2, lower)
    return np.asarray(np.clip(inside / size, 0.0, 1.0).prod(axis=1))


def between_walls(x: npt.NDArray[np.float32], size: float, scene: Scene) -> Floats:
    """Return the middles (N, D) of cubes around particles, moved so far that no cube lies behind a wall."""
    lower, upper = np.array(scene.walls.lower), np.array(scene.walls.upper)
    return np.clip(x.astype(np.float64), lower + size / 2, upper - size / 2)


def distances(x: npt.NDArray[Any], simulator: Probed) -> Floats:
    """Return the distances (K,) of points (K, D) from the nearest obstacle now [m], negative inside."""
    found = np.full(len(x), np.inf)
    for obstacle in simulator.scene.obstacles:
        one = obstacle.to_native().signed_distance(x.astype(np.float32), simulator.time)
        found = np.minimum(found, one)
    return found


def outside_of_obstacles(x: Floats, simulator: Probed) -> npt.NDArray[np.bool_]:
    """Return whether points (K, D) lie in no obstacle, where these are at present."""
    return distances(x, simulator) > 0


def lattice(lower: Floats, upper: Floats, count: int) -> Floats:
    """Return the middles (count^D, D) of as many equal cells of a box."""
    axes = [a + (np.arange(count) + 0.5) / count * (b - a) for a, b in zip(lower, upper, strict=True)]
    return np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, len(lower))


ROUNDING = 1e-9
"""Length [m] by which a place may lie past a wall by rounding."""


def _text(point: Floats) -> str:
    return "(" + ", ".join(f"{value:g}" for value in point) + ")"
