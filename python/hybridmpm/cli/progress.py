"""Progress bars with the remaining time; they are on stderr, so that stdout can be piped."""

import sys

import click


def progress(label: str, length: int) -> "click._termui_impl.ProgressBar[int]":
    """Return a progress bar for a `with` statement; `update(n)` advances it by n of `length` steps."""
    return click.progressbar(length=length, label=label, file=sys.stderr)


class CountedProgress:
    """Advances a bar of `STEPS` steps, when called with the number of parts done and of all parts."""

    STEPS = 1000

    def __init__(self, bar: "click._termui_impl.ProgressBar[int]") -> None:
        self._bar = bar

    def __call__(self, done: int, total: int) -> None:
        """Advance the bar to the fraction `done` / `total`."""
        self._bar.update(self.STEPS * done // total - self._bar.pos)
