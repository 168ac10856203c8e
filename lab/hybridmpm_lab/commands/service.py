"""`python -m hybridmpm_lab service`."""

from functools import partial
from pathlib import Path

import click

from hybridmpm_lab.commands.options import json_option, measured, report
from hybridmpm_lab.harness.settings import origin_of, settings_options
from hybridmpm_lab.service.measurements import ServiceSettings, measure

_COLUMNS = ("measure", "sessions", "viewers", "value", "unit", "aim")


@click.command()
@settings_options(ServiceSettings)
@json_option
def service(settings: ServiceSettings, json_file: Path | None) -> None:
    """Measure how long the clients of the service wait.

    The service runs as a process of its own on this machine, beside the clients. The rows are the intervals
    of frames, the time until a sketch and a push are seen, until hostile uploads are refused, and until
    sessions are back after `kill -9`, and the cost of a slow client.
    """
    origin = origin_of("service", settings)
    rows = measured(partial(measure, settings), len(settings.part), origin)
    report(rows, _COLUMNS, origin, json_file)
