"""`hybridmpm bench` on errors: downsampling, models."""

from pathlib import Path

import click

from hybridmpm import scenarios
from hybridmpm.bench import downsampling as downsampling_bench
from hybridmpm.cli.bench.options import chart_option, json_option, repeats_option, report, source
from hybridmpm.cli.progress import progress

_DOWNSAMPLING_COLUMNS = (
    "scenario", "method", "label", "particles", "resolution", "ms_per_frame", "grid_rmse_mean",
    "grid_rmse_mean_se", "grid_nrmse_mean", "grid_node_error_mean", "kinetic_energy_mean", "centroid_mean",
)  # fmt: skip


@click.command()
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
@repeats_option
@json_option
@chart_option
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
    origin = source("downsampling", scenario=scenario, **options)
    with progress("Measuring", sum(len(settings.seeds(name)) for name in scenario)) as bar:
        rows = list(downsampling_bench.rows(settings, origin, on_progress=bar.update))
    report(rows, _DOWNSAMPLING_COLUMNS, origin, json_file)
    if chart_file is not None:
        downsampling_bench.chart(rows, chart_file)
