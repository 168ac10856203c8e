"""`hybridmpm bench ...`: print a table, with --json write the same rows, with --chart draw them."""

import click

from hybridmpm.cli.bench.errors import downsampling, models
from hybridmpm.cli.bench.speed import batch, mpm, neighbors, scaling, sleeping
from hybridmpm.cli.bench.stability import stability

__all__ = ["bench"]


@click.group()
def bench() -> None:
    """Measure speed and errors on this machine."""


for command in (mpm, scaling, batch, neighbors, sleeping, downsampling, models, stability):
    bench.add_command(command)
