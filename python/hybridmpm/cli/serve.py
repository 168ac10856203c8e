"""`hybridmpm serve`: a launcher only, since the library does not depend on its service."""

import importlib

import click


@click.command()
@click.option("--host", help="Address to listen on; default: the service's setting, 127.0.0.1.")
@click.option("--port", type=click.IntRange(0, 65535), help="Default: the service's setting, 8000.")
@click.pass_context
def serve(ctx: click.Context, *, host: str | None, port: int | None) -> None:
    """Start the HTTP service with its page."""
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
        # The usual way to end it, so there is nothing to tell.
        ctx.exit(130)
