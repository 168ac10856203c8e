"""`hybridmpm serve`: start the service, looked up by name because the library does not depend on it."""

import importlib

import click


@click.command(
    add_help_option=False, context_settings={"ignore_unknown_options": True, "allow_interspersed_args": False}
)
@click.argument("arguments", nargs=-1, type=click.UNPROCESSED)
@click.pass_context
def serve(ctx: click.Context, *, arguments: tuple[str, ...]) -> None:
    """Start the HTTP service and its page; `hybridmpm serve --help` lists its settings."""
    try:
        service = importlib.import_module("hybridmpm_service")
    except ModuleNotFoundError as error:
        missing = "" if error.name == "hybridmpm_service" else f" completely, {error.name} is missing"
        raise click.ClickException(
            f"the service is not installed{missing}; install it with: pip install 'hybridmpm[service]'"
        ) from None
    ctx.exit(service.main(arguments, "hybridmpm serve"))
