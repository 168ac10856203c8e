"""`python -m hybridmpm_lab fit`."""

from pathlib import Path

import click

from hybridmpm.cli.progress import progress
from hybridmpm_lab.fitting.levels import FitSettings, fit_levels
from hybridmpm_lab.harness.settings import settings_options
from hybridmpm_lab.harness.table import print_table

_COLUMNS = (
    "material", "dim", "coarse", "particles_per_cell", "modulus", "cfl", "affine_share", "relaxation",
    "scenario", "error", "error_se", "unfitted", "transport", "transport_few", "density", "substeps",
)  # fmt: skip


@click.command()
@click.argument("folder", type=click.Path(file_okay=False, path_type=Path))
@click.option(
    "--table",
    "file",
    type=click.Path(dir_okay=False, path_type=Path),
    metavar="FILE",
    help="JSON file of the levels. Those that it has stay unless this search beats them. Default: "
    "levels.json in FOLDER.",
)
@settings_options(FitSettings)
def fit(settings: FitSettings, folder: Path, file: Path | None) -> None:
    """Fit the constants of coarse levels: grid, moduli, step and upsampling, for each material and dimension.

    FOLDER keeps every trial and the truths of the scenes: an interrupted command is resumed, and with more
    --trials it searches on. Two commands may share a FOLDER if they fit different scenarios into different
    tables. Use a table by MpmSolver(scene, coarse=coarse_level(scene, "1/16", coarse_table(FILE))).
    """
    file = folder / "levels.json" if file is None else file
    if file.parent != folder and not file.parent.is_dir():
        raise click.UsageError(f"--table: the folder {file.parent} does not exist.")
    with progress("Fitting", settings.steps) as bar:
        table = fit_levels(settings, folder=folder, file=file, on_step=lambda: bar.update(1))
    rows = [
        {"coarse": entry.name, **entry.model_dump(exclude={"held_out"}), **seen.model_dump()}
        for entry in table.entries
        for seen in entry.held_out
    ]
    print_table(rows, _COLUMNS)
    click.echo(f"wrote {file}")
