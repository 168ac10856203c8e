"""`python -m hybridmpm_lab service`."""

from hybridmpm_lab.harness.command import Measurement, measured
from hybridmpm_lab.service.measurements import ServiceSettings, measure

service = Measurement(
    name="service",
    settings=ServiceSettings,
    measure=measured(measure),
    columns=("measure", "sessions", "viewers", "value", "calm", "unit", "aim"),
    summary="""Measure how long the clients of the service wait.

    The service runs as a process of its own on this machine, beside the clients. The rows are the intervals
    of frames, the time until a sketch and a push are seen, until hostile uploads are refused, and until
    sessions are back after `kill -9`. With --part attacks they are the waits of a bystander beside attacks,
    with --part door what keys and HAProxy add to a call, with --part sizes what sessions take, and
    with --part visit what a visit of the page costs in Chromium, on a slow line, too.
    """,
).command()
