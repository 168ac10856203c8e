"""The binary message of one frame, as docs/reference/http-api.md describes it: 32 bytes, then arrays."""

import struct
from dataclasses import dataclass
from functools import cached_property
from typing import Self

import numpy as np
import numpy.typing as npt

MAGIC = 0x4D50_4D48
VERSIONS = (1, 2, 3)
"""Versions of the message that viewers may request; the last is the newest."""
KIND_POSITIONS = 1
NUMBERS_U16 = 1
FLAG_STEERED = 1
FLAG_POPULATION = 2
"""Ids and types are in the message: ids (N,) u32 before the positions, types (N,) u8 behind them."""
FLAG_RIGID = 4
"""Rigid bodies are in the message, before all else: their number B u32, then B poses f32."""
HEADER = struct.Struct("<IBBHQdIBBH")
"""Magic, version, kind, flags, frame, time [s], N, D, type of the numbers, solver time [1 / 100 ms]."""
_VERSION_OFFSET = 4
_UNITS = 65535
"""Units in the longest side of the world."""
_UNITS_PER_MS = 100
_COUNT = struct.Struct("<I")
_POSE_NUMBERS = {2: 3, 3: 7}
"""Numbers of a pose by dimension: the centre, then an angle or a quaternion."""


class FrameError(ValueError):
    """The bytes are not a frame, or the requested version cannot express the frame."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Population:
    """Ids and types of the particles of a frame, in a scene where particles come and go."""

    ids: npt.NDArray[np.uint32]
    """Numbers (N,) that the particles keep, modulo 2^32; who stays keeps its order, new ones are last."""
    types: npt.NDArray[np.uint8]
    """DeepMind's particle types (N,): 5 water, 6 sand, 7 elastic (goop), 8 viscous liquid."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Poses:
    """Where the B rigid bodies of a scene are, in the order of `Scene.rigid`."""

    center: npt.NDArray[np.float32]
    """Centres of mass (B, D) [m]."""
    rotation: npt.NDArray[np.float32]
    """Angles (B,) [rad] in 2D, anticlockwise, unit quaternions (B, 4) in 3D, as `RigidBodies.rotation`."""

    @classmethod
    def of(cls, numbers: npt.NDArray[np.float64], dim: int) -> Self:
        """Return the poses in the numbers (B, 13) of `Simulator.rigid_numbers`."""
        turn = numbers[:, 3:7]
        if dim == 2:
            turn = np.arctan2(2 * turn[:, 0] * turn[:, 3], 1 - 2 * turn[:, 3] ** 2)
        return cls(center=numbers[:, :dim].astype(np.float32), rotation=turn.astype(np.float32))

    def __len__(self) -> int:
        return len(self.center)


@dataclass(frozen=True, kw_only=True, eq=False)
class Frame:
    """One instant of a simulation, as a viewer needs it."""

    number: int
    """Number of frames since the start."""
    time: float
    """Simulated time since the start [s]."""
    solver_ms: float
    """Time that the simulator took for this frame [ms]; the message has at most 655.35."""
    steered: bool
    """True if a sketch steered this frame."""
    positions: npt.NDArray[np.float32]
    """Positions (N, D) [m]; the message rounds them to 1 / 65535 of `length`."""
    length: float = 1.0
    """Longest side of the world [m], which the message does not contain."""
    population: Population | None = None
    """Ids and types of the particles; None where they are the same in all frames."""
    rigid: Poses | None = None
    """Where the rigid bodies are; None in a scene without."""


class FrameMessage:
    """The bytes of a frame in each version; each is made once and sent to all its viewers."""

    def __init__(self, frame: Frame) -> None:
        self._newest = encode(frame)
        self._has_population, self._has_rigid = frame.population is not None, frame.rigid is not None

    def of(self, version: int) -> bytes:
        """Return the bytes in a version.

        Raises
        ------
        FrameError
            Version 1 cannot say who comes and goes, and only version 3 where rigid bodies are.
        """
        if version == VERSIONS[-1]:
            return self._newest
        if self._has_rigid:
            raise FrameError(f"version {version} has no rigid bodies, which this scene has")
        if self._has_population and version == 1:
            raise FrameError(
                "version 1 has no ids and types, which a frame needs where particles come and go"
            )
        if version not in self._older:
            # Without what an older version lacks, the versions differ in their number alone.
            before, behind = self._newest[:_VERSION_OFFSET], self._newest[_VERSION_OFFSET + 1 :]
            self._older[version] = before + bytes([version]) + behind
        return self._older[version]

    @cached_property
    def _older(self) -> dict[int, bytes]:
        return {}


