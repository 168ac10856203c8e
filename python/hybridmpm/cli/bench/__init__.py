"""`hybridmpm bench ...`: print a table, with --json write the same rows, with --chart draw them."""

import click

from hybridmpm.cli.bench.errors import downsampling, models
from hybridmpm.cli.bench.hybrid import handoff, hybrid, safeguard
from hybridmpm.cli.bench.speed import batch, mpm, neighbors, scaling, sleeping
from hybridmpm.cli.bench.stability import stability

__all__ = ["bench"]


@click.group()
def bench() -> None:
    """Measure speed and errors on this machine."""


_COMMANDS = (
    mpm, scaling, batch, neighbors, sleeping, downsampling, models, stability, safeguard, handoff, hybrid,
)  # fmt: skip

for command in _COMMANDS:
    bench.add_command(command)
