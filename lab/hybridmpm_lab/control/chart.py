"""The chart of control: error against planning time, family by family."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from hybridmpm_lab.control.methods import FILLED, NAMES
from hybridmpm_lab.control.table import ALL, judged_by
from hybridmpm_lab.harness import charts
from hybridmpm_lab.harness.rows import Row

_COLUMNS = 3
_LABELS = {
    "error": "final grid_rmse",
    "path_error": "distance from the path [m]",
    "transport": "transport distance [m]",
}


def chart(rows: Sequence[Row], file: Path) -> None:
    """Draw a panel for each family and kind of sketch, as SVG and PNG; raises as `charts` does.

    Small points are the means of single scenarios, large ones those of all sketches. A dotted line is the
    perfectly filled sketch in the reversed family. The error is that of `judged_by`.
    """
    groups: dict[tuple[str, str], list[Row]] = {}
    for row in rows:
        groups.setdefault((row["family"], row["sketch"]), []).append(row)
    methods = dict.fromkeys(row["method"] for row in rows if row["method"] != FILLED)
    ordered = sorted(methods, key=lambda name: NAMES.index(name) if name in NAMES else len(NAMES))
    columns = min(_COLUMNS, len(groups))
    figure, axes = charts.panels(columns, -(-len(groups) // columns), width=4.2, height=3.3)
    for panel in axes.flat[len(groups) :]:
        panel.set_visible(False)
    for ((family, kind), group), panel in zip(groups.items(), axes.flat, strict=False):
        measure = judged_by(family)
        for index, method in enumerate(ordered):
            _draw(panel, [row for row in group if row["method"] == method], measure, index)
        panel.set(
            xscale="log", title=f"{family}, {kind}s", xlabel="planning time [ms]", ylabel=_LABELS[measure]
        )
        charts.plain_log_ticks(panel.xaxis)
        if measure == "error":
            for row in [row for row in group if row["method"] == FILLED][-1:]:
                panel.axhline(row[measure], color="#333333", linestyle=":", label="sketch perfectly filled")
            panel.set(ylim=(0, 1.05 * panel.get_ylim()[1]))
        else:
            panel.set(yscale="log")
            charts.plain_log_ticks(panel.yaxis)
    _legend(figure, axes)
    charts.save(figure, file)


def _draw(panel: Any, rows: Sequence[Row], measure: str, index: int) -> None:
    """Draw one method; colour and marker follow from its index."""
    points = [row for row in rows if row[measure] is not None and row["plan_ms"] is not None]
    colours, markers = charts.COLOURS, charts.MARKERS
    colour = colours[index % len(colours)]
    marker = markers[(index + index // len(colours)) % len(markers)]
    for row in points:
        look: Row = {"markersize": 4, "alpha": 0.45}
        if row["scenario"] == ALL or len(points) == 1:
            look = {"markersize": 9, "zorder": 3, "label": row["method"]}
        at = [row["plan_ms"]], [row[measure]], [row[f"{measure}_se"] or 0.0]
        panel.errorbar(*at, color=colour, marker=marker, linestyle="", **look)


def _legend(figure: Any, axes: Any) -> None:
    """Add one legend of the entries of all panels above them."""
    entries = {
        label: handle
        for panel in axes.flat
        for handle, label in zip(*panel.get_legend_handles_labels(), strict=True)
    }
    columns = min(3, axes.shape[1])
    figure.legend(entries.values(), entries.keys(), loc="outside upper center", ncols=columns, fontsize=8)
