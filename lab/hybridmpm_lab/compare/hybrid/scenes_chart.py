"""The rows of `python -m hybridmpm_lab hybrid` as a chart."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from hybridmpm._support import charts
from hybridmpm_lab.compare.hybrid.scene_means import FREE_FALL, HYBRID
from hybridmpm_lab.harness.rows import Row

_SHARES = {"network": "network", "free_fall": "free fall", "rest": "rest", "mpm": "MPM"}
_ERRORS = {
    HYBRID: "hybrid",
    FREE_FALL: "free fall in the network's place",
    "mpm-other-jitter": "MPM, other jitter",
}


def chart(rows: Sequence[Row], file: Path) -> None:
    """Draw who simulated which share of the frames, and the errors of all scenes over MPM's, by scenario.

    The chart is written as SVG and PNG. It is about runs in which all particles are carried along.
    """
    mine = [row for row in rows if row.get("show_all")]
    means = [row for row in mine if row["part"] == "mean" and row["method"] == HYBRID]
    names = [row["scenario"] for row in means]
    figure, axes = charts.panels(2, 1, width=5.6, height=4.0)
    _shares(axes[0, 0], means)
    _errors(axes[0, 1], mine, names)
    for panel in axes.flat:
        panel.set_yticks(range(len(names)), names)
        panel.invert_yaxis()
        panel.grid(visible=False, axis="y")
    axes[0, 1].set_yticklabels([])
    charts.save(figure, file)


def _shares(panel: Any, means: Sequence[Row]) -> None:
    begins = [0.0] * len(means)
    colours = (charts.COLOURS[0], charts.COLOURS[2], charts.COLOURS[4], "0.85")
    for (name, label), colour in zip(_SHARES.items(), colours, strict=True):
        widths = [100 * row[name] for row in means]
        panel.barh(range(len(means)), widths, left=begins, color=colour, label=label, height=0.7)
        begins = [one + two for one, two in zip(begins, widths, strict=True)]
    panel.set(xlabel="share of the frames [%]", xlim=(0, 100), title="who simulates")
    panel.legend(loc="upper center", bbox_to_anchor=(0.5, -0.16), ncols=4, frameon=False)


def _errors(panel: Any, mine: Sequence[Row], names: Sequence[str]) -> None:
    runs = {(row["scenario"], row["seed"], row["method"]): row for row in mine if row["part"] == "run"}
    for place, (method, label) in enumerate(_ERRORS.items()):
        points = [
            (row["error"] / base["error"], names.index(row["scenario"]) + 0.22 * (place - 1))
            for row in runs.values()
            if row["method"] == method
            and row["error"] is not None
            and (base := runs.get((row["scenario"], row["seed"], "mpm"))) is not None
            and base["error"] is not None
        ]
        if points:
            across, down = zip(*points, strict=True)
            look = {"color": charts.COLOURS[(0, 1, 5)[place]], "markersize": 4, "alpha": 0.6}
            panel.plot(across, down, charts.MARKERS[place], label=label, **look)
    panel.axvline(1.0, color="0.4", linewidth=0.8)
    panel.axvline(1.1, color="0.4", linewidth=0.8, linestyle=":")
    panel.set(xlabel="error over MPM's, each scene a point", title="at what error (dotted: 1.1)")
    panel.legend(loc="upper center", bbox_to_anchor=(0.5, -0.16), ncols=2, frameon=False)
