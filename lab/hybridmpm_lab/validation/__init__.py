"""The solver compared with experiments and closed forms.

Each module has one case: its data with their source, `run`, which returns curves and error figures as a
frozen dataclass, and `draw`, which draws them.
"""

from hybridmpm_lab.validation import (
    colliding_discs,
    dam_break,
    free_fall,
    hydrostatic,
    rotation,
    sliding_block,
    standing_wave,
)
from hybridmpm_lab.validation.case import Case
from hybridmpm_lab.validation.granular import column_collapse, round_columns

CASES: dict[str, Case] = {
    module.CASE.name: module.CASE
    for module in (
        dam_break,
        column_collapse,
        round_columns,
        hydrostatic,
        standing_wave,
        sliding_block,
        rotation,
        colliding_discs,
        free_fall,
    )
}
"""Cases by name, in the order of the page."""
