"""The solver compared with experiments and closed forms.

Each module is one case. Its docstring is the text of the page; `run` returns the judged figures and the
curves of the chart.
"""

from hybridmpm_lab.validation import (
    colliding_discs,
    column_collapse,
    dam_break,
    free_fall,
    hydrostatic,
    rotation,
    round_columns,
    sliding_block,
    stability_limit,
    standing_wave,
)
from hybridmpm_lab.validation.case import Case

CASES: dict[str, Case] = {
    module.__name__.rpartition(".")[2]: Case(title=title, text=module.__doc__ or "", run=module.run)
    for module, title in (
        (dam_break, "Dam break"),
        (column_collapse, "Granular column collapse"),
        (round_columns, "Round columns of sand"),
        (hydrostatic, "Hydrostatic pressure and compression"),
        (standing_wave, "Standing wave"),
        (sliding_block, "Sliding block"),
        (rotation, "Rigid rotation"),
        (colliding_discs, "Colliding elastic discs"),
        (free_fall, "Free fall"),
        (stability_limit, "Stability limit"),
    )
}
"""Cases by name, in the order of the page."""
