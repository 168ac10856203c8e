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
    handles, labels = axes.flat[0].get_legend_handles_labels()
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
    found = {
        (row["guard"], row["scenario"]): row["spearman"]
        for row in rows
        if row["part"] == "correlation" and row["spearman"] is not None
    }
    guards = [guard for guard in dict.fromkeys(g for g, _ in found) if guard not in _SILENT]
    for place, guard in enumerate(guards):
        values = [found[guard, name] for name in names if (guard, name) in found]
        panel.plot(values, [place] * len(values), "|", color=charts.COLOURS[0], markersize=10)
        panel.plot(np.median(values), place, "o", color=charts.COLOURS[1], markersize=5)
    panel.axvline(0, color="0.6", linewidth=0.8)
    panel.set_yticks(range(len(guards)), guards)
    panel.set(
        title="all scenarios, and their median", xlabel="Spearman correlation with the error", xlim=(-1, 1)
    )
