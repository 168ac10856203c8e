"""`hybridmpm bench stability`."""

from collections.abc import Sequence
from functools import partial
from pathlib import Path

import click

from hybridmpm.bench.report.rows import Row
from hybridmpm.bench.stability import stability as stability_bench
from hybridmpm.cli.bench.options import chart_option, json_option, measured, print_origin, save, source


@click.command()
@click.option(
    "--level",
    "levels",
    type=click.FloatRange(0.05, 2.0),
    multiple=True,
    help="CFL number. May be given several times. If absent, many levels from 0.2 to 1.2.",
)
@json_option
@chart_option
def stability(*, levels: tuple[float, ...], json_file: Path | None, chart_file: Path | None) -> None:
    """Find the CFL numbers that each material survives.

    Each material runs as a splash, and as particles too far apart to feel each other.
    """
    todo = stability_bench.cases(sorted(set(levels)) or stability_bench.LEVELS)
    origin = source("stability", level=levels)
    rows = measured(partial(stability_bench.measure, todo), len(todo), origin)
    save(rows, json_file, chart_file, stability_bench.chart)
    _print_map(rows)
    print_origin(origin)


def _print_map(rows: Sequence[Row]) -> None:
    """Print a line for each material, dimension and stress, with a letter for each level; then the limits."""
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
            f"{material} {dim}D is stable up to CFL {limit:g}, "
            f"{limit / stability_bench.material(material).default_cfl:.2f} times the default"
        )
