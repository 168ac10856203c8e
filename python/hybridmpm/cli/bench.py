"""`hybridmpm bench ...`: print a table, and with --json write the same rows."""

from pathlib import Path

import click

from hybridmpm import scenarios
from hybridmpm.bench import batch as batch_bench
from hybridmpm.bench import mpm as mpm_bench
from hybridmpm.bench.provenance import provenance, write_rows
from hybridmpm.cli.progress import progress

_COLUMNS = ("dim", "material", "particles", "threads", "substeps", "ns_per_particle_substep", "ms_per_frame")

_BATCH_COLUMNS = (
    "scenario",
    "scenes",
    "particles",
    "threads",
    "ms_per_scene_frame",
    "frames_per_second",
    "speedup",
)


@click.group()
def bench() -> None:
    """Measure speed on this machine."""


@bench.command()
@click.option("--particles", type=click.IntRange(64, 40_000), default=4000, show_default=True)
@click.option("--threads", type=click.IntRange(1, 1024), default=1, show_default=True)
@click.option(
    "--repeats", type=click.IntRange(1, 1000), default=9, show_default=True, help="The median is reported."
)
@click.option(
    "--json",
    "file",
    type=click.Path(dir_okay=False, path_type=Path),
    metavar="FILE",
    help="Also write the rows there.",
)
def mpm(*, particles: int, threads: int, repeats: int, file: Path | None) -> None:
    """Time the solver on water and sand in 2D and 3D, mid-splash, at the ground truth's substeps."""
    if file is not None and not file.parent.is_dir():
        raise click.UsageError(f"--json: the folder {file.parent} does not exist.")
    settings = mpm_bench.Settings(particles=particles, threads=threads, repeats=repeats)
    source = provenance(
        f"hybridmpm bench mpm --particles {particles} --threads {threads} --repeats {repeats}"
    )
    rows = []
    with progress("Measuring", len(mpm_bench.CASES)) as bar:
        for row in mpm_bench.rows(settings, source):
            rows.append(row)
            bar.update(1)
    if file is not None:
        write_rows(file, rows)
    click.echo("  ".join(_COLUMNS))
    for row in rows:
        click.echo("  ".join(str(row[name]).rjust(len(name)) for name in _COLUMNS))
    click.echo(f"{source.machine}, {source.date}, commit {source.commit or 'unknown'}")


@bench.command()
@click.argument("scenario", default="water_2d", type=click.Choice(scenarios.NAMES))
@click.option("--scenes", type=click.IntRange(1, 1000), default=16, show_default=True)
@click.option("--threads", type=click.IntRange(2, 1024), default=2, show_default=True, help="Against one.")
@click.option(
    "--frames", type=click.IntRange(1, 1000), default=10, show_default=True, help="Timed in one go."
)
@click.option(
    "--repeats",
    type=click.IntRange(1, 1000),
    default=9,
    show_default=True,
    help="The least time is reported.",
)
@click.option(
    "--json",
    "file",
    type=click.Path(dir_okay=False, path_type=Path),
    metavar="FILE",
    help="Also write the rows there.",
)
def batch(*, scenario: str, scenes: int, threads: int, frames: int, repeats: int, file: Path | None) -> None:
    """Time many scenes of SCENARIO, in the middle of their splash, on one thread and on several."""
    if file is not None and not file.parent.is_dir():
        raise click.UsageError(f"--json: the folder {file.parent} does not exist.")
    settings = batch_bench.Settings(
        scenario=scenario, scenes=scenes, threads=threads, frames=frames, repeats=repeats
    )
    source = provenance(
        f"hybridmpm bench batch {scenario} --scenes {scenes} --threads {threads} --frames {frames} "
        f"--repeats {repeats}"
    )
    with progress("Measuring", repeats) as bar:
        rows = batch_bench.rows(settings, source, on_progress=bar.update)
    if file is not None:
        write_rows(file, rows)
    click.echo("  ".join(_BATCH_COLUMNS))
    for row in rows:
        click.echo("  ".join(str(row[name]).rjust(len(name)) for name in _BATCH_COLUMNS))
    click.echo(f"{source.machine}, {source.date}, commit {source.commit or 'unknown'}")
