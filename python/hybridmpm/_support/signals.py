"""Handlers of signals within a frame: Ctrl-C waits until the state is whole.

Python runs the handler of a signal between any two instructions. Within a frame that consists of several
steps, an exception of a handler would leave some of them done.
"""

# `signal` without its enumerations: converting to their members takes 10 us of each frame.
import _signal  # type: ignore[import-not-found]
import contextlib
import signal
import threading
from collections.abc import Callable, Iterator
from types import FrameType

from hybridmpm import _core

_NAMES = ("SIGINT", "SIGTERM", "SIGHUP", "SIGALRM", "SIGBREAK")
_SIGNALS = tuple(int(getattr(signal, name)) for name in _NAMES if hasattr(signal, name))
"""Signals whose handlers raise exceptions in practice, as far as the system has them."""

_ENDS = tuple(number for number in _SIGNALS if signal.Signals(number).name in {"SIGTERM", "SIGHUP"})
"""Signals by which schedulers, containers and closed terminals end a program."""

_Handler = Callable[[int, FrameType | None], object]

_postponed: list[tuple[_Handler, int, FrameType | None]] = []
"""Calls of handlers that wait, on the main thread."""
_in_whole = False


def run_postponed() -> None:
    """Call the handlers that wait; an exception of one of them is raised here."""
    while _postponed:
        handler, number, frame = _postponed.pop(0)
        handler(number, frame)


# A call into the core undoes what it has begun where a handler raises, so that handlers may run within.
_core.after_signals(run_postponed)


class TerminatedError(BaseException):
    """The program is to end, by a signal that is not Ctrl-C."""

    def __init__(self, number: int) -> None:
        super().__init__(signal.Signals(number).name)
        self.number = number


@contextlib.contextmanager
def raising_at_end() -> Iterator[None]:
    """Raise `TerminatedError` in a block, where signals would end the program at once."""
    ours = [number for number in _ENDS if signal.getsignal(number) is signal.SIG_DFL]

    def end(number: int, _frame: FrameType | None) -> None:
        raise TerminatedError(number)

    for number in ours:
        signal.signal(number, end)
    try:
        yield
    finally:
        for number in ours:
            signal.signal(number, signal.SIG_DFL)


@contextlib.contextmanager
def whole() -> Iterator[None]:
    """Postpone handlers of signals to the end of a block, or to a call of the core within it.

    A signal that comes again while its handler waits is handled at once: the block may hang.
    """
    global _in_whole  # noqa: PLW0603 - signals belong to the process
    if _in_whole or threading.current_thread() is not threading.main_thread():
        yield
        return
    given = {number: _signal.getsignal(number) for number in _SIGNALS}
    ours = {number: handler for number, handler in given.items() if callable(handler)}
    is_open = True

    def postpone(number: int, frame: FrameType | None) -> None:
        if not is_open:
            ours[number](number, frame)
            return
        again = any(number == waiting for _, waiting, _ in _postponed)
        _postponed.append((ours[number], number, frame))
        if again:
            run_postponed()

    try:
        _in_whole = True
        for number in ours:
            _signal.signal(number, postpone)
        yield
    finally:
        # These two lines call nothing, so that no handler runs between them. Each handler that is given back
        # may raise at once; those that are left then pass their signals on.
        _in_whole = False
        is_open = False
        for number, handler in ours.items():
            if _signal.getsignal(number) is postpone:
                _signal.signal(number, handler)
        run_postponed()
