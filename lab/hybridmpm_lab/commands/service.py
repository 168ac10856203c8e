"""`python -m hybridmpm_lab service`."""

from functools import partial

from hybridmpm_lab.commands.options import Measurement, measured
from hybridmpm_lab.service.measurements import ServiceSettings, measure

service = Measurement(
    name="service",
    settings=ServiceSettings,
    measure=lambda settings, origin: measured(partial(measure, settings), len(settings.part), origin),
    columns=("measure", "sessions", "viewers", "value", "unit", "aim"),
    summary="""Measure how long the clients of the service wait.

    The service runs as a process of its own on this machine, beside the clients. The rows are the intervals
    of frames, the time until a sketch and a push are seen, until hostile uploads are refused, and until
    sessions are back after `kill -9`, and the cost of a slow client.
    """,
).command()
