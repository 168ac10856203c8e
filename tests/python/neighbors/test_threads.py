"""Threads change no result, wherever they are asked for: in threads of Python and in forked processes."""

import subprocess
import sys
import textwrap
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import numpy.typing as npt

from hybridmpm import radius_graph


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
