"""The `hybridmpm` command. Each module has related subcommands; this one puts them together.

An error ends the command with one line on stderr, without a traceback. The exit status is 2 for bad input,
1 for a run that failed and 130 after Ctrl-C.
"""

import warnings
from typing import Any

import click

from hybridmpm import __version__
from hybridmpm.cli.bench import bench
from hybridmpm.cli.control import control
from hybridmpm.cli.dataset import dataset
from hybridmpm.cli.export import export
from hybridmpm.cli.fit import fit
from hybridmpm.cli.report import doctor, scenarios, schema
from hybridmpm.cli.serve import serve
from hybridmpm.cli.simulate import simulate
from hybridmpm.cli.train import train
from hybridmpm.cli.validate import validate
from hybridmpm.errors import ConfigError, DataError, SimulationError, SnapshotError

__all__ = ["cli", "main"]


class _BadInput(click.ClickException):
    exit_code = 2


class _Commands(click.Group):
    """Turns every error of the library or the user into one line and an exit status."""

    def invoke(self, ctx: click.Context) -> Any:
        try:
            return super().invoke(ctx)
        except click.exceptions.NoArgsIsHelpError:
            raise
        except click.UsageError as error:
            usage = error.ctx.command_path if error.ctx else ctx.command_path
            raise _BadInput(f"{error.format_message()} See {usage} --help") from None
        except (ConfigError, DataError, SnapshotError) as error:
            raise _BadInput(_one_line(error)) from None
        except SimulationError as error:
            raise click.ClickException(_one_line(error)) from None
        except KeyboardInterrupt:
            click.echo("\nInterrupted; no unfinished file is left.", err=True)
            ctx.exit(130)


def _one_line(error: Exception) -> str:
    return " ".join(str(error).split())


@click.group(cls=_Commands, context_settings={"help_option_names": ["-h", "--help"]})
@click.version_option(__version__, prog_name="hybridmpm")
def cli() -> None:
    """Simulate particle fluids, make data sets, train networks, fit solvers, measure, and serve sessions."""


for command in (
    simulate, control, dataset, train, fit, export, scenarios, schema, serve, bench, validate, doctor,
):  # fmt: skip
    cli.add_command(command)


def main() -> None:
    """Run the command line and exit."""
    warnings.formatwarning = lambda message, *_args, **_more: f"Warning: {message}\n"
    cli(prog_name="hybridmpm")
