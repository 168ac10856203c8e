"""The stability map as a picture: a panel for each method, a line for each stress, a cell for each level."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from hybridmpm._support import charts
from hybridmpm_lab.harness.rows import Row

if TYPE_CHECKING:
    from matplotlib.figure import Figure

COLOURS = {"survived": "#dbe9f1", "refused": "#9aa5ad", "degraded": "#e3a857", "failed": "#7f1d1d"}
"""Colours of the outcomes; a grey print keeps their order, but for what is refused, which has a sign, too."""
METHODS = {
    "mpm": "MPM",
    "coarse": "MPM, 1/16 of the particles\ncarry all",
    "neural": "network",
    "hybrid": "hybrid",
}
_SIGNS = {"refused": "x", "degraded": "d", "failed": "F"}


def chart(rows: Sequence[Row], file: Path) -> None:
    """Draw the map as SVG and PNG. A dot in a cell says that the user is told."""
    lines = list(dict.fromkeys(row["stress"] for row in rows))
    settings = list(dict.fromkeys((row["material"], row["dim"]) for row in rows))
    methods = [method for method in METHODS if any(row["method"] == method for row in rows)]
    figure, axes = charts.panels(len(methods), width=3.0, height=1.2 + 0.3 * len(lines))
    for axis, method in zip(axes[0], methods, strict=True):
        for row in (row for row in rows if row["method"] == method):
            column = settings.index((row["material"], row["dim"]))
            _cell(axis, row, 3.4 * column + row["step"], lines.index(row["stress"]))
        axis.set(xlim=(0.3, 3.4 * len(settings) + 0.3), ylim=(len(lines) - 0.5, -0.5))
        axis.set_title(METHODS[method], fontsize=9)
        axis.set_xticks(
            [3.4 * column + 2 for column in range(len(settings))],
            [f"{material}\n{dim}D" for material, dim in settings],
            fontsize=8,
        )
        axis.set_yticks(range(len(lines)), lines if axis is axes[0][0] else [])
        axis.grid(visible=False)
        axis.tick_params(length=0)
    _legend(figure)
    charts.save(figure, file)


def _cell(axis: Any, row: Row, place: float, line: int) -> None:
    outcome = row["outcome"]
    axis.bar(place, 0.86, 0.92, bottom=line - 0.43, color=COLOURS[outcome])
    ink = "white" if outcome == "failed" else "black"
    if outcome in _SIGNS:
        axis.text(place, line, _SIGNS[outcome], ha="center", va="center", fontsize=7, color=ink)
    if row["signalled"]:
        axis.plot(place + 0.3, line - 0.27, ".", markersize=3, color=ink)


def _legend(figure: "Figure") -> None:
    from matplotlib.lines import Line2D  # noqa: PLC0415 - an extra
    from matplotlib.patches import Patch  # noqa: PLC0415

    keys: list[Any] = [
        Patch(color=colour, label=f"{name} ({_SIGNS[name]})" if name in _SIGNS else name)
        for name, colour in COLOURS.items()
    ]
    keys.append(Line2D([], [], color="black", marker=".", linestyle="", label="the user is told"))
    figure.legend(handles=keys, loc="outside lower center", ncols=len(keys))
