"""`python -m hybridmpm_lab` on speed: speed and batch."""

from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import click

from hybridmpm_lab.commands.options import chart_option, json_option, measured, report
from hybridmpm_lab.harness.settings import origin_of, settings_options
from hybridmpm_lab.speed import batch as batch_speed
from hybridmpm_lab.speed import chart, solver
from hybridmpm_lab.speed.baselines import require_installed

_SOLVER_COLUMNS = (
    "dim", "material", "frame", "particles", "resolution", "threads", "instructions", "substeps",
    "ns_per_particle_substep", "spread", "ms_per_frame", "slowdown", "loaded", "peer", "peer_way", "peer_ns",
    "ratio",
)  # fmt: skip
_BATCH_COLUMNS = (
    "scenario", "scenes", "particles", "threads", "ms_per_scene_frame", "frames_per_second", "speedup",
)  # fmt: skip


def _command(
    name: str,
    settings: type[Any],
    measure: Callable[..., Any],
    columns: tuple[str, ...],
    draw: Callable[..., Any] | None,
    *,
    summary: str,
) -> click.Command:
    """Return a command that times what its settings say, prints columns of the rows, and draws them."""

    @settings_options(settings)
    @json_option
    def run(settings: Any, json_file: Path | None, chart_file: Path | None = None) -> None:
        for package in getattr(settings, "baseline", ()):
            require_installed(package)
        origin = origin_of(name, settings)
        rows = measured(partial(measure, settings), settings.steps, origin)
        shown = [column for column in columns if rows[0].get(column) is not None]
        report(rows, shown, origin, json_file, chart_file=chart_file, draw=draw)

    run.__doc__ = summary
    return click.command(name)(run if draw is None else chart_option(run))


speed = _command(
    "speed",
    solver.SolverSettings,
    solver.measure,
    _SOLVER_COLUMNS,
    chart.draw,
    summary="""Time the solver on splashing blocks.

    The blocks are of water and sand, in 2D and 3D; the solver takes the ground truth's substeps. All that is
    timed takes turns, in pieces of up to 20 frames, whose lower quartile counts. A row is marked as loaded
    where the machine was busy before or after.
    """,
)
batch = _command(
    "batch",
    batch_speed.BatchSettings,
    batch_speed.measure,
    _BATCH_COLUMNS,
    None,
    summary="""Time many scenes on one thread and on several, in the middle of their splash.""",
)
