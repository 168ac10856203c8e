"""The state of a solver, together with that of the particles that it carries if it does."""

import struct

from hybridmpm import _core
from hybridmpm.coarse import Upsampler
from hybridmpm.coarse.upsampler import refuse_other_upsampler
from hybridmpm.errors import SnapshotError

_PREFIX = struct.Struct("<8sQ")
"""Magic, length of the state of the few."""
_MAGIC = b"HMPMBOTH"


def encode(few: _core.Solver, upsampler: Upsampler | None) -> bytes:
    """Return the state of the few, joined by that of the many if there are any; each has its own checksum."""
    state = few.snapshot()
    return state if upsampler is None else _PREFIX.pack(_MAGIC, len(state)) + state + upsampler.snapshot()


def restore(few: _core.Solver, upsampler: Upsampler | None, data: bytes) -> None:
    """Take a state that `encode` made.

    Raises
    ------
    SnapshotError
        The bytes are damaged, of another scene, or of a solver that differs in `show_all`; nothing has changed.
    """
    state, carried = _parted(data)
    refuse_other_upsampler(saved=carried is not None, here=upsampler is not None)
    before = few.snapshot()
    few.restore(state)
    if upsampler is not None and carried is not None:
        try:
            upsampler.restore(carried)
        except SnapshotError:
            few.restore(before)
            raise


def _parted(data: bytes) -> tuple[bytes, bytes | None]:
    """Return the state of the few, and that of the carried particles if there is one."""
    if not data.startswith(_MAGIC):
        return data, None
    if len(data) < _PREFIX.size:
        raise SnapshotError("snapshot refused: it is cut off after a few bytes")
    _, length = _PREFIX.unpack_from(data)
    end = _PREFIX.size + length
    if end > len(data):
        raise SnapshotError("snapshot refused: it is cut off within the state of the particles that carry")
    return data[_PREFIX.size : end], data[end:]
