"""The neighbour graph through the Python boundary; its exactness is tested in Rust."""

import numpy as np
import pytest

from hybridmpm import ConfigError, radius_graph


def test_edges_are_ordered_by_receiver_and_hold_no_self_edge() -> None:
    x = np.array([[0.0, 0.0], [0.25, 0.0], [0.5, 0.0], [2.0, 2.0]], np.float32)
    graph = radius_graph(x, 0.25)
    # The middle point hears both neighbours, at exactly the radius; the far one nobody.
    assert graph.receivers.tolist() == [0, 1, 1, 2]
    assert graph.senders.tolist() == [1, 0, 2, 1]
    assert graph.starts.tolist() == [0, 1, 3, 4, 4]
    assert graph.radius == 0.25


def test_equals_all_pairs_in_3d() -> None:
    x = np.random.default_rng(3).random((200, 3), dtype=np.float32)
    graph = radius_graph(x, 0.2)
    distance = np.linalg.norm(x[:, None].astype(float) - x[None].astype(float), axis=-1)
    receivers, senders = np.nonzero((distance <= np.float32(0.2)) & ~np.eye(200, dtype=bool))
    assert np.array_equal(graph.receivers, receivers)
    assert np.array_equal(graph.senders, senders)


@pytest.mark.parametrize(
    ("x", "radius", "message"),
    [
        (np.zeros((2, 2), np.float32), 0.0, r"radius must be finite and > 0 m, got 0"),
        (np.full((1, 2), np.nan, np.float32), 0.1, r"x\[0\] must be finite"),
        (np.zeros((2, 4), np.float32), 0.1, r"x must be float32 of shape \(N, 2\) or \(N, 3\)"),
        (np.zeros((2, 2)), 0.1, r"got float64 of shape \[2, 2\]"),
    ],
)
def test_bad_input_is_named(x: np.ndarray, radius: float, message: str) -> None:
    with pytest.raises(ConfigError, match=message):
        radius_graph(x, radius)
