"""Progress with the remaining time: a bar in a terminal, else a line every 30 s.

It is on stderr, so that stdout can be piped.
"""

import sys
import time
from types import TracebackType
from typing import Protocol, Self

import click

_SECONDS = 30.0
"""Time from one line to the next where there is no terminal [s]."""


class Progress(Protocol):
    """Work of a number of steps, some of which are done, for a `with` statement."""

    label: str
    pos: int

    def __enter__(self) -> Self: ...

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None: ...

    def update(self, n_steps: int) -> None:
        """Count more steps as done."""

    def finish(self) -> None:
        """Count all steps as done."""


def progress(label: str, length: int, *, done: int = 0) -> Progress:
    """Return the progress of work of `length` steps, of which some are done before."""
    if not sys.stderr.isatty():
        return _Lines(label, length, done)
    bar: Progress = click.progressbar(length=length, label=label, file=sys.stderr)
    bar.pos = done
    return bar


class _Lines:
    """A line with the label at the start, and one with the remaining time now and then."""

    def __init__(self, label: str, length: int, done: int) -> None:
        self.label = label
        self.length, self.pos = length, done
        self._written, self._since = time.monotonic(), done

    def __enter__(self) -> Self:
        click.echo(self.label, err=True)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None: ...

    def update(self, n_steps: int) -> None:
        self.pos += n_steps
        now = time.monotonic()
        spent = now - self._written
        if spent < _SECONDS or self.pos == self._since:
            return
        # The latest pace: steps of a training grow longer.
        left = spent / (self.pos - self._since) * (self.length - self.pos)
        click.echo(f"{self.label}: {self.pos} of {self.length}, {_span(left)} left", err=True)
        self._written, self._since = now, self.pos

    def finish(self) -> None:
        self.pos = self.length


def _span(seconds: float) -> str:
    """Return a time, rounded: 40 s, 12 min or 3.5 h."""
    if seconds < 90:
        return f"{seconds:.0f} s"
    return f"{seconds / 60:.0f} min" if seconds < 5400 else f"{seconds / 3600:.1f} h"


class CountedProgress:
    """Advances a bar of `STEPS` steps, when called with the number of parts done and of all parts."""

    STEPS = 1000

    def __init__(self, bar: Progress) -> None:
        self._bar = bar

    def __call__(self, done: int, total: int) -> None:
        """Advance the bar to the fraction `done` / `total`."""
        self._bar.update(self.STEPS * done // total - self._bar.pos)
