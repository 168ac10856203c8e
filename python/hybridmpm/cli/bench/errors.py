"""`hybridmpm bench` on errors: downsampling, models."""

from pathlib import Path

import click

from hybridmpm import scenarios
from hybridmpm.bench.accuracy import downsampling as downsampling_bench
from hybridmpm.bench.accuracy import models as models_bench
from hybridmpm.bench.accuracy.comparison import Settings
from hybridmpm.bench.accuracy.rollouts import AT
from hybridmpm.bench.report import front_chart
from hybridmpm.cli.bench.options import chart_option, json_option, repeats_option, report, source
from hybridmpm.cli.progress import progress
from hybridmpm.errors import ConfigError
from hybridmpm.physics.manifest import models as shipped_models
from hybridmpm.physics.model import NeuralModel

_DOWNSAMPLING_COLUMNS = (
    "scenario", "method", "label", "particles", "resolution", "ms_per_frame", "grid_rmse_mean",
    "grid_rmse_mean_se", "grid_nrmse_mean", "grid_node_error_mean", "kinetic_energy_mean", "centroid_mean",
)  # fmt: skip

_MODELS_COLUMNS = (
    "scenario", "method", "label", "warm_up", "start", "ms_per_frame", "ms_p95", "error", "error_se",
    *(f"error_{frame}" for frame in AT), "below_zero_40", "below_zero_100", "as_good", "dominated_by",
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


@click.command()
@click.option(
    "--model",
    "names",
    multiple=True,
    metavar="NAME",
    help="A model's name or an ONNX file; may be given several times. Those of the library if absent.",
)
@click.option(
    "--scenario",
    type=click.Choice(scenarios.NAMES),
    multiple=True,
    help="May be given several times. All that the models serve if absent.",
)
@click.option(
    "--scenes", type=click.IntRange(2, 1000), default=10, show_default=True, help="Of each scenario."
)
@click.option(
    "--span", type=click.IntRange(40, 10_000), default=200, show_default=True, help="Frames counted."
)
@click.option("--threads", type=click.IntRange(1, 1024), default=1, show_default=True)
@json_option
@chart_option
def models(
    *,
    names: tuple[str, ...],
    scenario: tuple[str, ...],
    scenes: int,
    span: int,
    threads: int,
    json_file: Path | None,
    chart_file: Path | None,
) -> None:
    """Hold learned simulators against the truth, beside free fall, the floors and MPM with fewer particles.

    Errors are those of scenes that no data set contains, from their first impact on. `as_good` is the
    cheapest MPM whose error is not above a method's: to pay, the method would have to be faster.
    """
    names = names or tuple(shipped_models())
    candidates = [_candidate(name, scenario, threads) for name in names]
    twins = [one.label for one in candidates if sum(one.label == two.label for two in candidates) > 1]
    if twins:
        raise ConfigError(f"two models are called {twins[0]}; give each once, and rename files of one name")
    served = models_bench.served(candidates)
    if not served or (unserved := [name for name in scenario if name not in served]):
        missing = ", ".join(unserved if served else scenario) or "any scenario"
        raise ConfigError(f"no model serves {missing}; the models are {', '.join(names) or 'none yet'}")
    settings = Settings(scenes=scenes, span=span, threads=threads)
    options = {"model": names, "scenario": scenario, "scenes": (scenes,), "span": (span,)}
    origin = source("models", **options, threads=(threads,))
    with progress("Measuring", scenes * len(served)) as bar:
        rows = list(models_bench.rows(candidates, settings, origin, on_progress=bar.update))
    report(rows, _MODELS_COLUMNS, origin, json_file)
    if chart_file is not None:
        front_chart.chart(rows, chart_file)


def _candidate(name: str, only: tuple[str, ...], threads: int) -> models_bench.Candidate:
    model = NeuralModel.load(name, threads=threads)
    return models_bench.Candidate(
        label=Path(name).stem,
        stepper=model,
        scenarios=tuple(one for one in model.spec.scenarios if not only or one in only),
        parameters=model.info.parameters,
        spec=model.spec,
    )
