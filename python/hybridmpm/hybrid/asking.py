"""Asking a network that may fail, or never answer."""

import queue
import threading
from collections.abc import Callable

import numpy as np
import numpy.typing as npt

from hybridmpm.errors import ConfigError

_Floats = npt.NDArray[np.float32]


class Asker:
    """Asks a network, and stops waiting for one that hangs.

    Safe to share between simulators of one network: once it has hung, none of them asks it again.

    Parameters
    ----------
    patience : float > 0
        Longest time that an answer may take [s].
    """

    def __init__(self, patience: float) -> None:
        self._patience = patience
        self._is_lost = False

    def ask(self, question: Callable[[], _Floats]) -> _Floats:
        """Return the answer; raises what the network raises, or `TimeoutError` where it hangs or has hung."""
        if self._is_lost:
            raise TimeoutError("the network has hung before and is not asked again")
        answers: queue.SimpleQueue[_Floats | Exception] = queue.SimpleQueue()

        def work() -> None:
            try:
                answers.put(question())
            except Exception as error:  # noqa: BLE001 - whatever a network of one's own may raise
                answers.put(error)

        threading.Thread(target=work, daemon=True, name="network").start()
        try:
            found = answers.get(timeout=self._patience)
        except queue.Empty:
            self._is_lost = True
            raise TimeoutError(
                f"the network has not answered within {self._patience:g} s: give it more `patience`, or "
                "repair it"
            ) from None
        if isinstance(found, Exception):
            raise found
        return found


def is_of_caller(error: Exception) -> bool:
    """Whether an error is the caller's, who has to be told, and not one that MPM can make good."""
    return isinstance(error, ConfigError)
