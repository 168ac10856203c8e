"""The commands of `hybridmpm fit`: levels."""

from pathlib import Path

import click

from hybridmpm.cli.progress import progress
from hybridmpm_lab.commands.options import number_option, print_table
from hybridmpm_lab.fitting.levels import FitSettings, fit_levels
from hybridmpm_lab.fitting.space import RATIOS, TARGETS

_COLUMNS = (
    "material", "dim", "coarse", "particles_per_cell", "modulus", "cfl", "affine_share", "relaxation",
    "scenario", "error", "error_se", "unfitted", "transport", "transport_few", "density", "substeps",
)  # fmt: skip


@click.group()
def fit() -> None:
    """Learn constants of the solver from scenes."""


@fit.command()
@click.argument("folder", type=click.Path(file_okay=False, path_type=Path))
@click.option(
    "--table",
    "file",
    type=click.Path(dir_okay=False, path_type=Path),
    metavar="FILE",
    help="JSON file of the coarse levels; those that it holds already stay unless a search of now beats them. "
    "Default: levels.json in FOLDER.",
)
@click.option(
    "--scenario",
    "names",
    type=click.Choice(list(dict.fromkeys(one.scenario for one in TARGETS))),
    multiple=True,
    help="Scenario whose scenes coarse levels are fitted to: a material in a dimension. May be given several times. "
    "Default: all.",
)
@click.option(
    "--coarse",
    "coarse levels",
    type=click.Choice(list(RATIOS)),
    multiple=True,
    help="CoarseLevel that is fitted. May be given several times. Default: all.",
)
@number_option(
    "--trials",
    0,
    100_000,
    FitSettings.trials,
    "Number of points that each search tries; with 0 the coarse levels of the table are judged anew.",
)
@number_option("--scenes", 1, 1000, FitSettings.scenes, "Number of training scenes, from seed 0 on.")
@number_option("--held-out", 2, 1000, FitSettings.held_out, "Number of scenes a coarse level is judged on.")
def levels(
    *, folder: Path, file: Path | None, names: tuple[str, ...], levels: tuple[str, ...], **options: int
) -> None:
    """Fit coarse levels of carried coarse MPM: grid, moduli, step and carrying, for each material and dimension.

    FOLDER keeps every trial and the truths of the scenes: after an interruption the same command goes on
    where it stopped, and with more --trials it searches on. Two commands may share a FOLDER if they fit
    different scenarios into different tables. Use a table by
    MpmSolver(scene, coarse=coarse_level(scene, "1/16", coarse_table(FILE))).
    """
    targets = [
        one
        for one in TARGETS
        if one.scenario in (names or (one.scenario,)) and one.name in (levels or RATIOS)
    ]
    settings = FitSettings(**options)
    file = folder / "levels.json" if file is None else file
    if file.parent != folder and not file.parent.is_dir():
        raise click.UsageError(f"--table: the folder {file.parent} does not exist.")
    with progress("Fitting", settings.steps(targets)) as bar:
        table = fit_levels(targets, settings, folder=folder, file=file, on_step=lambda: bar.update(1))
    rows = [
        {"coarse": entry.name, **entry.model_dump(exclude={"held_out"}), **seen.model_dump()}
        for entry in table.entries
        for seen in entry.held_out
    ]
    print_table(rows, _COLUMNS)
    click.echo(f"wrote {file}")
