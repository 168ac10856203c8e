"""The solver against data that others made and against closed forms; `hybridmpm validate` runs it all.

Each module holds one case: its data with their source, `run` returning curves and error figures as a frozen
dataclass, and a chart.
"""

from hybridmpm.validation import (
    colliding_discs,
    column_collapse,
    dam_break,
    free_fall,
    hydrostatic,
    rotation,
    sliding_block,
    standing_wave,
)
from hybridmpm.validation.case import Case

CASES: dict[str, Case] = {
    module.CASE.name: module.CASE
    for module in (
        dam_break,
        column_collapse,
        hydrostatic,
        standing_wave,
        sliding_block,
        rotation,
        colliding_discs,
        free_fall,
    )
}
"""By name, in the order of the page."""
