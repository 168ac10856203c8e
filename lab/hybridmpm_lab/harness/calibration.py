"""How busy the machine is: a fixed piece of arithmetic beside what is measured."""

import math
import time
from concurrent.futures import ThreadPoolExecutor

import numpy as np

_NUMBERS = 32_768
"""Numbers that each thread works on; they fit into a core's own cache."""
_SWEEPS = 400
"""Sweeps over them in one piece, a few milliseconds."""
_PIECES = 5
"""Pieces of which the quickest counts: a single interruption says nothing."""


class Calibration:
    """Tells how much slower the machine is now than at its best since this was made.

    Parameters
    ----------
    threads : int
        Threads that work at the same time, each as much as one alone.
    """

    def __init__(self, threads: int) -> None:
        self._numbers = [np.linspace(0.5, 1.5, _NUMBERS, dtype=np.float32) for _ in range(threads)]
        self._least = math.inf
        for _ in range(4):
            self.slowdown()

    def slowdown(self) -> float:
        """Return the time of the arithmetic now over the least time so far, at least 1 [-]."""
        with ThreadPoolExecutor(len(self._numbers)) as pool:
            now = math.inf
            for _ in range(_PIECES):
                began = time.perf_counter()
                list(pool.map(_work, self._numbers))
                now = min(now, time.perf_counter() - began)
        self._least = min(self._least, now)
        return now / self._least


def _work(numbers: np.ndarray) -> None:
    for _ in range(_SWEEPS):
        np.sqrt(numbers, out=numbers)
