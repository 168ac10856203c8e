"""The `hybridmpm` command. Each module has related subcommands; this one finds them.

An error ends the command with one line on stderr, without a traceback. The exit status is 2 for bad input,
1 for a run that failed and 130 after Ctrl-C.
"""

import importlib
import warnings
from collections import UserDict
from collections.abc import Iterator
from typing import Any

import click

from hybridmpm import __version__
from hybridmpm.errors import ConfigError, DataError, SimulationError, SnapshotError

__all__ = ["cli", "main"]

_MODULES = {
    "bench": "bench",
    "check": "check",
    "control": "control",
    "dataset": "dataset",
    "doctor": "report",
    "export": "export",
    "fit": "fit",
    "scenarios": "report",
    "plan": "plan",
    "schema": "report",
    "serve": "serve",
    "simulate": "simulate",
    "train": "train",
    "validate": "validate",
}
"""Module of this package that has each subcommand."""


class _Subcommands(UserDict[str, click.Command]):
    """Subcommands by name. Each is imported when it is asked for, because their imports take 0.1 s."""

    def __missing__(self, name: str) -> click.Command:
        module = importlib.import_module(f"{__name__}.{_MODULES[name]}")
        command: click.Command = getattr(module, name)
        return command

    def __contains__(self, name: object) -> bool:
        return name in _MODULES

    def __iter__(self) -> Iterator[str]:
        return iter(_MODULES)

    def __len__(self) -> int:
        return len(_MODULES)


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


@click.group(cls=_Commands, commands=_Subcommands(), context_settings={"help_option_names": ["-h", "--help"]})
@click.version_option(__version__, prog_name="hybridmpm")
def cli() -> None:
    """Simulate fluids, check scenes, make data sets, train networks, fit solvers, measure, and serve."""


def main() -> None:
    """Run the command line and exit."""
    warnings.formatwarning = lambda message, *_args, **_more: f"Warning: {message}\n"
    cli(prog_name="hybridmpm")
