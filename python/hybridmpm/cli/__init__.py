"""The `hybridmpm` command. Each module has related subcommands; this one finds them.

An error ends the command with one line on stderr, without a traceback. The exit status is 2 for bad input,
1 for a run that failed, 130 after Ctrl-C, 143 after SIGTERM and 129 after SIGHUP.
"""

import importlib
import warnings
from collections import UserDict
from collections.abc import Iterator
from typing import Any

import click

from hybridmpm._core import __version__
from hybridmpm._support.signals import TerminatedError
from hybridmpm.errors import ConfigError, DataError, SimulationError, SnapshotError

__all__ = ["cli", "main"]

_MODULES = {
    "calibrate": "calibrate",
    "check": "check",
    "control": "control",
    "dataset": "dataset",
    "doctor": "report",
    "export": "export",
    "key": "serve",
    "scenarios": "report",
    "plan": "plan",
    "schema": "report",
    "serve": "serve",
    "simulate": "simulate",
    "train": "train",
}
"""Module of this package that has each subcommand."""


class _Subcommands(UserDict[str, click.Command]):
    """Subcommands by name. Each is imported at its first use, because their imports take 0.1 s."""

    def __init__(self, package: str, modules: dict[str, str]) -> None:
        super().__init__()
        self._package = package
        self._modules = modules

    def __missing__(self, name: str) -> click.Command:
        module = importlib.import_module(f"{self._package}.{self._modules[name]}")
        command: click.Command = getattr(module, name.replace("-", "_"))
        return command

    def __contains__(self, name: object) -> bool:
        return name in self._modules

    def __iter__(self) -> Iterator[str]:
        return iter(self._modules)

    def __len__(self) -> int:
        return len(self._modules)


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
        except TerminatedError as signal:
            click.echo(f"\n{signal}: ended; no unfinished file is left.", err=True)
            ctx.exit(128 + signal.number)


def _one_line(error: Exception) -> str:
    return " ".join(str(error).split())


def commands_of(package: str, modules: dict[str, str], summary: str) -> click.Group:
    """Return a command group.

    Parameters
    ----------
    package : str
        Package of the modules.
    modules : dict of str to str
        Module of each subcommand; the command has its key's name there.
    summary : str
        First line of the help.
    """
    settings = {"help_option_names": ["-h", "--help"]}
    return _Commands(help=summary, commands=_Subcommands(package, modules), context_settings=settings)


cli = click.version_option(__version__, prog_name="hybridmpm")(
    commands_of(__name__, _MODULES, "Simulate fluids, check scenes, make data, train networks, and serve.")
)


def main() -> None:
    """Run the command line and exit."""
    warnings.formatwarning = lambda message, *_args, **_more: f"Warning: {message}\n"
    cli(prog_name="hybridmpm")
