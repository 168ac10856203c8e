"""The neighbour graph through the Python boundary; random clouds are tested in Rust."""

import itertools
import subprocess
import sys
import textwrap
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import numpy.typing as npt
import pytest

from hybridmpm import ConfigError, GraphSizeError, radius_graph


def test_edges_are_ordered_by_receiver_and_hold_no_self_edge() -> None:
    x = np.array([[0.0, 0.0], [0.25, 0.0], [0.5, 0.0], [2.0, 2.0]], np.float32)
    graph = radius_graph(x, 0.25)
    # The middle point hears both neighbours, at exactly the radius; the far one nobody.
    assert graph.receivers.tolist() == [0, 1, 1, 2]
    assert graph.senders.tolist() == [1, 0, 2, 1]
    assert graph.starts.tolist() == [0, 1, 3, 4, 4]
    assert graph.radius == 0.25


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


def test_pairs_at_the_radius_and_self_edges_are_chosen_by_name() -> None:
    x = np.array([[0.0, 0.0], [0.25, 0.0], [0.3, 0.0]], np.float32)
    assert radius_graph(x, 0.25, inclusive=False).senders.tolist() == [2, 1]
    graph = radius_graph(x, 0.25, self_edges=True)
    assert graph.senders.tolist() == [0, 1, 0, 1, 2, 1, 2]
    assert graph.starts.tolist() == [0, 2, 5, 7]


def test_kinematic_points_are_not_joined_to_each_other() -> None:
    x = np.zeros((4, 2), np.float32)
    for types in (np.array([3, 5, 3, 6]), np.array([3, 5, 3, 6], np.uint8)):
        graph = radius_graph(x, 1.0, types, self_edges=True)
        neighbors = [set(graph.senders[a:b].tolist()) for a, b in itertools.pairwise(graph.starts)]
        assert neighbors == [{0, 1, 3}, {0, 1, 2, 3}, {1, 2, 3}, {0, 1, 2, 3}]
    everybody = radius_graph(x, 1.0, types, kinematic=9)
    assert np.array_equal(everybody.senders, radius_graph(x, 1.0).senders)


def clouds() -> dict[str, np.ndarray]:
    rng = np.random.default_rng(11)
    lattice = np.stack(np.meshgrid(*[np.arange(32)] * 2), axis=-1).reshape(-1, 2) / np.float32(32)
    return {
        "nothing": np.empty((0, 2), np.float32),
        "single": np.zeros((1, 3), np.float32),
        "coincident": np.full((300, 3), 0.5, np.float32),
        "clumped": rng.normal(0.5, 0.002, (400, 2)).astype(np.float32),
        "lattice": lattice.astype(np.float32),
        "2d": rng.random((1500, 2), dtype=np.float32),
        "3d": rng.random((1500, 3), dtype=np.float32),
    }


@pytest.mark.parametrize("name", clouds())
@pytest.mark.parametrize("radius", [1 / 32, 0.1, 5.0])
def test_equals_all_pairs_whatever_the_options(name: str, radius: float) -> None:
    x = clouds()[name]
    types = np.arange(len(x)) % 5
    fixed = types == 3
    squared = ((x[:, None].astype(float) - x[None].astype(float)) ** 2).sum(axis=-1)
    out = radius_graph(x[:1], 1.0)
    for inclusive, self_edges, threads in itertools.product((True, False), (True, False), (1, 2)):
        limit = float(np.float32(radius)) ** 2
        joined = (squared <= limit if inclusive else squared < limit) & ~(fixed[:, None] & fixed)
        joined[np.diag_indices(len(x))] = self_edges
        receivers, senders = np.nonzero(joined)
        options = {"inclusive": inclusive, "self_edges": self_edges, "threads": threads}
        for target in (None, out):
            graph = radius_graph(x, radius, types, **options, out=target)
            assert np.array_equal(graph.receivers, receivers)
            assert np.array_equal(graph.senders, senders)
            assert graph.starts.tolist() == [0, *np.cumsum(joined.sum(axis=1))]


def test_a_graph_is_overwritten_in_place() -> None:
    x = np.random.default_rng(5).random((500, 2), dtype=np.float32)
    graph = radius_graph(x, 0.1)
    starts, senders = graph.starts, graph.senders
    assert radius_graph(x, 0.05, out=graph) is graph
    assert np.shares_memory(graph.starts, starts)
    assert np.shares_memory(graph.senders, senders)
    assert graph.radius == np.float32(0.05)
    assert np.array_equal(graph.senders, radius_graph(x, 0.05).senders)
    assert radius_graph(x, 0.3, out=graph) is graph
    assert not np.shares_memory(graph.senders, senders)
    assert np.array_equal(graph.senders, radius_graph(x, 0.3).senders)


def test_too_many_edges_are_refused() -> None:
    x = np.zeros((100, 3), np.float32)
    assert len(radius_graph(x, 0.1, max_edges=9900).senders) == 9900
    with pytest.raises(GraphSizeError, match=r"100 points has more than max_edges = 9899 .* raise max_edges"):
        radius_graph(x, 0.1, max_edges=9899)


def test_bad_options_are_named() -> None:
    x = np.zeros((2, 2), np.float32)
    with pytest.raises(ConfigError, match=r"types must be integers of shape \(N,\), got float64"):
        radius_graph(x, 0.1, np.zeros(2))  # type: ignore[arg-type]
    with pytest.raises(ConfigError, match="types must have 2 entries, one a point of x, got 3"):
        radius_graph(x, 0.1, np.zeros(3, int))
    with pytest.raises(ConfigError, match="threads must be at least 1"):
        radius_graph(x, 0.1, threads=0)


def cloud(count: int) -> npt.NDArray[np.float32]:
    return np.random.default_rng(count).random((count, 2), dtype=np.float32)


def test_calls_at_the_same_time_find_the_same_graphs() -> None:
    clouds = [cloud(count) for count in (500, 3000, 20_000, 60_000)]
    alone = [radius_graph(x, 0.01).senders for x in clouds]

    def found(turn: int) -> bool:
        x, expected = clouds[turn % 4], alone[turn % 4]
        return np.array_equal(radius_graph(x, 0.01, threads=2 + turn % 3).senders, expected)

    with ThreadPoolExecutor(4) as pool:
        assert all(pool.map(found, range(24)))


def test_a_forked_process_goes_on_with_the_threads_of_its_parent() -> None:
    script = """
        import os
        import numpy as np
        from hybridmpm import MpmBatch, MpmSolver, radius_graph, scenarios

        x = np.random.default_rng(0).random((20_000, 2), dtype=np.float32)
        scenes = [scenarios.water_2d(seed) for seed in (1, 2)]
        solver = MpmSolver(scenes[0], threads=2)
        batch = MpmBatch(scenes, threads=2)
        edges = len(radius_graph(x, 0.01, threads=2).senders)
        solver.advance(2)
        batch.advance(2)
        child = os.fork()
        for _ in range(2):
            assert len(radius_graph(x, 0.01, threads=2).senders) == edges
            solver.advance(2)
            batch.advance(2)
        del solver, batch
        if child:
            assert os.waitpid(child, 0)[1] == 0
    """
    command = [sys.executable, "-W", "ignore", "-c", textwrap.dedent(script)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=60, check=False)
    assert done.returncode == 0, done.stderr
