"""The chart of control: error against planning time, family by family."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from hybridmpm._support import charts
from hybridmpm_lab.control.entrants import FILLED, NAMES
from hybridmpm_lab.control.report.means import ALL, judged_by
from hybridmpm_lab.control.suite.cases import FAMILIES, KINDS
from hybridmpm_lab.harness.rows import Row

_COLUMNS = 3
_LABELS = {
    "error": "final grid_rmse",
    "path_error": "distance from the way [m]",
    "transport": "transport distance [m]",
}
_GREY = "#333333"
_FAINT, _SMALL, _LARGE = 0.45, 4, 9


def chart(rows: Sequence[Row], file: Path) -> None:
    """Draw a panel for each family and kind of sketch, as SVG and PNG; raises as `charts` does.

    Small points are the means of single scenarios, large ones those of all sketches. The error is what the
    family is judged by, see `judged_by`.
    """
    parts = [
        (family, kind, mine)
        for family in FAMILIES
        for kind in KINDS[family]
        if (mine := [row for row in rows if (row["family"], row["sketch"]) == (family, kind)])
    ]
    columns = min(_COLUMNS, len(parts))
    figure, axes = charts.panels(columns, -(-len(parts) // columns), width=4.2, height=3.3)
    methods = sorted({row["method"] for row in rows}, key=_order)
    for panel in axes.flat[len(parts) :]:
        panel.set_visible(False)
    for (family, kind, mine), panel in zip(parts, axes.flat, strict=False):
        measure = judged_by(family)
        for index, method in enumerate(one for one in methods if one != FILLED):
            _draw(panel, [row for row in mine if row["method"] == method], measure, index)
        floor = [row[measure] for row in mine if row["method"] == FILLED]
        if floor and family == "reversed":
            # The last row is that of all scenarios, or of the only one.
            panel.axhline(floor[-1], color=_GREY, linestyle=":", linewidth=1.2)
        name = f"{family}, {kind}s" if len(KINDS[family]) > 1 else family
        panel.set(xscale="log", title=name, xlabel="planning time [ms]")
        charts.plain_log_ticks(panel.xaxis)
        panel.tick_params(labelsize=8)
        panel.set(ylabel=_LABELS[measure])
        if measure == "error":
            panel.set(ylim=(0, 1.05 * panel.get_ylim()[1]))
        else:
            panel.set(yscale="log")
            charts.plain_log_ticks(panel.yaxis)
    filled = any(row["method"] == FILLED and row["family"] == "reversed" for row in rows)
    _legend(figure, [one for one in methods if one != FILLED], 2 + 2 * columns, filled=filled)
    charts.save(figure, file)


def _draw(panel: Any, rows: Sequence[Row], measure: str, index: int) -> None:
    points = [row for row in rows if row[measure] is not None and row["plan_ms"] is not None]
    if not points:
        return
    style = {
        "color": charts.COLOURS[index % len(charts.COLOURS)],
        "marker": charts.MARKERS[(index + index // len(charts.COLOURS)) % len(charts.MARKERS)],
        "linestyle": "",
    }
    for row in points:
        at = [row["plan_ms"]], [row[measure]], [row[f"{measure}_se"] or 0.0]
        if row["scenario"] == ALL or len(points) == 1:
            panel.errorbar(*at, markersize=_LARGE, zorder=3, **style)
        else:
            panel.errorbar(*at, markersize=_SMALL, alpha=_FAINT, elinewidth=1, **style)


def _legend(figure: Any, methods: Sequence[str], columns: int, *, filled: bool) -> None:
    from matplotlib.lines import Line2D  # noqa: PLC0415 - an extra

    entries = [
        Line2D(
            [],
            [],
            linestyle="",
            color=charts.COLOURS[index % len(charts.COLOURS)],
            marker=charts.MARKERS[(index + index // len(charts.COLOURS)) % len(charts.MARKERS)],
            label=name,
        )
        for index, name in enumerate(methods)
    ]
    if filled:
        entries.append(Line2D([], [], color=_GREY, linestyle=":", label="sketch perfectly filled"))
    figure.legend(handles=entries, loc="outside upper center", ncols=min(columns, len(entries)))


def _order(method: str) -> tuple[int, str]:
    return (NAMES.index(method) if method in NAMES else len(NAMES), method)
