"""`hybridmpm bench ...`: print a table, with --json write the same rows, with --chart draw them."""

from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Any

import click

from hybridmpm import charts, scenarios
from hybridmpm.bench import batch as batch_bench
from hybridmpm.bench import downsampling as downsampling_bench
from hybridmpm.bench import mpm as mpm_bench
from hybridmpm.bench import neighbors as neighbors_bench
from hybridmpm.bench import scaling as scaling_bench
from hybridmpm.bench import sleeping as sleeping_bench
from hybridmpm.bench import stability as stability_bench
from hybridmpm.bench.provenance import Provenance, provenance, write_rows
from hybridmpm.cli.progress import progress

_MPM_COLUMNS = (
    "dim", "material", "particles", "resolution", "threads", "substeps", "ns_per_particle_substep",
    "ms_per_frame",
)  # fmt: skip
_PEER_COLUMNS = ("peer", "peer_ns", "peer_threads", "ratio")
_SCALING_COLUMNS = (
    "series", "dim", "particles", "resolution", "threads", "ms_per_substep", "ns_per_particle_substep",
)  # fmt: skip
_SLEEPING_COLUMNS = ("particles", "frame", "asleep", "ms_awake", "ms_sleeping", "ratio", "error", "floor")
_BATCH_COLUMNS = (
    "scenario", "scenes", "particles", "threads", "ms_per_scene_frame", "frames_per_second", "speedup",
)  # fmt: skip
_DOWNSAMPLING_COLUMNS = (
    "scenario", "method", "label", "particles", "resolution", "ms_per_frame", "grid_rmse_mean",
    "grid_rmse_mean_se", "grid_nrmse_mean", "grid_node_error_mean", "kinetic_energy_mean", "centroid_mean",
)  # fmt: skip
_NEIGHBORS_COLUMNS = (
    "dim", "particles", "radius", "edges", "threads", "ms", "ms_reused", "ms_verlet",
)  # fmt: skip


@click.group()
def bench() -> None:
    """Measure speed on this machine."""


def _file_option(name: str, target: str, check: Callable[..., Path | None], text: str) -> Callable[..., Any]:
    kind = click.Path(dir_okay=False, path_type=Path)
    return click.option(name, target, type=kind, metavar="FILE", callback=check, help=text)


def _in_a_folder(_context: click.Context, option: click.Parameter, file: Path | None) -> Path | None:
    if file is not None and not file.parent.is_dir():
        raise click.UsageError(f"{option.opts[0]}: the folder {file.parent} does not exist.")
    return file


def _drawable(context: click.Context, option: click.Parameter, file: Path | None) -> Path | None:
    if file is not None:
        charts.panels()  # Without matplotlib the error comes here, not after the measurement.
    return _in_a_folder(context, option, file)


_json_option = _file_option("--json", "json_file", _in_a_folder, "Also write the rows there.")
_chart_option = _file_option("--chart", "chart_file", _drawable, "Also draw them there, as SVG and PNG.")
_repeats_option = click.option(
    "--repeats", type=click.IntRange(1, 1000), default=9, show_default=True, help="The median is reported."
)


def _many(name: str, kind: click.IntRange, default: tuple[int, ...], text: str) -> Callable[..., Any]:
    text += " May be given several times."
    return click.option(name, type=kind, multiple=True, default=default, show_default=True, help=text)


@bench.command()
@_many("--particles", click.IntRange(64, mpm_bench.MAX_PARTICLES), mpm_bench.Settings.particles, "Sizes.")
@_many("--threads", click.IntRange(1, 1024), mpm_bench.Settings.threads, "Of our solver.")
@click.option("--peer", type=click.Choice(["taichi"]), help="Measure it beside ours, by turns.")
@_repeats_option
@_json_option
@_chart_option
def mpm(
    *,
    particles: tuple[int, ...],
    threads: tuple[int, ...],
    peer: str | None,
    repeats: int,
    json_file: Path | None,
    chart_file: Path | None,
) -> None:
    """Time the solver on water and sand in 2D and 3D, mid-splash, at the ground truth's substeps."""
    settings = mpm_bench.Settings(particles=particles, threads=threads, repeats=repeats, peer=peer)
    if peer is not None:
        mpm_bench.peer_module(peer)
    source = _source("mpm", particles=particles, threads=threads, repeats=(repeats,), peer=(peer,))
    rows = _measured(mpm_bench.rows(settings, source), len(mpm_bench.CASES) * len(particles) * len(threads))
    _report(rows, _MPM_COLUMNS + (_PEER_COLUMNS if peer else ()), source, json_file)
    if chart_file is not None:
        mpm_bench.chart(rows, chart_file)


