"""The binary frame: byte for byte as documented, and back."""

import struct

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hybridmpm_service.sessions.frames import Frame, FrameError, decode, encode


def _frame(count: int = 3, dim: int = 2, **changes: object) -> Frame:
    positions = np.random.default_rng(0).random((count, dim), dtype=np.float32)
    given = {"number": 7, "time": 0.0175, "solver_ms": 1.25, "steered": True, "positions": positions}
    return Frame(**(given | changes))  # type: ignore[arg-type]


def test_the_header_lies_where_the_document_says() -> None:
    message = encode(_frame(positions=np.array([[0.0, 1.0, 0.5]], dtype=np.float32)))
    assert message[:4] == b"HMPM"
    assert message[4:6] == bytes([1, 1])
    assert struct.unpack_from("<H", message, 6) == (1,)
    assert struct.unpack_from("<Q", message, 8) == (7,)
    assert struct.unpack_from("<d", message, 16) == (0.0175,)
    assert struct.unpack_from("<I", message, 24) == (1,)
    assert message[28:30] == bytes([3, 1])
    assert struct.unpack_from("<H", message, 30) == (125,)
    assert struct.unpack_from("<3H", message, 32) == (0, 65535, 32768)
    assert len(message) == 38


@given(
    count=st.integers(0, 50), dim=st.sampled_from([2, 3]), steered=st.booleans(), number=st.integers(0, 2**60)
)
def test_decoding_undoes_encoding(*, count: int, dim: int, steered: bool, number: int) -> None:
    frame = _frame(count, dim, steered=steered, number=number)
    back = decode(encode(frame))
    assert (back.number, back.time, back.solver_ms, back.steered) == (number, 0.0175, 1.25, steered)
    np.testing.assert_allclose(back.positions, frame.positions, atol=0.5 / 65535 + 1e-7)


def test_positions_just_outside_are_shown_on_the_edge() -> None:
    back = decode(encode(_frame(positions=np.array([[-0.01, 1.01]], dtype=np.float32))))
    assert back.positions.tolist() == [[0.0, 1.0]]


def test_a_slow_frame_saturates_its_time() -> None:
    assert decode(encode(_frame(solver_ms=1e6))).solver_ms == 655.35


@pytest.mark.parametrize(
    "message", [b"", b"HMPM", encode(_frame())[:-1], b"X" + encode(_frame())[1:], encode(_frame()) + b"0"]
)
def test_other_bytes_are_refused(message: bytes) -> None:
    with pytest.raises(FrameError):
        decode(message)
