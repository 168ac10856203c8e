"""The binary message of one frame, as docs/http-api.md describes it: 32 bytes, then positions."""

import struct
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

MAGIC = 0x4D50_4D48
VERSION = 1
KIND_POSITIONS = 1
NUMBERS_U16 = 1
FLAG_STEERED = 1
HEADER = struct.Struct("<IBBHQdIBBH")
"""Magic, version, kind, flags, frame, time [s], N, D, type of the numbers, solver time [1 / 100 ms]."""
_UNITS_PER_METRE = 65535
_UNITS_PER_MS = 100


class FrameError(ValueError):
    """The bytes are not a frame of this version."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Frame:
    """One instant of a simulation, as a viewer needs it."""

    number: int
    """Number of frames since the start."""
    time: float
    """Simulated time since the start [s]."""
    solver_ms: float
    """Time that the simulator took for this frame [ms]; the message carries at most 655.35."""
    steered: bool
    """Whether a sketch steered this frame."""
    positions: npt.NDArray[np.float32]
    """Positions (N, D) [m] in [0, 1]; the message rounds them to 1 / 65535 m."""


def encode(frame: Frame) -> bytes:
    """Return the message of a frame."""
    count, dim = frame.positions.shape
    header: bytes = HEADER.pack(
        MAGIC,
        VERSION,
        KIND_POSITIONS,
        FLAG_STEERED if frame.steered else 0,
        frame.number,
        frame.time,
        count,
        dim,
        NUMBERS_U16,
        min(round(frame.solver_ms * _UNITS_PER_MS), 0xFFFF),
    )
    # The solver tolerates a particle up to one cell outside; the picture shows it on the edge.
    scaled = np.rint(np.clip(frame.positions, 0.0, 1.0) * np.float32(_UNITS_PER_METRE))
    numbers: bytes = scaled.astype("<u2").tobytes()
    return header + numbers


def decode(message: bytes) -> Frame:
    """Return the frame that a message carries.

    Raises
    ------
    FrameError
        The bytes are not a frame of this version.
    """
    if len(message) < HEADER.size:
        raise FrameError(f"a frame has at least {HEADER.size} bytes, got {len(message)}")
    magic, version, kind, flags, number, time, count, dim, numbers, units = HEADER.unpack_from(message)
    if (magic, version, kind, numbers) != (MAGIC, VERSION, KIND_POSITIONS, NUMBERS_U16):
        raise FrameError(
            f"unknown frame: magic {magic:#x}, version {version}, kind {kind}, numbers {numbers}"
        )
    expected = HEADER.size + 2 * count * dim
    if dim not in {2, 3} or len(message) != expected:
        raise FrameError(f"{count} particles in {dim}D take {expected} bytes, got {len(message)}")
    raw = np.frombuffer(message, dtype="<u2", offset=HEADER.size).reshape(count, dim)
    return Frame(
        number=number,
        time=time,
        solver_ms=units / _UNITS_PER_MS,
        steered=bool(flags & FLAG_STEERED),
        positions=raw.astype(np.float32) / np.float32(_UNITS_PER_METRE),
    )
