"""`hybridmpm serve`: start the service, looked up by name because the library does not depend on it."""

import importlib

import click


@click.command()
@click.option("--host", help="Address to listen on. Default: the service's setting, 127.0.0.1 if unset.")
@click.option(
    "--port",
    type=click.IntRange(0, 65535),
    help="Port to listen on, 0 for any free one. Default: the service's setting, 8000 if unset.",
)
@click.pass_context
def serve(ctx: click.Context, *, host: str | None, port: int | None) -> None:
    """Start the HTTP service and its page."""
    try:
        service = importlib.import_module("hybridmpm_service")
    except ModuleNotFoundError as error:
        missing = "" if error.name == "hybridmpm_service" else f" completely, {error.name} is missing"
        raise click.ClickException(
            f"the service is not installed{missing}; install it with: pip install hybridmpm-service"
        ) from None
    try:
        service.serve(host=host, port=port)
    except KeyboardInterrupt:
        # Ctrl-C is the usual way to end the service, so no message is due.
        ctx.exit(130)
