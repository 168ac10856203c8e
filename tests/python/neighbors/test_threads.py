"""Threads change no result, wherever they are asked for: in threads of Python and in forked processes."""

import subprocess
import sys
import textwrap
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import numpy.typing as npt
import pytest

from hybridmpm import ConfigError, VerletList, _native, radius_graph


def cloud(count: int) -> npt.NDArray[np.float32]:
    return np.random.default_rng(count).random((count, 2), dtype=np.float32)


def test_calls_at_the_same_time_find_the_same_graphs() -> None:
    clouds = [cloud(count) for count in (500, 3000, 20_000, 60_000)]
    alone = [radius_graph(x, 0.01).senders for x in clouds]

    def found(turn: int) -> bool:
        x, expected = clouds[turn % 4], alone[turn % 4]
        listed = VerletList(0.01, 0.002, threads=3).graph(x).senders
        same = np.array_equal(radius_graph(x, 0.01, threads=2 + turn % 3).senders, expected)
        return same and np.array_equal(listed, expected)

    with ThreadPoolExecutor(4) as pool:
        assert all(pool.map(found, range(24)))


def test_a_forked_process_goes_on_with_the_threads_of_its_parent() -> None:
    script = """
        import os
        import numpy as np
        from hybridmpm import MpmBatch, MpmSolver, VerletList, radius_graph, scenarios

        x = np.random.default_rng(0).random((20_000, 2), dtype=np.float32)
        scenes = [scenarios.water_2d(seed) for seed in (1, 2)]
        near, solver = VerletList(0.01, 0.002, threads=2), MpmSolver(scenes[0], threads=2)
        batch = MpmBatch(scenes, threads=2)
        edges = len(radius_graph(x, 0.01, threads=2).senders)
        assert len(near.graph(x).senders) == edges
        solver.advance(2)
        batch.advance(2)
        child = os.fork()
        for _ in range(2):
            found = [len(radius_graph(x, 0.01, threads=2).senders), len(near.graph(x).senders)]
            assert found == [edges, edges], found
            solver.advance(2)
            batch.advance(2)
        del near, solver, batch
        if child:
            assert os.waitpid(child, 0)[1] == 0
    """
    command = [sys.executable, "-W", "ignore", "-c", textwrap.dedent(script)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=60, check=False)
    assert done.returncode == 0, done.stderr


def test_times_of_work_handed_out() -> None:
    times = _native.hand_out_times(work=50e-6, pause=10e-6, repeats=3)
    assert set(times) == {"alone", "team", "pool", "rayon"}
    # Two threads' work and the pause, on one thread; a busy machine takes longer.
    assert times["alone"] > 80e-6
    assert min(times.values()) > 40e-6


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"threads": 1}, "threads must be at least 2"),
        ({"repeats": 0}, "repeats at least 1, got 2 and 0"),
        ({"work": -1.0}, r"work and pause must be in \[0, 1e-3\] s, got -1"),
        ({"pause": float("nan")}, "got .* and NaN"),
    ],
)
def test_loads_that_make_no_sense_are_refused(change: dict[str, float], message: str) -> None:
    with pytest.raises(ConfigError, match=message):
        _native.hand_out_times(**change)  # type: ignore[arg-type]
