"""`hybridmpm export`: turn a checkpoint into a model that needs no torch."""

from pathlib import Path
from typing import Any

import click

from hybridmpm._support.files import replacing
from hybridmpm.errors import ConfigError, DataError
from hybridmpm.scene.plain_data import from_json


@click.command()
@click.argument("checkpoint", type=click.Path(dir_okay=False, path_type=Path))
@click.option(
    "--out",
    type=click.Path(dir_okay=False, path_type=Path),
    metavar="FILE.onnx",
    help="File of the model to write.",
)
@click.option(
    "--errors",
    "error_file",
    type=click.Path(dir_okay=False, path_type=Path),
    metavar="FILE.json",
    help="Errors that `python -m hybridmpm_lab models --json` wrote; those of this model are stored with it.",
)
@click.option(
    "--publish",
    "name",
    metavar="NAME",
    help="Name under which the model is added to those of the library, with a card and a manifest entry.",
)
def export(checkpoint: Path, out: Path | None, error_file: Path | None, name: str | None) -> None:
    """Write the network of CHECKPOINT as one ONNX file.

    This needs torch: pip install 'hybridmpm[train]'.
    """
    if out is None and name is None:
        raise click.UsageError("Give --out FILE.onnx, --publish NAME or both.")
    if out is not None and out.suffix != ".onnx":
        raise ConfigError(f"--out must end in .onnx, got {out.name!r}")
    errors = [] if error_file is None else _rows(error_file)
    try:
        from hybridmpm.training import checkpoint as checkpoints  # noqa: PLC0415 - an extra
        from hybridmpm.training.control.controlnet.export import export_controlnet  # noqa: PLC0415
        from hybridmpm.training.control.transport.export import export_transport  # noqa: PLC0415
        from hybridmpm.training.export import export_checkpoint  # noqa: PLC0415
    except ModuleNotFoundError as error:
        raise ConfigError(
            f"exporting needs {error.name}; install it with: pip install 'hybridmpm[train]'"
        ) from None
    match checkpoints.read(checkpoint).get("kind"):
        case "transport":
            made = export_transport(checkpoint)
        case "controlnet":
            made = export_controlnet(checkpoint)
        case _:
            made = export_checkpoint(checkpoint, errors, name=name)
    files = [] if name is None else made.publish(name)
    if out is not None:
        with replacing(out) as part:
            part.write_bytes(made.data)
        files.insert(0, out)
    size = f"{made.parameters} parameters, {len(made.data) / 1e3:.0f} kB"
    click.echo(f"{size}: wrote {', '.join(map(str, files))}")


def _rows(path: Path) -> list[dict[str, Any]]:
    try:
        rows = from_json(path.read_bytes())
    except (OSError, ValueError) as error:
        raise DataError(f"{path} cannot be read as JSON: {error}") from None
    if not isinstance(rows, list) or not all(isinstance(row, dict) for row in rows):
        raise DataError(f"{path} must be a JSON list of objects, each a row of errors")
    return rows
