"""`python -m hybridmpm_lab crossing`."""

from collections.abc import Callable
from pathlib import Path

import click

from hybridmpm.cli.progress import progress
from hybridmpm.errors import ConfigError
from hybridmpm_lab.commands.options import (
    chart_option,
    json_option,
    number_option,
    only_option,
    pattern_option,
    report,
    runs_option,
    source,
    threads_option,
)
from hybridmpm_lab.compare.crossing import chart as drawing
from hybridmpm_lab.compare.crossing import measure
from hybridmpm_lab.compare.crossing.cases import (
    COMPRESSIONS,
    RESOLUTIONS,
    SCENARIOS,
    Case,
    CrossingSettings,
    cases,
)
from hybridmpm_lab.compare.crossing.table import table
from hybridmpm_lab.harness.provenance import Provenance
from hybridmpm_lab.harness.rows import Progress
from hybridmpm_lab.harness.store import RowStore

_COLUMNS = (
    "scenario", "resolution", "compression", "particles", "method", "label", "variant", "simulated",
    "refused", "ms_per_frame", "error", "error_se", "transport", "as_good", "as_good_ms", "times_slower",
)  # fmt: skip
_EACH = sorted({one for of_dim in RESOLUTIONS.values() for one in of_dim})

_Part = Callable[[Case, CrossingSettings, RowStore, Provenance, Progress], None]


@click.command()
@click.option(
    "--scenario",
    "names",
    type=click.Choice(SCENARIOS),
    multiple=True,
    default=SCENARIOS,
    show_default=True,
    help="Scenario of the scenes. May be given several times.",
)
@click.option(
    "--resolution",
    "resolutions",
    type=click.Choice([str(one) for one in _EACH]),
    multiple=True,
    help="Measure only scenes of this many cells per metre. May be given several times.",
)
@click.option(
    "--compression",
    "compressions",
    type=click.FloatRange(0, 0.5, min_open=True),
    multiple=True,
    default=COMPRESSIONS,
    show_default=True,
    help="Compression of water by its own weight. May be given several times.",
)
@number_option("--scenes", 1, 1000, CrossingSettings.scenes, "Number of held-out scenes of each case.")
@number_option("--span", 40, 10_000, CrossingSettings.span, "Number of frames that errors count over.")
@number_option("--timed", 40, 10_000, CrossingSettings.timed, "Number of frames that are timed.")
@number_option("--passes", 1, 1000, CrossingSettings.passes, "Timings of each frame; lower quartile counts.")
@threads_option("Number of threads of every simulator.")
@pattern_option
@only_option
@runs_option
@json_option
@chart_option
def crossing(
    *,
    names: tuple[str, ...],
    resolutions: tuple[str, ...],
    compressions: tuple[float, ...],
    scenes: int,
    span: int,
    timed: int,
    passes: int,
    threads: int,
    patterns: tuple[str, ...],
    only: str | None,
    runs_file: Path | None,
    json_file: Path | None,
    chart_file: Path | None,
) -> None:
    """Hold networks against the cheapest MPM of equal error, over resolution and stiffness.

    Networks simulate particles as far apart as in their training, at any resolution, and carry all others.
    times_slower is their time over that of the cheapest MPM that errs no more: below one they pay. At other
    resolutions their latency stands beside it with the share of particles that they were trained with.
    """
    wanted = tuple(int(one) for one in resolutions)
    settings = CrossingSettings(
        scenarios=names, resolutions=wanted, compressions=compressions, scenes=scenes, span=span, timed=timed,
        passes=passes, threads=threads, patterns=patterns,
    )  # fmt: skip
    todo = cases(settings)
    if not todo:
        raise ConfigError(f"no scenario of {', '.join(names)} has scenes of these resolutions")
    if only == "table" and runs_file is None:
        raise ConfigError("--only table makes the table of runs that are there: name their file by --runs")
    options = {"scenario": names, "resolution": resolutions, "scenes": (scenes,), "span": (span,)}
    more = {"timed": (timed,), "passes": (passes,), "threads": (threads,), "entrant": patterns}
    origin = source("crossing", **options, **more)
    runs = RowStore(settings.shared(), runs_file)
    parts: dict[str, _Part] = {"errors": measure.measure_errors, "times": measure.measure_times}
    for part, take in parts.items():
        if only in (None, part):
            with progress(part.capitalize(), len(todo)) as bar:
                for case in todo:
                    take(case, settings, runs, origin, bar.update)
    rows = table(settings, runs)
    if not rows:
        raise ConfigError(f"{runs_file} holds no runs of these cases; measure them first")
    report(rows, _COLUMNS, origin, json_file, chart_file=chart_file, draw=drawing.chart)
