"""Command-line options that several commands share, and types of options."""

from collections.abc import Sequence
from pathlib import Path

import click

from hybridmpm import export
from hybridmpm.errors import ExportError


class RatioType(click.ParamType[float, object]):
    """A number, or the ratio of two numbers: 0.25 or 1/1.75."""

    name = "number or a/b"

    def convert(self, value: object, param: click.Parameter | None, ctx: click.Context | None) -> float:
        """Return the number; fails for other text and for a ratio with 0 below."""
        above, slash, below = str(value).partition("/")
        try:
            return float(above) / float(below) if slash else float(above)
        except (ValueError, ZeroDivisionError):
            self.fail(f"{value!r} is no number such as 0.25 or 1/1.75", param, ctx)


threads_option = click.option(
    "--threads",
    type=click.IntRange(1, 1024),
    default=1,
    show_default=True,
    help="Number of threads; the result does not depend on it.",
)
"""Threads of one simulator."""

targets_option = click.option(
    "--out",
    "targets",
    type=click.Path(dir_okay=False, path_type=Path),
    multiple=True,
    metavar="FILE",
    help="File to write; its suffix decides the content, see above. May be repeated.",
)
"""Files to write; check them by `check_targets` before there is anything to write."""


def check_targets(targets: Sequence[Path]) -> None:
    """Refuse files of `targets_option` that nothing could be written to.

    Raises
    ------
    UsageError
        A suffix is unknown, a folder does not exist, or a package for the format is missing.
    """
    for target in targets:
        try:
            export.check_target(target)
        except ExportError as error:
            raise click.UsageError(f"--out: {error}.") from None
