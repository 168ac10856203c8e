"""Pieces of ink: which pixels belong together, and how gaps are bridged."""

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hybridmpm.control.sketch.ink import MAX_GAP, labels, main_mark
from hybridmpm.errors import SketchError


def _flooded(mask: npt.NDArray[np.bool_]) -> npt.NDArray[np.int64]:
    """Return a number for each 8-connected piece of a mask, in the order of their first pixels."""
    result = np.zeros(mask.shape, dtype=np.int64)
    for start in np.argwhere(mask):
        if result[tuple(start)]:
            continue
        number, stack = int(result.max()) + 1, [tuple(start)]
        while stack:
            row, column = stack.pop()
            inside = 0 <= row < mask.shape[0] and 0 <= column < mask.shape[1]
            if inside and mask[row, column] and not result[row, column]:
                result[row, column] = number
                stack += [(row + down, column + right) for down in (-1, 0, 1) for right in (-1, 0, 1)]
    return result


@settings(max_examples=40, deadline=None)
@given(st.integers(0, 2**32 - 1), st.floats(0, 1), st.integers(1, 24), st.integers(1, 24))
def test_pieces_are_those_of_a_flood(seed: int, share: float, height: int, width: int) -> None:
    mask = np.random.default_rng(seed).random((height, width)) < share
    assert np.array_equal(labels(mask), _flooded(mask))


def test_a_spiral_is_one_piece() -> None:
    turn = np.linspace(0, 40, 20_000)
    mask = np.zeros((512, 512), dtype=bool)
    mask[(256 + 6 * turn * np.sin(turn)).astype(int), (256 + 6 * turn * np.cos(turn)).astype(int)] = True
    assert labels(mask).max() == 1


@pytest.mark.parametrize("gap", [1, MAX_GAP - 1, MAX_GAP + 3])
def test_gaps_are_bridged_up_to_their_limit(gap: int) -> None:
    mask = np.zeros((512, 512), dtype=bool)
    mask[100:104, 50:150] = True
    mask[100:104, 150 + gap : 250 + gap] = True
    if gap > MAX_GAP:
        with pytest.raises(SketchError, match="without gaps wider than 12 pixels"):
            main_mark(mask)
    else:
        mark, bridged = main_mark(mask)
        assert np.array_equal(mark, mask)
        assert labels(bridged).max() == 1
