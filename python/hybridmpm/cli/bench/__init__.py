"""`hybridmpm bench ...`: measures, prints a table, and writes (--json) or draws (--chart) the same rows."""

from pathlib import Path

import click

from hybridmpm.bench.catalogue import BENCHES
from hybridmpm.bench.staleness.results import dated_results
from hybridmpm.cli.bench.charts.crossing import crossing
from hybridmpm.cli.bench.charts.plans import calibrate, plans
from hybridmpm.cli.bench.charts.tradeoff import tradeoff
from hybridmpm.cli.bench.control import control
from hybridmpm.cli.bench.errors import downsampling, models
from hybridmpm.cli.bench.hybrid import handoff, hybrid, safeguard, shares
from hybridmpm.cli.bench.reversal import reversal
from hybridmpm.cli.bench.service import service
from hybridmpm.cli.bench.speed import batch, mpm, neighbors, scaling, sleeping
from hybridmpm.cli.bench.stability import stability
from hybridmpm.cli.bench.sweep import sweep

__all__ = ["bench"]

_NAMED = 8
"""Number of changed files that are named for each result."""


@click.group(invoke_without_command=True)
@click.option(
    "--stale",
    is_flag=True,
    help="Name the committed results that are older than the code behind them, and measure nothing.",
)
@click.option(
    "--results",
    "folder",
    type=click.Path(file_okay=False, path_type=Path),
    default=Path("docs/results"),
    show_default=True,
    metavar="FOLDER",
    help="Folder of the results that --stale looks at.",
)
@click.pass_context
def bench(ctx: click.Context, *, stale: bool, folder: Path) -> None:
    """Measure speed and errors on this machine."""
    if ctx.invoked_subcommand is None and not stale:
        click.echo(ctx.get_help())
    if stale:
        _print_stale(folder)
        ctx.exit()


def _print_stale(folder: Path) -> None:
    found = dated_results(folder, BENCHES)
    for one in found:
        if one.changed:
            some, others = ", ".join(one.changed[:_NAMED]), len(one.changed) - _NAMED
            more = f" and {others} more" if others > 0 else ""
            click.echo(f"{one.file}: since {one.commit[:10]} changed {some}{more}")
    if not any(one.changed for one in found):
        click.echo(f"all {len(found)} results are those of the present code")


_COMMANDS = (
    mpm, scaling, batch, neighbors, sleeping, downsampling, models, sweep, stability, safeguard, handoff,
    shares, hybrid, reversal, tradeoff, crossing, control, service, calibrate,
    plans,
)  # fmt: skip

for command in _COMMANDS:
    bench.add_command(command)
