"""The solver compared with experiments and closed forms.

Each module is one case, whose `run` returns the judged figures and the curves of the chart. The page in
docs/results/validation explains the cases.
"""

from collections.abc import Callable

from hybridmpm_lab.validation import (
    cantilever,
    colliding_discs,
    column_collapse,
    dam_break,
    drum,
    floating,
    free_fall,
    hanging,
    hopper,
    hydrostatic,
    poured_heap,
    rebound,
    rigid_bodies,
    rolling,
    rotation,
    round_columns,
    sliding_block,
    stability_limit,
    standing_wave,
    torricelli,
    viscous_flow,
)
from hybridmpm_lab.validation.case import Result

CASES: dict[str, Callable[[], Result]] = {
    "dam_break": dam_break.run,
    "column_collapse": column_collapse.run,
    "round_columns": round_columns.run,
    "poured_heap": poured_heap.run,
    "drum": drum.run,
    "rebound": rebound.run,
    "hydrostatic": hydrostatic.run,
    "floating": floating.run,
    "torricelli": torricelli.run,
    "hopper": hopper.run,
    "standing_wave": standing_wave.run,
    "sliding_block": sliding_block.run,
    "hanging": hanging.run,
    "cantilever": cantilever.run,
    "rolling": rolling.run,
    "rotation": rotation.run,
    "colliding_discs": colliding_discs.run,
    "free_fall": free_fall.run,
    "rigid_bodies": rigid_bodies.run,
    "viscous_flow": viscous_flow.run,
    "stability_limit": stability_limit.run,
}
"""Cases at full length by name, in the order of the page."""
