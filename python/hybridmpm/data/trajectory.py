"""`Trajectory`: one simulation as data, whatever format it was read from."""

import hashlib
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from hybridmpm.data.control import Control
from hybridmpm.errors import DataError
from hybridmpm.scene import Scene

Floats = npt.NDArray[np.float32]


@dataclass(frozen=True)
class Place:
    """Origin of a trajectory, for error messages: its file, and the keys of its arrays in the file."""

    file: str
    position: str = "position"
    types: str = "particle_type"
    force: str = "force"
    mass: str = "mass"
    velocity: str = "velocity"
    target: str = "target"
    smoothed_force: str = "smoothed_force"

    def under(self, group: str) -> "Place":
        """Return the place whose keys are in an HDF5 group."""
        keys = {key: f"{group}/{value}" for key, value in vars(self).items() if key != "file"}
        return Place(self.file, **keys)


@dataclass(frozen=True, kw_only=True)
class Trajectory:
    """F states of N particles at equal intervals of time, checked on construction.

    Raises
    ------
    DataError
        Shapes disagree, or a number is not finite; the message names file and key as in `place`.
    """

    positions: Floats
    """Positions (F, N, D) [m], the start first."""
    types: npt.NDArray[np.int64]
    """DeepMind's particle types (N,): 0 rigid, 3 kinematic, 5 water, 6 sand, 7 goop, 8 liquid."""
    force: Floats | None = None
    """External acceleration besides gravity (F - 1, N, D) [m/s^2]; row t acts from state t to t + 1."""
    mass: Floats | None = None
    """Masses (N,) [kg], 0 for kinematic particles; None where unknown."""
    seed: int | None = None
    """Seed of the trajectory; None where unknown."""
    scene: Scene | None = None
    """Scene that was simulated; None where unknown."""
    control: Control | None = None
    """Example of control that the force belongs to; None if there is none."""
    place: Place = Place("trajectory")
    """Origin of the trajectory, for error messages."""

    def __post_init__(self) -> None:
        x, place = self.positions, self.place
        if x.ndim != 3 or x.shape[2] not in {2, 3} or 0 in x.shape:
            raise DataError(f"{place.file}: {place.position} must have shape (F, N, 2 or 3), got {x.shape}")
        if self.types.shape != x.shape[1:2]:
            raise DataError(
                f"{place.file}: {place.types} must name one type for each of the {x.shape[1]} particles of "
                f"{place.position}, got shape {self.types.shape}"
            )
        _refuse_not_finite(x, place, place.position)
        if self.force is not None:
            expected = (x.shape[0] - 1, *x.shape[1:])
            if self.force.shape != expected:
                text = f"must have shape {expected}, got {self.force.shape}"
                raise DataError(f"{place.file}: {place.force} {text}")
            _refuse_not_finite(self.force, place, place.force)
        if self.mass is not None and self.mass.shape != self.types.shape:
            raise DataError(
                f"{place.file}: {place.mass} must have shape {self.types.shape}, got {self.mass.shape}"
            )

        if self.control is not None:
            self._check_control(self.control)

    def __repr__(self) -> str:
        title = self.place.file if self.scene is None else self.scene.title
        states, count, _ = self.positions.shape
        return f"Trajectory({title}, {count} particles, {states} states)"

    def _check_control(self, control: Control) -> None:
        place = self.place
        if self.force is None:
            raise DataError(f"{place.file}: {place.force} is missing, and {place.velocity} is of a control")
        shapes = {"velocity": self.positions.shape[1:], "target": self.positions.shape[1:]}
        for key, array in control.arrays.items():
            name, expected = getattr(place, key), shapes.get(key, self.force.shape)
            if array.shape != expected:
                raise DataError(f"{place.file}: {name} must have shape {expected}, got {array.shape}")
            _refuse_not_finite(array if array.ndim == 3 else array[None], place, name)

    @property
    def digest(self) -> str:
        """SHA-256 of positions, types, force and control; equal data have it in any format."""
        total = hashlib.sha256()
        for name, array in (
            ("position", self.positions.astype("<f4", copy=False)),
            ("particle_type", self.types.astype("<i8", copy=False)),
            ("force", None if self.force is None else self.force.astype("<f4", copy=False)),
        ):
            if array is not None:
                total.update(f"{name} {array.dtype.str} {array.shape}\n".encode())
                total.update(np.ascontiguousarray(array).data)
        if self.control is not None:
            self.control.digest_into(total)
        return total.hexdigest()


def _refuse_not_finite(array: Floats, place: Place, key: str) -> None:
    # If an entry is not finite, neither is the sum. Finite float32 entries do not overflow a float64 sum.
    if np.isfinite(array.sum(dtype=np.float64)):
        return
    frame, particle, axis = (int(index) for index in np.argwhere(~np.isfinite(array))[0])
    value = array[frame, particle, axis]
    raise DataError(f"{place.file}: {key} is {value} at frame {frame}, particle {particle}, axis {axis}")
