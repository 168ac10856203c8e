"""`hybridmpm bench ...`: print a table, with --json write its rows, with --chart draw them."""

from pathlib import Path
from typing import Any

import click

from hybridmpm import charts
from hybridmpm._native import DEFAULT_CFL
from hybridmpm.bench import mpm as mpm_bench
from hybridmpm.bench import stability as stability_bench
from hybridmpm.bench.provenance import provenance, write_rows
from hybridmpm.cli.progress import progress

_COLUMNS = ("dim", "material", "particles", "threads", "substeps", "ns_per_particle_substep", "ms_per_frame")


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
@click.option(
    "--level",
    "levels",
    type=click.FloatRange(0.05, 2.0),
    multiple=True,
    help="CFL numbers; 0.2 to 1.2 if absent.",
)
@click.option(
    "--json",
    "file",
    type=click.Path(dir_okay=False, path_type=Path),
    metavar="FILE",
    help="Also write the rows there.",
)
@click.option(
    "--chart",
    "picture",
    type=click.Path(dir_okay=False, path_type=Path),
    metavar="FILE",
    help="Also draw the map, as FILE.svg and FILE.png.",
)
def stability(*, levels: tuple[float, ...], file: Path | None, picture: Path | None) -> None:
    """Find the CFL numbers at which each material stops being stable, in splashes and for particles alone."""
    for option, path in (("--json", file), ("--chart", picture)):
        if path is not None and not path.parent.is_dir():
            raise click.UsageError(f"{option}: the folder {path.parent} does not exist.")
    todo = stability_bench.cases(sorted(set(levels)) or stability_bench.LEVELS)
    source = provenance(" ".join(["hybridmpm bench stability", *(f"--level {level:g}" for level in levels)]))
    rows = []
    with progress("Measuring", len(todo)) as bar:
        for row in stability_bench.rows(todo, source):
            rows.append(row)
            bar.update(1)
    if file is not None:
        write_rows(file, rows)
    if picture is not None:
        charts.save(stability_bench.chart(rows), picture)
    _print_stability(rows)
    click.echo(f"{source.machine}, {source.date}, commit {source.commit or 'unknown'}")


def _print_stability(rows: list[dict[str, Any]]) -> None:
    """Print one line per material, dimension and stress, one letter per level, and the limits."""
    levels = list(dict.fromkeys(row["level"] for row in rows))
    click.echo(
        f"CFL {levels[0]:g} to {levels[-1]:g} in {len(levels)} levels: . survived, d degraded, F failed"
    )
    lines: dict[tuple[str, int, str], str] = {}
    for row in rows:
        key = (row["material"], row["dim"], row["stress"])
        letter = {"survived": ".", "degraded": "d", "failed": "F"}[row["outcome"]]
        lines[key] = lines.get(key, "") + letter
    for (material, dim, stress), letters in lines.items():
        click.echo(f"{material:8} {dim}D  {stress:16} {letters}")
    for (material, dim), limit in stability_bench.limits(rows).items():
        click.echo(
            f"{material} {dim}D is stable up to CFL {limit:g}, {limit / DEFAULT_CFL:.2f} times the default"
        )
