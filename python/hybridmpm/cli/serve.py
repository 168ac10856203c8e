"""`hybridmpm serve` and `hybridmpm key`, of the service, which is looked up by name: no dependency."""

import importlib
from types import ModuleType

import click


def _service() -> ModuleType:
    try:
        return importlib.import_module("hybridmpm_service")
    except ModuleNotFoundError as error:
        missing = "" if error.name == "hybridmpm_service" else f" completely, {error.name} is missing"
        raise click.ClickException(
            f"the service is not installed{missing}; install it with: pip install 'hybridmpm[service]'"
        ) from None


@click.command(
    add_help_option=False, context_settings={"ignore_unknown_options": True, "allow_interspersed_args": False}
)
@click.argument("arguments", nargs=-1, type=click.UNPROCESSED)
@click.pass_context
def key(ctx: click.Context, *, arguments: tuple[str, ...]) -> None:
    """Make a key for a service with `--keys`; `hybridmpm key --help` lists its options."""
    ctx.exit(_service().make_key(arguments, "hybridmpm key"))


@click.command(
    add_help_option=False, context_settings={"ignore_unknown_options": True, "allow_interspersed_args": False}
)
@click.argument("arguments", nargs=-1, type=click.UNPROCESSED)
@click.pass_context
def serve(ctx: click.Context, *, arguments: tuple[str, ...]) -> None:
    """Start the HTTP service and its page; `hybridmpm serve --help` lists its settings."""
    ctx.exit(_service().main(arguments, "hybridmpm serve"))
