"""The binary frame: byte for byte as documented, and back."""

import struct

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hybridmpm.stream_frames import Frame, FrameError, FrameMessage, Population, Poses, decode, encode


def _frame(count: int = 3, dim: int = 2, **changes: object) -> Frame:
    positions = np.random.default_rng(0).random((count, dim), dtype=np.float32)
    given = {"number": 7, "time": 0.0175, "solver_ms": 1.25, "steered": True, "positions": positions}
    return Frame(**(given | changes))  # type: ignore[arg-type]


def test_the_header_lies_where_the_document_says() -> None:
    message = encode(_frame(positions=np.array([[0.0, 1.0, 0.5]], dtype=np.float32)))
    assert message[:4] == b"HMPM"
    assert message[4:6] == bytes([3, 1])
    assert struct.unpack_from("<H", message, 6) == (1,)
    assert struct.unpack_from("<Q", message, 8) == (7,)
    assert struct.unpack_from("<d", message, 16) == (0.0175,)
    assert struct.unpack_from("<I", message, 24) == (1,)
    assert message[28:30] == bytes([3, 1])
    assert struct.unpack_from("<H", message, 30) == (125,)
    assert struct.unpack_from("<3H", message, 32) == (0, 65535, 32768)
    assert len(message) == 38


@st.composite
def _frames(draw: st.DrawFn) -> Frame:
    count, dim = draw(st.integers(0, 50)), draw(st.sampled_from([2, 3]))
    population = None
    if draw(st.booleans()):
        ids = draw(st.lists(st.integers(0, 2**32 - 1), min_size=count, max_size=count, unique=True))
        types = draw(st.lists(st.sampled_from([3, 5, 6, 7]), min_size=count, max_size=count))
        population = Population(ids=np.array(sorted(ids), np.uint32), types=np.array(types, np.uint8))
    steered, number = draw(st.booleans()), draw(st.integers(0, 2**60))
    bodies = draw(st.integers(0, 3))
    numbers = np.random.default_rng(bodies).normal(size=(bodies, 13))
    rigid = Poses.of(numbers, dim) if bodies else None
    return _frame(count, dim, steered=steered, number=number, population=population, rigid=rigid)


@given(_frames())
def test_decoding_undoes_encoding(frame: Frame) -> None:
    back = decode(encode(frame))
    assert (back.number, back.time, back.solver_ms, back.steered) == (
        frame.number,
        0.0175,
        1.25,
        frame.steered,
    )
    np.testing.assert_allclose(back.positions, frame.positions, atol=0.5 / 65535 + 1e-7)
    if frame.population is None:
        assert back.population is None
    else:
        assert back.population.ids.tolist() == frame.population.ids.tolist()
        assert back.population.types.tolist() == frame.population.types.tolist()
    if frame.rigid is None:
        assert back.rigid is None
    else:
        assert back.rigid is not None
        assert np.array_equal(back.rigid.center, frame.rigid.center)
        assert np.array_equal(back.rigid.rotation, frame.rigid.rotation)


@given(_frames())
def test_older_versions_differ_in_their_number_alone_and_lack_some(frame: Frame) -> None:
    message = FrameMessage(frame)
    assert message.of(3) == encode(frame)
    for version in (1, 2):
        lacks = frame.rigid is not None or (version == 1 and frame.population is not None)
        if lacks:
            with pytest.raises(FrameError, match=f"version {version}"):
                message.of(version)
            continue
        older = message.of(version)
        assert older == encode(frame)[:4] + bytes([version]) + encode(frame)[5:]
        assert np.array_equal(decode(older).positions, decode(message.of(3)).positions)
        assert message.of(version) is older


@given(_frames(), st.data())
def test_a_torn_frame_is_refused(frame: Frame, data: st.DataObject) -> None:
    message = encode(frame)
    with pytest.raises(FrameError):
        decode(message[: data.draw(st.integers(0, len(message) - 1))])


def test_ids_come_before_the_positions_and_types_behind_them() -> None:
    population = Population(ids=np.array([7, 2**32 - 1], np.uint32), types=np.array([5, 6], np.uint8))
    positions = np.array([[0.0, 1.0], [1.0, 0.0]], np.float32)
    message = encode(_frame(positions=positions, population=population))
    assert struct.unpack_from("<H", message, 6) == (3,)
    assert struct.unpack_from("<2I4H2B", message, 32) == (7, 2**32 - 1, 0, 65535, 65535, 0, 5, 6)
    assert len(message) == 50


@pytest.mark.parametrize("dim", [2, 3])
def test_poses_come_before_all_else(dim: int) -> None:
    numbers = np.zeros((2, 13))
    numbers[:, 0:3], numbers[1, 3:7] = (0.25, 0.5, 0.75), (0.6, 0.0, 0.0, 0.8)
    numbers[0, 3] = 1.0
    message = encode(_frame(0, dim, rigid=Poses.of(numbers, dim)))
    assert struct.unpack_from("<H", message, 6) == (5,)
    assert struct.unpack_from("<I", message, 32) == (2,)
    row = struct.unpack_from("<3f" if dim == 2 else "<7f", message, 36 + (12 if dim == 2 else 28))
    turn = [2 * np.arctan2(0.8, 0.6)] if dim == 2 else [0.6, 0, 0, 0.8]
    assert row == pytest.approx([0.25, 0.5, 0.75][:dim] + turn)
    assert len(message) == 36 + 2 * (12 if dim == 2 else 28)


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
