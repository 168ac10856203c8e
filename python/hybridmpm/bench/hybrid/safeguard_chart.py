"""The rows of the safeguard as a chart."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from hybridmpm._support import charts
from hybridmpm.bench.hybrid.guard_values import PLAIN
from hybridmpm.bench.hybrid.safeguard import GUARD
from hybridmpm.bench.report.rows import Row

_COLUMNS = 4
_SILENT = ("non-finite", "outside")
"""Guards whose value is 0 unless there is a fault."""
_RANKS = {
    "spearman": "Spearman's correlation with the error",
    "spearman_without_time": "the same apart from time",
}
"""Fields of the correlation, with their names in the chart."""


def chart(rows: Sequence[Row], file: Path) -> None:
    """Draw cosine against error, one panel a scenario, and in the last the correlation of every guard.

    The chart is written as SVG and PNG.
    """
    names = list(dict.fromkeys(row["scenario"] for row in rows if row["part"] == "point"))
    lines = -(-(len(names) + 1) // _COLUMNS)
    figure, axes = charts.panels(_COLUMNS, lines, width=3.1, height=2.9)
    for panel, name in zip(axes.flat, names, strict=False):
        _scatter(panel, name, rows)
    _ranks(axes.flat[len(names)], names, rows)
    for spare in axes.flat[len(names) + 1 :]:
        spare.set_visible(False)
    points, ranks = (panel.get_legend_handles_labels() for panel in (axes.flat[0], axes.flat[len(names)]))
    handles, labels = points[0] + ranks[0], points[1] + ranks[1]
    figure.legend(handles, labels, loc="outside lower center", ncols=len(labels))
    charts.save(figure, file)


def _scatter(panel: Any, name: str, rows: Sequence[Row]) -> None:
    points = [row for row in rows if row["part"] == "point" and row["scenario"] == name]
    ranks = {
        row["guard"]: row["spearman"]
        for row in rows
        if row["part"] == "correlation" and row["scenario"] == name
    }
    for index, guard in enumerate(("cosine", PLAIN)):
        known = [row for row in points if GUARD + guard in row]
        panel.plot(
            [row[GUARD + guard] for row in known],
            [row["error"] for row in known],
            charts.MARKERS[index],
            color=charts.COLOURS[index],
            markersize=3.5,
            alpha=0.6,
            label=guard,
        )
    told = ", ".join("-" if ranks.get(g) is None else f"{ranks[g]:.2f}" for g in ("cosine", PLAIN))
    panel.set(title=f"{name}\nSpearman {told}", xlabel="mean cosine", xlim=(-0.5, 1.05), ylim=(0, None))
    panel.set_ylabel("error (grid RMSE)")


def _ranks(panel: Any, names: Sequence[str], rows: Sequence[Row]) -> None:
    mine = [row for row in rows if row["part"] == "correlation" and row["scenario"] in names]
    guards = [guard for guard in dict.fromkeys(row["guard"] for row in mine) if guard not in _SILENT]
    for place, guard in enumerate(guards):
        for (field, label), shift, colour in zip(
            _RANKS.items(), (0.18, -0.18), charts.COLOURS[2:4], strict=True
        ):
            values = [row[field] for row in mine if row["guard"] == guard and row[field] is not None]
            if values:
                panel.plot(values, [place + shift] * len(values), "|", color=colour)
                told = label if place == len(guards) - 1 else None
                panel.plot(np.median(values), place + shift, "D", color=colour, markersize=5, label=told)
    panel.axvline(0, color="0.6", linewidth=0.8)
    panel.set_yticks(range(len(guards)), guards)
    panel.set(
        title="correlation in each scenario,\nand the median",
        xlabel="rank correlation",
        xlim=(-1, 1),
    )
