"""`python -m hybridmpm_lab stability`."""

from collections.abc import Sequence
from functools import partial
from pathlib import Path

import click

from hybridmpm.cli.progress import progress
from hybridmpm_lab.commands.options import (
    chart_option,
    json_option,
    measured,
    print_origin,
    print_table,
    runs_option,
    save,
    source,
)
from hybridmpm_lab.harness.rows import Row
from hybridmpm_lab.harness.store import RowStore
from hybridmpm_lab.stability import map as stability_map
from hybridmpm_lab.stability import map_chart
from hybridmpm_lab.stability import stability as stability_bench

_LETTERS = {"survived": ".", "refused": "x", "degraded": "d", "failed": "F"}
_TOLD = ("stress", "material", "dim", "level", "method", "outcome", "against", "signalled")


@click.command()
@click.option(
    "--level",
    "levels",
    type=click.FloatRange(0.05, 2.0),
    multiple=True,
    help="CFL number. May be given several times. If absent, many levels from 0.2 to 1.2.",
)
@click.option(
    "--map",
    "is_map",
    is_flag=True,
    help="Put MPM, MPM with few particles, the network and the hybrid under each stress instead.",
)
@click.option(
    "--stress",
    "stresses",
    type=click.Choice(tuple(stability_map.STRESSES)),
    multiple=True,
    help="Stress of the map. May be given several times. If absent, all.",
)
@runs_option
@json_option
@chart_option
def stability(
    *,
    levels: tuple[float, ...],
    is_map: bool,
    stresses: tuple[str, ...],
    runs_file: Path | None,
    json_file: Path | None,
    chart_file: Path | None,
) -> None:
    """Find the CFL numbers that each material survives; with --map, the scenes that each method survives.

    Each material runs as a splash, and as particles too far apart to feel each other.
    """
    if is_map:
        if levels:
            raise click.UsageError("--level is not for --map: a stress has its own levels.")
        _map(stresses, runs_file, json_file, chart_file)
        return
    if stresses or runs_file is not None:
        raise click.UsageError("--stress and --runs are for the map: add --map.")
    todo = stability_bench.cases(sorted(set(levels)) or stability_bench.LEVELS)
    origin = source("stability", level=levels)
    rows = measured(partial(stability_bench.measure, todo), len(todo), origin)
    save(rows, json_file, chart_file, stability_bench.chart)
    _print_levels(rows)
    print_origin(origin)


def _map(
    stresses: tuple[str, ...], runs_file: Path | None, json_file: Path | None, chart_file: Path | None
) -> None:
    todo = stability_map.cells(stresses)
    origin = source("stability --map", stress=stresses)
    runs = RowStore({"levels": stability_map.LEVELS}, runs_file)
    with progress("Measuring", len(todo)) as bar:
        rows = list(stability_map.measure(todo, runs, origin, bar.update))
    save(rows, json_file, chart_file, map_chart.chart)
    _print_cells(rows)
    print_origin(origin)


def _print_cells(rows: Sequence[Row]) -> None:
    """Print a line for each stress and setting with a letter for each level, then what to look at."""
    click.echo("three levels each: . survived, x refused, d degraded, F failed; ! where nobody is told")
    lines: dict[tuple[str, ...], dict[str, str]] = {}
    for row in rows:
        line = lines.setdefault((row["stress"], f"{row['material']} {row['dim']}D"), {})
        untold = row["outcome"] in ("degraded", "failed") and not row["signalled"]
        letter = _LETTERS[row["outcome"]] + "!" * untold
        line[row["method"]] = line.get(row["method"], "") + letter
    click.echo("".join(name.ljust(width) for name, width in (("stress", 18), ("setting", 12))), nl=False)
    click.echo("".join(name.ljust(10) for name in map_chart.METHODS))
    for (stress, setting), letters in lines.items():
        shown = "".join(letters.get(method, "").ljust(10) for method in map_chart.METHODS)
        click.echo(f"{stress:18}{setting:12}{shown}")
    for title, chosen in (
        ("Degraded or failed, and nobody is told", stability_map.defects(rows)),
        ("Where the network does not survive and the hybrid does", stability_map.rescued(rows)),
    ):
        click.echo(f"\n{title}: {len(chosen)}")
        if chosen:
            print_table(chosen, _TOLD)


def _print_levels(rows: Sequence[Row]) -> None:
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
