"""Features against numbers worked out by hand and by loops, and how they behave under mirroring."""

import numpy as np
import numpy.typing as npt
import torch

from hybridmpm import radius_graph
from hybridmpm.physics.spec import HISTORY
from hybridmpm.training.physics.network.edges import EdgeList
from hybridmpm.training.physics.network.features import edge_features, node_features, step_velocities

RADIUS = 0.05
WALLS = np.array([[0.1, 0.1], [0.9, 0.9]], dtype=np.float32)
MEAN, STD = np.array([0.0, -0.002]), np.array([0.004, 0.005])


def _nodes(x: npt.NDArray[np.float32], walls: npt.NDArray[np.float32] = WALLS) -> npt.NDArray[np.float32]:
    scales = (torch.tensor(MEAN, dtype=torch.float32), torch.tensor(STD, dtype=torch.float32))
    features: npt.NDArray[np.float32] = node_features(
        torch.from_numpy(x), torch.from_numpy(walls), RADIUS, *scales
    ).numpy()
    return features


def _history(count: int, seed: int = 0) -> npt.NDArray[np.float32]:
    rng = np.random.default_rng(seed)
    start = rng.uniform(0.1, 0.3, (count, 2))
    return (start + np.cumsum(rng.normal(0, 0.004, (HISTORY, count, 2)), axis=0)).astype(np.float32)


def test_values_worked_out_by_hand() -> None:
    # One particle that falls faster and faster and drifts to the right, close to the left wall and the floor.
    heights = [0.17, 0.168, 0.164, 0.158, 0.15, 0.14]
    x = np.array([[[0.11 + 0.002 * k, heights[k]]] for k in range(HISTORY)], dtype=np.float32)
    expected = [
        # (velocity - mean) / std, the oldest first; across 0.002 / 0.004 throughout.
        *(0.5, 0.0, 0.5, -0.4, 0.5, -0.8, 0.5, -1.2, 0.5, -1.6),
        # Distances 0.02 and 0.04 to left wall and floor over R; right wall and ceiling are out of reach.
        *(0.4, 0.8, 1.0, 1.0),
    ]
    np.testing.assert_allclose(_nodes(x), [expected], atol=2e-5)
    np.testing.assert_allclose(step_velocities(torch.from_numpy(x))[-1], [[0.002, -0.01]], atol=1e-7)


def test_edge_values_worked_out_by_hand() -> None:
    x = torch.tensor([[0.5, 0.5], [0.53, 0.46], [0.5, 0.5]])
    # From 1 to 0, from 0 to 1, and between two particles in one place.
    graph = EdgeList(torch.tensor([1, 0, 2]), torch.tensor([0, 1, 0]), [3])
    expected = [[0.6, -0.8, 1.0], [-0.6, 0.8, 1.0], [0.0, 0.0, 1e-6]]
    np.testing.assert_allclose(edge_features(x, graph, RADIUS), expected, atol=2e-6)


def test_nodes_against_loops() -> None:
    x = _history(12)
    found = _nodes(x)
    for i in range(12):
        row = []
        for k in range(HISTORY - 1):
            row += [(float(x[k + 1, i, d]) - float(x[k, i, d]) - MEAN[d]) / STD[d] for d in range(2)]
        below = [(float(x[-1, i, d]) - 0.1) / RADIUS for d in range(2)]
        above = [(0.9 - float(x[-1, i, d])) / RADIUS for d in range(2)]
        row += [min(max(distance, -1.0), 1.0) for distance in below + above]
        np.testing.assert_allclose(found[i], row, atol=5e-5)


def test_edges_against_loops() -> None:
    x = _history(12)[-1]
    graph = radius_graph(x, RADIUS)
    pairs = {
        (s, r)
        for s in range(12)
        for r in range(12)
        if s != r and np.hypot(*(x[s].astype(float) - x[r])) <= RADIUS
    }
    assert set(zip(graph.senders.tolist(), graph.receivers.tolist(), strict=True)) == pairs
    senders, receivers = (torch.from_numpy(a.astype(np.int64)) for a in (graph.senders, graph.receivers))
    found = edge_features(torch.from_numpy(x), EdgeList(senders, receivers, [12]), RADIUS).numpy()
    assert len(found) > 10
    for row, s, r in zip(found, senders, receivers, strict=True):
        offset = (x[s].astype(float) - x[r]) / RADIUS
        np.testing.assert_allclose(row, [*offset, np.hypot(*offset)], atol=1e-5)


def test_mirrored_particles_have_mirrored_features() -> None:
    x = _history(30)
    mirrored = x.copy()
    mirrored[..., 0] = 1.0 - x[..., 0]
    one, two = _nodes(x), _nodes(mirrored)
    turned = one.copy()
    turned[:, 0:10:2] *= -1.0
    turned[:, [10, 12]] = one[:, [12, 10]]
    np.testing.assert_allclose(two, turned, atol=5e-5)


def test_shifted_particles_and_walls_have_the_same_features() -> None:
    x, shift = _history(30), np.array([0.25, -0.125], dtype=np.float32)
    np.testing.assert_allclose(_nodes(x + shift, WALLS + shift), _nodes(x), atol=5e-5)


def test_no_particles_and_no_edges() -> None:
    assert _nodes(np.empty((HISTORY, 0, 2), np.float32)).shape == (0, 14)
    none = torch.zeros(0, dtype=torch.int64)
    assert edge_features(torch.rand(1, 2), EdgeList(none, none, [1]), RADIUS).shape == (0, 3)
