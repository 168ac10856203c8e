"""The chart of `bench downsampling`: the front of error and time, and error and transport of each r_p."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from hybridmpm._support import charts
from hybridmpm_lab.harness.rows import Row

_METHODS = (
    ("mpm", "the few alone"),
    ("carried", "carrying all particles"),
    ("fitted", "carrying, fitted"),
)
_BOUNDS = (("still", "held still", ":"), ("jitter", "truth, other jitter", "--"))


def chart(rows: Sequence[Row], file: Path) -> None:
    """Draw error against time, and error and transport against r_p, as SVG and PNG.

    Raises as `charts` does.
    """
    names = list(dict.fromkeys(row["scenario"] for row in rows))
    figure, axes = charts.panels(columns=len(names), rows=3, width=3.6, height=2.9)
    for column, name in enumerate(names):
        mine = [row for row in rows if row["scenario"] == name]
        front, error, transport = axes[:, column]
        for index, (method, label) in enumerate(_METHODS):
            points = [row for row in mine if row["method"] == method]
            style = {"marker": charts.MARKERS[index], "color": charts.COLOURS[index], "label": label}
            _draw(front, points, "ms_shown", "error", style)
            _draw(error, points, "r_p", "error", style)
            _draw(transport, points, "r_p", "transport", style)
        merged = [row for row in mine if row["method"] == "merged"]
        style = {"marker": charts.MARKERS[3], "color": charts.COLOURS[3], "label": "truth, merged"}
        _draw(error, merged, "r_p", "error", style)
        _draw(transport, merged, "r_p", "transport", style)
        bounds = {row["method"]: row for row in mine if row["r_p"] is None}
        for method, label, dashes in _BOUNDS:
            if method in bounds:
                for panel in (front, error):
                    height = bounds[method]["error"]
                    panel.axhline(height, label=label, linestyle=dashes, color=charts.COLOURS[5])
        front.set(title=name, xscale="log", ylim=(0, None), xlabel="ms per frame, each looked at")
        error.set(xscale="log", ylim=(0, None))
        transport.set(xscale="log", yscale="log", xlabel="$r_p$")
        labels = {row["r_p"]: row["label"] for row in mine if row["method"] == "mpm"}
        for panel in (error, transport):
            panel.set(xticks=list(labels), xticklabels=list(labels.values()))
            panel.minorticks_off()
        if column == 0:
            front.set(ylabel="error (grid_rmse)")
            error.set(ylabel="error (grid_rmse)")
            transport.set(ylabel="transport [m]")
    entries = {1: 2, 2: 3}.get(len(names), 5)
    figure.legend(*axes[1, 0].get_legend_handles_labels(), loc="outside upper center", ncols=entries)
    charts.save(figure, file)


def _draw(panel: Any, points: Sequence[Row], x: str, y: str, style: Mapping[str, Any]) -> None:
    """Draw one line of a panel, with the standard errors of its points."""
    at, means = [row[x] for row in points], [row[y] for row in points]
    panel.errorbar(at, means, [row[f"{y}_se"] or 0.0 for row in points], capsize=2, **style)
