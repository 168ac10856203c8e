"""Turns of threads on a machine with few cores."""

import threading
from collections import deque
from types import TracebackType


class Turns:
    """Lets so many threads in at a time, the others in the order in which they came; a context manager.

    Who leaves hands the place over to the next in line. A semaphore would let a thread that comes again at
    once pass those that wait.

    Parameters
    ----------
    places : int >= 1
        Number of threads that may be in at a time.
    """

    def __init__(self, places: int) -> None:
        self._lock = threading.Lock()
        self._free = places
        self._line: deque[threading.Lock] = deque()

    def __enter__(self) -> None:
        with self._lock:
            if self._free > 0:
                self._free -= 1
                return
            gate = threading.Lock()
            gate.acquire()
            self._line.append(gate)
        gate.acquire()

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        with self._lock:
            if self._line:
                self._line.popleft().release()
            else:
                self._free += 1
