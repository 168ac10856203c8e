"""`hybridmpm bench stability`."""

from pathlib import Path
from typing import Any

import click

from hybridmpm._support import charts
from hybridmpm.bench.report.provenance import write_rows
from hybridmpm.bench.stability import stability as stability_bench
from hybridmpm.cli.bench.options import chart_option, json_option, measured, source


@click.command()
@click.option(
    "--level",
    "levels",
    type=click.FloatRange(0.05, 2.0),
    multiple=True,
    help="CFL numbers; 0.2 to 1.2 if absent.",
)
@json_option
@chart_option
def stability(*, levels: tuple[float, ...], json_file: Path | None, chart_file: Path | None) -> None:
    """Find the CFL numbers at which each material stops being stable, in splashes and for particles alone."""
    todo = stability_bench.cases(sorted(set(levels)) or stability_bench.LEVELS)
    origin = source("stability", level=levels)
    rows = measured(stability_bench.rows(todo, origin), len(todo))
    if json_file is not None:
        write_rows(json_file, rows)
    if chart_file is not None:
        charts.save(stability_bench.chart(rows), chart_file)
    _print_stability(rows)
    click.echo(f"{origin.machine}, {origin.date}, commit {origin.commit or 'unknown'}")


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
            f"{material} {dim}D is stable up to CFL {limit:g}, "
            f"{limit / stability_bench.material(material).default_cfl:.2f} times the default"
        )
