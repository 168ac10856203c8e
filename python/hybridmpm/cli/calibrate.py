"""`hybridmpm calibrate`: measure what plans assume about the time of this machine."""

import datetime as dt
from pathlib import Path

import click

from hybridmpm._support.files import replacing
from hybridmpm.cli.progress import progress
from hybridmpm.errors import ExportError
from hybridmpm.planner.calibrating import measure
from hybridmpm.planner.store import user_file

_SIZE = 4000
"""Particles of the frames whose times are printed."""


@click.command()
@click.option(
    "--out",
    "out_file",
    type=click.Path(dir_okay=False, path_type=Path),
    metavar="FILE",
    help="File for the times. Default: the user's own, where plans look for them.",
)
def calibrate(*, out_file: Path | None) -> None:
    """Measure the time of each kind of work on this machine, in under a minute.

    Plans (`hybridmpm plan`, `hybridmpm.plan`) then estimate times of this machine. Run nothing else
    meanwhile.
    """
    file = user_file() if out_file is None else out_file
    try:
        file.parent.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise ExportError(f"cannot write {file}: {error.strerror or error}") from error
    with progress("Calibrating", measure.COUNT) as bar:
        times = measure.measure(dt.datetime.now(dt.UTC).date().isoformat(), bar.update)
    with replacing(file) as part:
        part.write_text(f"{times.model_dump_json(indent=1)}\n", encoding="utf-8")
    for one in times.materials:
        each = one.substep + one.particle_substep * _SIZE + one.cell_substep * _SIZE / 2**one.dim
        ms = (10 * each + one.frame + one.particle * _SIZE) / 1e3
        click.echo(f"{one.material} in {one.dim}D: {ms:.2f} ms for {_SIZE} particles and 10 substeps")
    click.echo(f"written to {file}")
