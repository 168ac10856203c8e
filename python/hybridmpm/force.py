"""Forces: external accelerations as fields in time, checked here for all simulators.

A force is given to `advance` in one of five forms; `Simulator.advance` lists them. N is the number of
particles, D the dimension, T the number of frames of the call. In formulas a force is the acceleration added
to gravity, in m/s^2, so that a particle of any mass moves alike.
"""

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any, Protocol, TypeAlias

import numpy as np
import numpy.typing as npt

from hybridmpm._support.arguments import unmasked
from hybridmpm.errors import ForceError
from hybridmpm.scene import Scene

_Floats = npt.NDArray[np.float32]


class Forced(Protocol):
    """The part of a simulator that checks of forces read."""

    @property
    def scene(self) -> Scene:
        """The scene of the simulator."""

    @property
    def frame(self) -> int:
        """Number of frames since the start."""

    @property
    def particle_count(self) -> int:
        """Number N of particles at present."""

    @property
    def ids(self) -> npt.NDArray[np.uint64]:
        """Numbers (N,) of the particles, ascending."""


OfIds: TypeAlias = tuple[npt.ArrayLike, npt.ArrayLike]
"""Ids (K,) and the accelerations of these particles, (K, D) or (T, K, D) [m/s^2]."""
Function: TypeAlias = Callable[[Any], npt.ArrayLike | OfIds | None]
"""Called with the simulator before each frame; returns the force of that frame."""
Force: TypeAlias = npt.ArrayLike | OfIds | Function | None


class CheckedForce(Protocol):
    """A force that has been checked for one call of `advance`."""

    @property
    def by_frame(self) -> bool:
        """Whether the force of a frame is known only just before that frame."""

    @property
    def array(self) -> _Floats | None:
        """Force of all frames, (D,), (N, D) or (T, N, D); None without force, and if it is `by_frame`."""

    def at(self, index: int) -> _Floats | None:
        """Return the force of a frame of the call, counted from 0: (D,), (N, D) or None.

        To be called just before that frame, since it may depend on the state.
        """


@dataclass(frozen=True)
class NoForce:
    """No force at all."""

    by_frame = False
    array = None

    def at(self, index: int) -> None:
        """Return None."""


@dataclass(frozen=True)
class ArrayForce:
    """A force that does not depend on the state: (D,), (N, D) or (T, N, D)."""

    array: _Floats
    by_frame = False

    def at(self, index: int) -> _Floats:
        """Return (D,) or (N, D)."""
        return self.array[index] if self.array.ndim == 3 else self.array


@dataclass(frozen=True)
class _ForceOfIds:
    """A force on the particles of ids (K,); accelerations (K, D) or (T, K, D)."""

    simulator: Forced
    ids: npt.NDArray[np.uint64]
    accelerations: _Floats
    by_frame = True
    array = None

    def at(self, index: int) -> _Floats:
        """Return (N, D) for the present particles."""
        rows = self.accelerations[index] if self.accelerations.ndim == 3 else self.accelerations
        return total_force([(self.ids, rows)], self.simulator.ids, self.simulator.scene.dim)


@dataclass(frozen=True)
class _ForceOfState:
    """A function of the state."""

    simulator: Forced
    function: Function
    by_frame = True
    array = None

    def at(self, index: int) -> _Floats | None:  # noqa: ARG002 - the frame is part of the state
        """Call the function, and check its return value."""
        where = f"the force function's value before frame {self.simulator.frame + 1}"
        try:
            value = self.function(self.simulator)
        except Exception as error:
            raise ForceError(
                f"the force function raised {type(error).__name__} before frame "
                f"{self.simulator.frame + 1}: {error}"
            ) from error
        if callable(value):
            raise ForceError(f"{where} must be an acceleration, not another function")
        checked = _checked(value, self.simulator, 1, where, one_frame=True)
        return checked.at(0)


def locate(
    ids: npt.NDArray[np.uint64], among: npt.NDArray[np.uint64]
) -> tuple[npt.NDArray[np.intp], npt.NDArray[np.bool_]]:
    """Return the places (K,) of ids (K,) among ascending ids (N,), and which of them are there (K,)."""
    places = np.searchsorted(among, ids)
    there = places < len(among)
    there[there] = among[places[there]] == ids[there]
    return places, there


def total_force(
    forces: Iterable[npt.ArrayLike | OfIds | None], ids: npt.NDArray[np.uint64], dim: int
) -> _Floats:
    """Return the sum of forces.

    Parameters
    ----------
    forces : iterable of forces
        Each (D,), (N, D), None or a pair of ids (K,) and accelerations (K, D) [m/s^2]. Ids of particles that
        are not among `ids` are ignored, and particles without an id in a pair get nothing of it.
    ids : (N,)
        Particles, ascending.
    dim : int
        Dimension D.

    Returns
    -------
    float32 (N, D)
        Acceleration of each particle [m/s^2].
    """
    total = np.zeros((len(ids), dim), dtype=np.float32)
    force: Any
    for force in forces:
        if _is_pair(force):
            named, accelerations = (np.asarray(part) for part in force)
            places, there = locate(named, ids)
            total[places[there]] += accelerations[there]
        elif force is not None:
            total += np.asarray(force, dtype=np.float32)
    return total