@bench.command()
@_many(
    "--particles",
    click.IntRange(512, scaling_bench.MAX_PARTICLES),
    scaling_bench.Settings.particles,
    "Of blocks whose grid grows with them.",
)
@_many(
    "--resolution",
    click.IntRange(32, 256),
    scaling_bench.Settings.resolutions,
    "Cells along the grids around one blob.",
)
@click.option("--threads", type=click.IntRange(1, 1024), default=1, show_default=True)
@_repeats_option
@_json_option
@_chart_option
def scaling(
    *,
    particles: tuple[int, ...],
    resolution: tuple[int, ...],
    threads: int,
    repeats: int,
    json_file: Path | None,
    chart_file: Path | None,
) -> None:
    """Time growing blocks of water, and one blob of water in growing grids."""
    settings = scaling_bench.Settings(
        particles=particles, resolutions=resolution, threads=threads, repeats=repeats
    )
    source = _source(
        "scaling", particles=particles, resolution=resolution, threads=(threads,), repeats=(repeats,)
    )
    rows = _measured(scaling_bench.rows(settings, source), 2 * len(particles) + len(resolution))
    _report(rows, _SCALING_COLUMNS, source, json_file)
    if chart_file is not None:
        scaling_bench.chart(rows, chart_file)


@bench.command()
@click.argument("scenario", default="water_2d", type=click.Choice(scenarios.NAMES))
@click.option("--scenes", type=click.IntRange(1, 1000), default=16, show_default=True)
@click.option("--threads", type=click.IntRange(2, 1024), default=2, show_default=True, help="Against one.")
@click.option(
    "--frames", type=click.IntRange(1, 1000), default=10, show_default=True, help="Timed in one go."
)
@_repeats_option
@_json_option
def batch(
    *, scenario: str, scenes: int, threads: int, frames: int, repeats: int, json_file: Path | None
) -> None:
    """Time many scenes of SCENARIO, in the middle of their splash, on one thread and on several."""
    settings = batch_bench.Settings(
        scenario=scenario, scenes=scenes, threads=threads, frames=frames, repeats=repeats
    )
    source = _source(
        f"batch {scenario}", scenes=(scenes,), threads=(threads,), frames=(frames,), repeats=(repeats,)
    )
    with progress("Measuring", repeats) as bar:
        rows = batch_bench.rows(settings, source, on_progress=bar.update)
    _report(rows, _BATCH_COLUMNS, source, json_file)


@bench.command()
@click.option(
    "--scenario",
    type=click.Choice(scenarios.NAMES),
    multiple=True,
    default=downsampling_bench.Settings.scenarios,
    show_default=True,
    help="May be given several times.",
)
@click.option(
    "--scenes", type=click.IntRange(1, 1000), default=5, show_default=True, help="Of each scenario in 2D."
)
@click.option(
    "--scenes-3d", type=click.IntRange(1, 1000), default=3, show_default=True, help="Of each scenario in 3D."
)
@click.option("--frames", type=click.IntRange(20, 10_000), default=200, show_default=True)
@_repeats_option
@_json_option
@_chart_option
def downsampling(
    *,
    scenario: tuple[str, ...],
    scenes: int,
    scenes_3d: int,
    frames: int,
    repeats: int,
    json_file: Path | None,
    chart_file: Path | None,
) -> None:
    """Hold MPM with fewer particles against the truth, on scenes that no data set contains."""
    settings = downsampling_bench.Settings(
        scenarios=scenario, scenes=scenes, scenes_3d=scenes_3d, frames=frames, repeats=repeats
    )
    options = {"scenes": (scenes,), "scenes-3d": (scenes_3d,), "frames": (frames,), "repeats": (repeats,)}
    source = _source("downsampling", scenario=scenario, **options)
    with progress("Measuring", sum(len(settings.seeds(name)) for name in scenario)) as bar:
        rows = list(downsampling_bench.rows(settings, source, on_progress=bar.update))
    _report(rows, _DOWNSAMPLING_COLUMNS, source, json_file)
    if chart_file is not None:
        downsampling_bench.chart(rows, chart_file)


