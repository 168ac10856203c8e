"""The stability map as a picture: a panel for each method, a line for each stress, a cell for each level."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from hybridmpm_lab.harness import charts
from hybridmpm_lab.harness.rows import Row
from hybridmpm_lab.stability.outcome import Outcome

COLOURS: dict[Outcome, str] = {
    "survived": "#dbe9f1", "refused": "#9aa5ad", "degraded": "#e3a857", "failed": "#7f1d1d"
}  # fmt: skip
"""Colours of the outcomes; a grey print keeps their order, apart from what is refused, which has a sign."""
SIGNS: dict[Outcome, str] = {"survived": ".", "refused": "x", "degraded": "d", "failed": "F"}
TITLES = {"mpm": "MPM", "coarse": "coarse 1/16, all shown", "neural": "network", "hybrid": "hybrid"}
"""Names of methods in charts and tables."""


def draw(rows: Sequence[Row], file: Path) -> None:
    """Draw the map; a dot in a cell is a signal to the user."""
    stresses = list(dict.fromkeys(row["stress"] for row in rows))
    settings = list(dict.fromkeys((row["material"], row["dim"]) for row in rows))
    methods = [method for method in TITLES if any(row["method"] == method for row in rows)]
    figure, (axes,) = charts.panels(len(methods), width=3.0, height=1.2 + 0.3 * len(stresses))
    for axis, method in zip(axes, methods, strict=True):
        placed: dict[tuple[str, str, int], int] = {}
        for row in (row for row in rows if row["method"] == method):
            key = row["stress"], row["material"], row["dim"]
            placed[key] = step = placed.get(key, 0) + 1
            place, line = 3.4 * settings.index(key[1:]) + step, stresses.index(row["stress"])
            ink = "white" if row["outcome"] == "failed" else "black"
            axis.bar(place, 0.86, 0.92, bottom=line - 0.43, color=COLOURS[row["outcome"]])
            if row["outcome"] != "survived":
                axis.text(place, line, SIGNS[row["outcome"]], ha="center", va="center", fontsize=7, color=ink)
            if row["signalled"]:
                axis.plot(place + 0.3, line - 0.27, ".", markersize=3, color=ink)
        labels = [f"{material}\n{dim}D" for material, dim in settings]
        axis.set_xticks([3.4 * column + 2 for column in range(len(settings))], labels, fontsize=8)
        axis.set_yticks(range(len(stresses)), stresses if axis is axes[0] else [])
        axis.set_ylim(len(stresses) - 0.5, -0.5)
        axis.set_title(TITLES[method], fontsize=9)
        axis.grid(visible=False)
        axis.tick_params(length=0)
    figure.legend(handles=_keys(), loc="outside lower center", ncols=len(COLOURS) + 1)
    charts.save(figure, file)


def _keys() -> list[Any]:
    signal = Line2D([], [], color="black", marker=".", linestyle="", label="a signal to the user")
    return [
        *(Patch(color=colour, label=f"{name} ({SIGNS[name]})") for name, colour in COLOURS.items()),
        signal,
    ]