def checked_force(force: Force, simulator: Forced, frames: int, name: str = "force") -> CheckedForce:
    """Check a force for a call of `advance`, before anything moves.

    Parameters
    ----------
    force : Force
        In one of the forms that `Simulator.advance` lists.
    simulator : Forced
        In the state before the call.
    frames : int
        Number T of frames of the call.
    name : str
        Begins the messages.

    Raises
    ------
    ForceError
        The force is none of these forms, has a wrong shape or is not finite. The message lists the allowed
        shapes.
    """
    if callable(force):
        return _ForceOfState(simulator, force)
    return _checked(force, simulator, frames, name, one_frame=False)


def _checked(force: Any, simulator: Forced, frames: int, name: str, *, one_frame: bool) -> CheckedForce:
    if force is None:
        return NoForce()
    if _is_pair(force):
        return _checked_pair(force, simulator, frames, name, one_frame=one_frame)
    array = _numbers(force, name)
    dim, count = simulator.scene.dim, simulator.particle_count
    allowed: list[tuple[int, ...]] = [(dim,)]
    if not simulator.scene.is_open or frames <= 1:
        allowed.append((count, dim))
    if not (simulator.scene.is_open or one_frame):
        allowed.append((frames, count, dim))
    if array.shape not in allowed:
        raise ForceError(
            _refusal(name, allowed, array.shape, is_open=simulator.scene.is_open, one_frame=one_frame)
        )
    return ArrayForce(_finite(array, name))


def _is_pair(force: Any) -> bool:
    """Whether a force is (ids, accelerations); rows of an array given as a tuple are not."""
    if not isinstance(force, tuple) or len(force) != 2:
        return False
    try:
        return np.ndim(force[0]) == 1 and np.ndim(force[1]) in (2, 3)
    except Exception:  # noqa: BLE001 - rows of different lengths, or foreign code; `_numbers` raises the error
        return False


def _checked_pair(pair: Any, simulator: Forced, frames: int, name: str, *, one_frame: bool) -> _ForceOfIds:
    ids = np.asarray(unmasked(f"the ids of {name}", pair[0], ForceError))
    if ids.dtype.kind not in "iu" and len(ids):
        raise ForceError(f"the ids of {name} must be whole numbers, got {ids.dtype}")
    ids = ids if len(ids) else np.empty(0, dtype=np.uint64)
    if (ids < 0).any():
        raise ForceError(f"the ids of {name} must be at least 0, got {ids.min()}")
    ids = ids.astype(np.uint64)
    order = np.argsort(ids, kind="stable")
    twice = np.flatnonzero(ids[order][1:] == ids[order][:-1])
    if len(twice):
        raise ForceError(f"the ids of {name} must differ, got {ids[order][twice[0]]} twice")
    accelerations = _numbers(pair[1], f"the accelerations of {name}")
    allowed: list[tuple[int, ...]] = [(len(ids), simulator.scene.dim)]
    if not one_frame:
        allowed.append((frames, *allowed[0]))
    if accelerations.shape not in allowed:
        shapes = " or ".join(map(str, allowed))
        raise ForceError(
            f"the accelerations of {name} must be of shape {shapes}, one row for each of {len(ids)} ids, "
            f"got {accelerations.shape}"
        )
    _finite(accelerations, f"the accelerations of {name}")
    return _ForceOfIds(simulator, ids[order], np.ascontiguousarray(accelerations[..., order, :]))


def _numbers(value: Any, name: str) -> _Floats:
    """Convert to float32; any error of the conversion becomes a `ForceError`."""
    unmasked(name, value, ForceError)
    try:
        given = np.asarray(value)
        # What float32 cannot hold becomes infinite, and is refused as that.
        with np.errstate(over="ignore"):
            array = np.asarray(given.real, dtype=np.float32, order="C")
    except Exception as error:
        hint = ""
        if isinstance(value, list | tuple) and len(value) == 2:
            hint = "; ids and accelerations are given as a tuple (ids (K,), accelerations (K, D))"
        raise ForceError(f"{name} must be numbers [m/s^2]: {error}{hint}") from error
    if given.dtype.kind not in "fiuO":
        raise ForceError(f"{name} must be real numbers [m/s^2], got {given.dtype}")
    return array


def _finite(array: _Floats, name: str) -> _Floats:
    finite = np.isfinite(array)
    if not finite.all():
        where = np.unravel_index(int(np.argmin(finite)), array.shape)
        index = ", ".join(map(str, where))
        raise ForceError(f"{name} must be finite, got {array[where]} at [{index}]")
    return array


def _refusal(
    name: str, allowed: list[tuple[int, ...]], shape: tuple[int, ...], *, is_open: bool, one_frame: bool
) -> str:
    shapes = [str(one) for one in allowed]
    listed = " or ".join([", ".join(shapes[:-1]), shapes[-1]]) if len(shapes) > 1 else shapes[0]
    others = "a tuple (ids, accelerations)" if one_frame else "a function or a tuple (ids, accelerations)"
    text = f"{name} must have shape {listed}, or be {others}; got shape {shape}"
    if is_open:
        text += ". Particles come and go in this scene, so rows without ids are for one frame only"
    return text
