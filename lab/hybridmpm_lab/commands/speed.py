"""`python -m hybridmpm_lab` on speed: speed and batch."""

from collections.abc import Callable, Iterator
from functools import partial
from typing import Any

from hybridmpm_lab.commands.options import Measurement, measured
from hybridmpm_lab.harness.provenance import Provenance
from hybridmpm_lab.harness.rows import Row
from hybridmpm_lab.speed import batch as batch_speed
from hybridmpm_lab.speed import chart, solver
from hybridmpm_lab.speed.baselines import require_installed


def _timed(measure: Callable[..., Iterator[Row]], settings: Any, origin: Provenance) -> list[Row]:
    for package in getattr(settings, "baseline", ()):
        require_installed(package)
    return measured(partial(measure, settings), settings.steps, origin)


speed = Measurement(
    name="speed",
    settings=solver.SolverSettings,
    measure=partial(_timed, solver.measure),
    columns=(
        "dim", "material", "frame", "particles", "resolution", "threads", "instructions", "substeps",
        "ns_per_particle_substep", "spread", "ms_per_frame", "slowdown", "loaded", "peer", "peer_way",
        "peer_ns", "ratio",
    ),
    draw=chart.draw,
    summary="""Time the solver on splashing blocks.

    The blocks are of water and sand, in 2D and 3D; the solver takes the ground truth's substeps. All that is
    timed takes turns, in pieces of up to 20 frames, whose lower quartile counts. A row is marked as loaded
    where the machine was busy before or after.
    """,
).command()  # fmt: skip
batch = Measurement(
    name="batch",
    settings=batch_speed.BatchSettings,
    measure=partial(_timed, batch_speed.measure),
    columns=(
        "scenario", "scenes", "particles", "threads", "ms_per_scene_frame", "frames_per_second", "speedup",
    ),
    summary="""Time many scenes on one thread and on several, in the middle of their splash.""",
).command()  # fmt: skip
