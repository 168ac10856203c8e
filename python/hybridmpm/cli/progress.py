"""Progress bars with an ETA, on stderr, so that stdout can be piped."""

import sys

import click


def progress(label: str, length: int) -> "click._termui_impl.ProgressBar[int]":
    """Return a bar to use in a `with`; its `update(n)` moves it on by n steps of `length`."""
    return click.progressbar(length=length, label=label, file=sys.stderr)


class CountedProgress:
    """Lets a bar of 1000 steps follow calls that tell the parts done and their total."""

    STEPS = 1000

    def __init__(self, bar: "click._termui_impl.ProgressBar[int]") -> None:
        self._bar = bar

    def __call__(self, done: int, total: int) -> None:
        """Move the bar to `done` of `total`."""
        self._bar.update(self.STEPS * done // total - self._bar.pos)