@bench.command()
@_many(
    "--particles",
    click.IntRange(64, neighbors_bench.MAX_PARTICLES),
    neighbors_bench.Settings.particles,
    "Sizes.",
)
@_many("--threads", click.IntRange(1, 1024), neighbors_bench.Settings.threads, "Of ours.")
@click.option("--peer", type=click.Choice(["scipy"]), help="Measure it beside ours, by turns.")
@click.option(
    "--repeats", type=click.IntRange(1, 1000), default=9, show_default=True, help="The least is reported."
)
@_json_option
@_chart_option
def neighbors(
    *,
    particles: tuple[int, ...],
    threads: tuple[int, ...],
    peer: str | None,
    repeats: int,
    json_file: Path | None,
    chart_file: Path | None,
) -> None:
    """Time the radius graph of clouds in 2D and 3D: fresh, into used memory, and from a Verlet list."""
    settings = neighbors_bench.Settings(particles=particles, threads=threads, repeats=repeats, peer=peer)
    if peer is not None:
        neighbors_bench.peer_module(peer)
    source = _source("neighbors", particles=particles, threads=threads, repeats=(repeats,), peer=(peer,))
    rows = _measured(neighbors_bench.rows(settings, source), 2 * len(particles) * len(threads))
    columns = ("peer", "peer_ms", "ratio") if peer else ()
    _report(rows, _NEIGHBORS_COLUMNS + columns, source, json_file)
    if chart_file is not None:
        neighbors_bench.chart(rows, chart_file)


def _source(command: str, **options: tuple[object, ...]) -> Provenance:
    words = [f"--{name} {value}" for name, values in options.items() for value in values if value is not None]
    return provenance(" ".join(["hybridmpm bench", command, *words]))


def _measured(rows: Iterable[dict[str, Any]], count: int) -> list[dict[str, Any]]:
    done = []
    with progress("Measuring", count) as bar:
        for row in rows:
            done.append(row)
            bar.update(1)
    return done


def _report(
    rows: Sequence[dict[str, Any]], columns: Sequence[str], source: Provenance, json_file: Path | None
) -> None:
    if json_file is not None:
        write_rows(json_file, rows)
    widths = {name: max(len(name), *(len(str(row[name])) for row in rows)) for name in columns}
    click.echo("  ".join(name.rjust(widths[name]) for name in columns))
    for row in rows:
        click.echo("  ".join(str(row[name]).rjust(widths[name]) for name in columns))
    click.echo(f"{source.machine}, {source.date}, commit {source.commit or 'unknown'}")


@bench.command()
@_many("--particles", click.IntRange(500, 100_000), sleeping_bench.Settings.particles, "Of the heaps.")
@click.option("--frames", type=click.IntRange(10, 10_000), default=400, show_default=True)
@_json_option
@_chart_option
def sleeping(
    *, particles: tuple[int, ...], frames: int, json_file: Path | None, chart_file: Path | None
) -> None:
    """Let a grain fall on a heap of sand at rest, with regions that sleep and without."""
    settings = sleeping_bench.Settings(particles=particles, frames=frames)
    source = _source("sleeping", particles=particles, frames=(frames,))
    with progress("Measuring", len(particles) * (frames // settings.stride)) as bar:
        rows = sleeping_bench.rows(settings, source, on_progress=bar.update)
    _report(rows, _SLEEPING_COLUMNS, source, json_file)
    if chart_file is not None:
        sleeping_bench.chart(rows, chart_file)


@bench.command()
@click.option(
    "--level",
    "levels",
    type=click.FloatRange(0.05, 2.0),
    multiple=True,
    help="CFL numbers; 0.2 to 1.2 if absent.",
)
@_json_option
@_chart_option
def stability(*, levels: tuple[float, ...], json_file: Path | None, chart_file: Path | None) -> None:
    """Find the CFL numbers at which each material stops being stable, in splashes and for particles alone."""
    todo = stability_bench.cases(sorted(set(levels)) or stability_bench.LEVELS)
    source = _source("stability", level=levels)
    rows = _measured(stability_bench.rows(todo, source), len(todo))
    if json_file is not None:
        write_rows(json_file, rows)
    if chart_file is not None:
        charts.save(stability_bench.chart(rows), chart_file)
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
            f"{material} {dim}D is stable up to CFL {limit:g}, "
            f"{limit / stability_bench.material(material).default_cfl:.2f} times the default"
        )
