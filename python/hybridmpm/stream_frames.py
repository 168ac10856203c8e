"""The binary message of one frame, as docs/reference/http-api.md describes it: 32 bytes, then arrays."""

import struct
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt

MAGIC = 0x4D50_4D48
VERSIONS = (1, 2)
"""Versions of the message that viewers may request; the last is the newest."""
KIND_POSITIONS = 1
NUMBERS_U16 = 1
FLAG_STEERED = 1
FLAG_POPULATION = 2
"""Ids and types are in the message: ids (N,) u32 before the positions, types (N,) u8 behind them."""
HEADER = struct.Struct("<IBBHQdIBBH")
"""Magic, version, kind, flags, frame, time [s], N, D, type of the numbers, solver time [1 / 100 ms]."""
_VERSION_OFFSET = 4
_UNITS = 65535
"""Units in the longest side of the world."""
_UNITS_PER_MS = 100


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


class FrameMessage:
    """The bytes of a frame in each version; each is made once and sent to all its viewers."""

    def __init__(self, frame: Frame) -> None:
        self._newest = encode(frame)
        self._has_population = frame.population is not None

    def of(self, version: int) -> bytes:
        """Return the bytes in a version.

        Raises
        ------
        FrameError
            Version 1 cannot say who comes and goes.
        """
        if version == VERSIONS[-1]:
            return self._newest
        if self._has_population:
            raise FrameError(
                "version 1 has no ids and types, which a frame needs where particles come and go"
            )
        return self._first

    @cached_property
    def _first(self) -> bytes:
        # Where particles neither come nor go, the versions differ in their number alone.
        return self._newest[:_VERSION_OFFSET] + bytes([1]) + self._newest[_VERSION_OFFSET + 1 :]


def encode(frame: Frame) -> bytes:
    """Return the message of a frame in the newest version."""
    count, dim = frame.positions.shape
    population = frame.population
    flags = (FLAG_STEERED if frame.steered else 0) | (0 if population is None else FLAG_POPULATION)
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
    expected = HEADER.size + (2 * dim + (5 if has_population else 0)) * count
    if dim not in {2, 3} or len(message) != expected:
        raise FrameError(f"{count} particles in {dim}D take {expected} bytes, got {len(message)}")
    start = HEADER.size + (4 * count if has_population else 0)
    raw = np.frombuffer(message, dtype="<u2", offset=start, count=count * dim).reshape(count, dim)
    return Frame(
        number=number,
        time=time,
        solver_ms=units / _UNITS_PER_MS,
        steered=bool(flags & FLAG_STEERED),
        positions=raw.astype(np.float32) / np.float32(_UNITS / length),
        length=length,
        population=_population(message, count) if has_population else None,
    )


def _population(message: bytes, count: int) -> Population:
    return Population(
        ids=np.frombuffer(message, dtype="<u4", offset=HEADER.size, count=count),
        types=np.frombuffer(message, dtype=np.uint8, offset=len(message) - count),
    )
