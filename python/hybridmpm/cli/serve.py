"""`hybridmpm serve`: a launcher only, since the library does not depend on its service."""

import importlib

import click


@click.command()
@click.option("--host", help="Address to listen on; default: the service's setting, 127.0.0.1.")
@click.option("--port", type=click.IntRange(0, 65535), help="Default: the service's setting, 8000.")
def serve(*, host: str | None, port: int | None) -> None:
    """Start the HTTP service with its page."""
    try:
        service = importlib.import_module("hybridmpm_service")
    except ModuleNotFoundError as error:
        if error.name != "hybridmpm_service":
            raise
        raise click.ClickException(
            "the service is not installed; install it with: pip install hybridmpm-service"
        ) from None
    service.serve(host=host, port=port)
