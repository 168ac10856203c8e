"""`hybridmpm bench` on errors: downsampling, models."""

from functools import partial
from pathlib import Path

import click

from hybridmpm.errors import ConfigError
from hybridmpm.physics.manifest import models as shipped_models
from hybridmpm.physics.model import NeuralModel
from hybridmpm_lab.commands.options import (
    chart_option,
    json_option,
    measured,
    number_option,
    report,
    scenario_option,
    source,
    threads_option,
)
from hybridmpm_lab.compare import coarse as downsampling_bench
from hybridmpm_lab.compare.accuracy import models as models_bench
from hybridmpm_lab.compare.accuracy.comparison import ComparisonSettings
from hybridmpm_lab.compare.accuracy.conventions import AT
from hybridmpm_lab.harness import pareto_chart

_DOWNSAMPLING_COLUMNS = (
    "scenario", "method", "label", "particles", "resolution", "ms_per_frame", "ms_shown", "error", "error_se",
    "grid_nrmse", "grid_node_error", "minus_carried", "minus_carried_se", "transport", "transport_minus_mpm",
    "transport_minus_mpm_se", "kinetic_energy", "centroid", "density", "dominated_by",
)  # fmt: skip

_MODELS_COLUMNS = (
    "scenario", "method", "label", "warm_up", "start", "ms_per_frame", "ms_p95", "error", "error_se",
    *(f"error_{frame}" for frame in AT), "below_zero_40", "below_zero_100", "as_good", "dominated_by",
)  # fmt: skip


@click.command()
@scenario_option("Scenario of the scenes.", default=downsampling_bench.DownsamplingSettings.scenarios)
@number_option("--scenes", 1, 1000, 10, "Number of scenes of each scenario.")
@number_option("--frames", 20, 10_000, 200, "Number of frames of each scene after its first impact.")
@number_option("--repeats", 1, 1000, 9, "Number of timings, whose lower quartile counts.")
@json_option
@chart_option
def coarse(
    *,
    names: tuple[str, ...],
    scenes: int,
    frames: int,
    repeats: int,
    json_file: Path | None,
    chart_file: Path | None,
) -> None:
    """Measure time and error of MPM with fewer particles: alone, carrying all of the scene, and fitted.

    Errors are taken against the truth, in scenes that no data set and no fit contains. The table also holds
    the floors of the error (jitter: the truth with other jitter; merged: the truth shown by as few particles)
    and its ceiling (still: the state of the first impact held). ms_shown is the time of a frame whose
    positions are read, ms_per_frame that of others.
    """
    settings = downsampling_bench.DownsamplingSettings(
        scenarios=names, scenes=scenes, frames=frames, repeats=repeats
    )
    options = {"scenes": (scenes,), "frames": (frames,), "repeats": (repeats,)}
    origin = source("coarse", scenario=names, **options)
    rows = measured(partial(downsampling_bench.measure, settings), settings.count, origin)
    report(
        rows, _DOWNSAMPLING_COLUMNS, origin, json_file, chart_file=chart_file, draw=downsampling_bench.chart
    )


@click.command()
@click.option(
    "--model",
    "model_names",
    multiple=True,
    metavar="NAME",
    help="Name of a model, or its ONNX file. May be given several times. If absent, the library's models.",
)
@scenario_option("Scenario of the scenes; if absent, all that the models serve.")
@number_option("--scenes", 2, 1000, 10, "Number of scenes of each scenario.")
@number_option("--span", 40, 10_000, 200, "Number of frames of each scene that errors count over.")
@threads_option("Number of threads of every simulator.")
@json_option
@chart_option
def models(
    *,
    model_names: tuple[str, ...],
    names: tuple[str, ...],
    scenes: int,
    span: int,
    threads: int,
    json_file: Path | None,
    chart_file: Path | None,
) -> None:
    """Measure time and error of learned simulators.

    Beside them run MPM and free fall. Errors count from the first impact on, in scenes that no data set
    contains. as_good is the cheapest MPM whose error is not above the method's: a method pays only where it
    is faster than that. dominated_by is the cheapest method that is neither slower nor worse.
    """
    model_names = model_names or tuple(shipped_models())
    candidates = [_candidate(name, names, threads) for name in model_names]
    twins = [one.label for one in candidates if sum(one.label == two.label for two in candidates) > 1]
    if twins:
        raise ConfigError(f"two models are called {twins[0]}; give each once, and rename files of one name")
    served = models_bench.served(candidates)
    if not served or (unserved := [name for name in names if name not in served]):
        missing = ", ".join(unserved if served else names) or "any scenario"
        raise ConfigError(f"no model serves {missing}; the models are {', '.join(model_names) or 'none yet'}")
    settings = ComparisonSettings(scenes=scenes, span=span, threads=threads)
    options = {"model": model_names, "scenario": names, "scenes": (scenes,), "span": (span,)}
    origin = source("models", **options, threads=(threads,))
    measure = partial(models_bench.measure, candidates, settings)
    rows = measured(measure, scenes * len(served), origin)
    report(rows, _MODELS_COLUMNS, origin, json_file, chart_file=chart_file, draw=pareto_chart.chart)


def _candidate(name: str, only: tuple[str, ...], threads: int) -> models_bench.Candidate:
    model = NeuralModel.load(name, threads=threads)
    return models_bench.Candidate(
        label=Path(name).stem,
        stepper=model,
        scenarios=tuple(one for one in model.spec.scenarios if not only or one in only),
        parameters=model.info.parameters,
        spec=model.spec,
    )
