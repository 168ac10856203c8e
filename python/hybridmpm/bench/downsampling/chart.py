"""The chart of `bench downsampling`: the front of error and time, and transport."""

from collections.abc import Sequence
from pathlib import Path

from hybridmpm._support import charts
from hybridmpm.bench.report.rows import Row

_METHODS = (
    ("mpm", "the few alone"),
    ("carried", "carrying all particles"),
    ("fitted", "carrying, fitted"),
)
_BOUNDS = (("still", "held still", ":"), ("jitter", "truth, other jitter", "--"))


def chart(rows: Sequence[Row], file: Path) -> None:
    """Draw error against time and transport against r_p, as SVG and PNG; raises as `charts` does."""
    names = list(dict.fromkeys(row["scenario"] for row in rows))
    figure, axes = charts.panels(columns=len(names), rows=2, width=3.6, height=3.2)
    for column, name in enumerate(names):
        mine = [row for row in rows if row["scenario"] == name]
        front, transport = axes[:, column]
        for index, (method, label) in enumerate(_METHODS):
            points = [row for row in mine if row["method"] == method]
            style = {"marker": charts.MARKERS[index], "color": charts.COLOURS[index], "capsize": 2}
            for panel, x, y in ((front, "ms_shown", "error"), (transport, "r_p", "transport")):
                at, means = [row[x] for row in points], [row[y] for row in points]
                panel.errorbar(at, means, [row[f"{y}_se"] or 0.0 for row in points], label=label, **style)
        bounds = {row["method"]: row for row in mine if row["r_p"] is None}
        for method, label, dashes in _BOUNDS:
            if method in bounds:
                height = bounds[method]["error"]
                front.axhline(height, label=label, linestyle=dashes, color=charts.COLOURS[5])
        front.set(title=name, xscale="log", ylim=(0, None), xlabel="ms per frame, each looked at")
        transport.set(xscale="log", yscale="log", xlabel="$r_p$")
        labels = {row["r_p"]: row["label"] for row in mine if row["method"] == "mpm"}
        transport.set(xticks=list(labels), xticklabels=list(labels.values()))
        transport.minorticks_off()
        if column == 0:
            front.set(ylabel="error (grid_rmse)")
            transport.set(ylabel="transport [m]")
    entries = {1: 2, 2: 3}.get(len(names), 5)
    figure.legend(*axes[0, 0].get_legend_handles_labels(), loc="outside upper center", ncols=entries)
    charts.save(figure, file)