def encode(frame: Frame) -> bytes:
    """Return the message of a frame in the newest version."""
    count, dim = frame.positions.shape
    population, rigid = frame.population, frame.rigid
    flags = FLAG_STEERED * frame.steered
    flags |= FLAG_POPULATION * (population is not None) | FLAG_RIGID * (rigid is not None)
    header: bytes = HEADER.pack(
        MAGIC,
        VERSIONS[-1],
        KIND_POSITIONS,
        flags,
        frame.number,
        frame.time,
        count,
        dim,
        NUMBERS_U16,
        min(round(frame.solver_ms * _UNITS_PER_MS), 0xFFFF),
    )
    # The solver tolerates a particle up to one cell outside; the picture shows it on the edge.
    scaled = np.rint(np.clip(frame.positions, 0.0, frame.length) * np.float32(_UNITS / frame.length))
    numbers: bytes = scaled.astype("<u2").tobytes()
    if rigid is not None:
        rows = np.concatenate([rigid.center, rigid.rotation.reshape(len(rigid), -1)], axis=1)
        header += _COUNT.pack(len(rigid)) + rows.astype("<f4").tobytes()
    if population is None:
        return header + numbers
    # The widest numbers come first, so that each array is aligned and can be read in place.
    return header + population.ids.astype("<u4").tobytes() + numbers + population.types.tobytes()


def decode(message: bytes, length: float = 1.0) -> Frame:
    """Return the frame of a message of any version, in a world whose longest side is `length` [m].

    Raises
    ------
    FrameError
        The bytes are not a frame of a version that is known.
    """
    if len(message) < HEADER.size:
        raise FrameError(f"a frame has at least {HEADER.size} bytes, got {len(message)}")
    magic, version, kind, flags, number, time, count, dim, numbers, units = HEADER.unpack_from(message)
    if (magic, kind, numbers) != (MAGIC, KIND_POSITIONS, NUMBERS_U16) or version not in VERSIONS:
        raise FrameError(
            f"unknown frame: magic {magic:#x}, version {version}, kind {kind}, numbers {numbers}"
        )
    has_population = version > 1 and bool(flags & FLAG_POPULATION)
    first, bodies = HEADER.size, 0
    if version > 2 and flags & FLAG_RIGID and dim in _POSE_NUMBERS and len(message) >= first + _COUNT.size:
        (bodies,) = _COUNT.unpack_from(message, first)
        first += _COUNT.size + 4 * _POSE_NUMBERS[dim] * bodies
    expected = first + (2 * dim + (5 if has_population else 0)) * count
    if dim not in _POSE_NUMBERS or len(message) != expected:
        beside = f" and {bodies} rigid bodies" if bodies else ""
        raise FrameError(f"{count} particles{beside} in {dim}D take {expected} bytes, got {len(message)}")
    start = first + (4 * count if has_population else 0)
    raw = np.frombuffer(message, dtype="<u2", offset=start, count=count * dim).reshape(count, dim)
    return Frame(
        number=number,
        time=time,
        solver_ms=units / _UNITS_PER_MS,
        steered=bool(flags & FLAG_STEERED),
        positions=raw.astype(np.float32) / np.float32(_UNITS / length),
        length=length,
        population=_population(message, first, count) if has_population else None,
        rigid=_poses(message, bodies, dim) if bodies else None,
    )


def _poses(message: bytes, count: int, dim: int) -> Poses:
    width = _POSE_NUMBERS[dim]
    rows = np.frombuffer(message, dtype="<f4", offset=HEADER.size + _COUNT.size, count=count * width)
    rows = rows.reshape(count, width)
    return Poses(center=rows[:, :dim], rotation=rows[:, dim] if dim == 2 else rows[:, dim:])


def _population(message: bytes, first: int, count: int) -> Population:
    return Population(
        ids=np.frombuffer(message, dtype="<u4", offset=first, count=count),
        types=np.frombuffer(message, dtype=np.uint8, offset=len(message) - count),
    )
