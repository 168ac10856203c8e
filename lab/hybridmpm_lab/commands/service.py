"""`python -m hybridmpm_lab service`."""

from functools import partial
from pathlib import Path

import click

from hybridmpm_lab.commands.options import (
    json_option,
    measured,
    number_option,
    numbers_option,
    report,
    source,
)
from hybridmpm_lab.service.service import PARTS, ServiceSettings, measure

_COLUMNS = ("measure", "sessions", "viewers", "value", "unit", "aim")
_MOST_SESSIONS = 16
"""Sessions that a service takes by default."""


@click.command()
@click.option(
    "--part",
    "parts",
    type=click.Choice(PARTS),
    multiple=True,
    help="Part of the benchmark. May be given several times. If absent, all of it.",
)
@numbers_option(
    "--sessions", 1, _MOST_SESSIONS, ServiceSettings.sessions, "Number of sessions with one viewer each."
)
@numbers_option("--viewers", 1, 500, ServiceSettings.viewers, "Number of viewers of one session.")
@number_option(
    "--kept", 1, _MOST_SESSIONS, ServiceSettings.kept, "Number of sessions that a restart brings back."
)
@click.option(
    "--seconds",
    type=click.FloatRange(0.2, 3600),
    default=ServiceSettings.seconds,
    show_default=True,
    help="Length of each measurement of frames.",
)
@number_option("--repeats", 1, 1000, ServiceSettings.repeats, "Number of sketches and of pushes.")
@json_option
def service(
    *,
    parts: tuple[str, ...],
    sessions: tuple[int, ...],
    viewers: tuple[int, ...],
    kept: int,
    seconds: float,
    repeats: int,
    json_file: Path | None,
) -> None:
    """Measure how long the service lets its clients wait.

    The service runs as a process of its own on this machine, beside the clients. A table tells how evenly
    frames come, how soon a sketch and a push are seen, how soon hostile uploads are refused, how soon
    sessions are back after `kill -9`, and what a slow client costs the others.
    """
    settings = ServiceSettings(
        parts=parts or PARTS, sessions=sessions, viewers=viewers, kept=kept, seconds=seconds, repeats=repeats
    )
    options = {"part": parts, "sessions": sessions, "viewers": viewers, "kept": (kept,)}
    origin = source("service", **options, seconds=(seconds,), repeats=(repeats,))
    rows = measured(partial(measure, settings), settings.count, origin)
    report(rows, _COLUMNS, origin, json_file)
