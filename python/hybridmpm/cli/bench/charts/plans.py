"""`hybridmpm bench` on plans: calibrate, plans."""

import datetime as dt
from pathlib import Path

import click

from hybridmpm import scenarios
from hybridmpm._support.files import replacing
from hybridmpm.bench.calibrate import measure
from hybridmpm.bench.calibrate.errors import calibration_of, read_rows
from hybridmpm.bench.calibrate.judge import JudgeSettings, judge
from hybridmpm.bench.report.gathered import Gathered
from hybridmpm.cli.bench.options import (
    json_option,
    number_option,
    print_origin,
    print_table,
    runs_option,
    save,
    scenario_option,
    source,
)
from hybridmpm.cli.progress import progress
from hybridmpm.errors import ExportError
from hybridmpm.planner.store import user_file

_COLUMNS = ("scenario", "runs", "within_30_percent", "off_p50", "off_p95", "pairs", "pairs_right")


_SIZE = 4000
"""Particles of the frames whose times `calibrate` prints."""


@click.command()
@click.option(
    "--out",
    "out_file",
    type=click.Path(dir_okay=False, path_type=Path),
    metavar="FILE",
    help="File for the times. Default: the user's own, where plans look for them.",
)
@click.option(
    "--errors",
    "errors_file",
    type=click.Path(exists=True, dir_okay=False, path_type=Path),
    metavar="FILE",
    help="Rows of `hybridmpm bench tradeoff --json`: write a whole calibration, as it comes with the "
    "library, with these errors beside the times. Needs --out.",
)
def calibrate(*, out_file: Path | None, errors_file: Path | None) -> None:
    """Measure what this machine takes for each kind of work, in under a minute.

    Plans (`hybridmpm plan`, `hybridmpm.plan`) then tell the times of this machine. Let nothing else run
    meanwhile.
    """
    if errors_file is not None and out_file is None:
        raise click.UsageError("--errors needs --out: the user's own file holds times alone.")
    rows = None if errors_file is None else read_rows(errors_file)
    file = user_file() if out_file is None else out_file
    _make_folder(file)
    with progress("Calibrating", measure.COUNT) as bar:
        times = measure.measure(dt.datetime.now(dt.UTC).date().isoformat(), bar.update)
    text = (times if rows is None else calibration_of(rows, times)).model_dump_json(indent=1)
    with replacing(file) as part:
        part.write_text(f"{text}\n", encoding="utf-8")
    for one in times.materials:
        each = one.substep + one.particle_substep * _SIZE + one.cell_substep * _SIZE / 2**one.dim
        ms = (10 * each + one.frame + one.particle * _SIZE) / 1e3
        click.echo(f"{one.material} in {one.dim}D: {ms:.2f} ms for {_SIZE} particles and 10 substeps")
    click.echo(f"written to {file}")


def _make_folder(file: Path) -> None:
    try:
        file.parent.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise ExportError(f"cannot write {file}: {error.strerror or error}") from error


@click.command()
@scenario_option("Scenario of the scenes.", default=scenarios.NAMES)
@number_option("--scenes", 1, 1000, JudgeSettings.scenes, "Number of held-out scenes of each scenario.")
@number_option("--span", 40, 10_000, JudgeSettings.span, "Number of frames that count, and are timed.")
@number_option("--passes", 1, 1000, JudgeSettings.passes, "Timings of each frame; lower quartile counts.")
@runs_option
@json_option
def plans(
    *,
    names: tuple[str, ...],
    scenes: int,
    span: int,
    passes: int,
    runs_file: Path | None,
    json_file: Path | None,
) -> None:
    """Hold what plans expect of each rung against what is measured.

    within_30_percent is the share of the rungs whose time was told so well, pairs_right the share of the
    pairs of rungs of a scene of which it was told which errs less. Scenes are others than those that the
    errors of the calibration come from. Wants an idle machine.
    """
    settings = JudgeSettings(scenarios=names, scenes=scenes, span=span, passes=passes)
    origin = source("plans", scenario=names, scenes=(scenes,), span=(span,), passes=(passes,))
    runs = Gathered({"span": span, "passes": passes}, runs_file)
    with progress("Measuring", scenes * len(names)) as bar:
        rows = list(judge(settings, runs, origin, bar.update))
    save(rows, json_file)
    print_table([row for row in rows if row["part"] == "mean"], _COLUMNS)
    print_origin(origin)
