"""Error against latency as a chart: the ladder of MPM, the models, and the bounds of the error."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from hybridmpm._support import charts
from hybridmpm_lab.harness.rows import Row

_COLUMNS = 4
_LADDER, _MODEL, _BOUND = charts.COLOURS[0], charts.COLOURS[1], charts.COLOURS[5]
_DOMINATED = "#9aa0a6"
_LINES = (("still", "initial state held", ":"), ("jitter", "truth, other jitter", "--"))


def chart(rows: Sequence[Row], file: Path) -> None:
    """Draw a panel for each scenario and warm-up, as SVG and PNG; raises as `charts` does.

    Models that another method dominates are hollow and grey.
    """
    tables: dict[tuple[str, int], list[Row]] = {}
    for row in rows:
        tables.setdefault((row["scenario"], row["warm_up"]), []).append(row)
    columns = min(_COLUMNS, len(tables))
    figure, axes = charts.panels(columns, -(-len(tables) // columns), width=3.9, height=3.6)
    for panel, ((scenario, warm_up), table) in zip(axes.flat, tables.items(), strict=False):
        _draw(panel, table)
        several = sum(name == scenario for name, _ in tables) > 1
        panel.set_title(f"{scenario}, after {warm_up} frames of warm-up" if several else scenario)
    for panel in axes.flat[len(tables) :]:
        panel.set_visible(False)
    for panel in axes[:, 0]:
        panel.set_ylabel("grid_rmse, mean of the span")
    entries = {
        label: handle
        for panel in axes.flat
        for handle, label in zip(*panel.get_legend_handles_labels(), strict=True)
    }
    figure.legend(entries.values(), entries.keys(), loc="outside upper center", ncols=min(6, 2 * columns))
    charts.save(figure, file)


def _draw(panel: Any, table: Sequence[Row]) -> None:
    ladder = [row for row in table if row["method"] == "mpm" and row["ms_per_frame"] is not None]
    ladder.sort(key=lambda row: row["ms_per_frame"])
    panel.plot(
        [row["ms_per_frame"] for row in ladder],
        [row["error"] for row in ladder],
        marker=charts.MARKERS[0],
        color=_LADDER,
        label="MPM at $r_p$",
    )
    for row in ladder:
        _name(panel, row, row["label"], (5, 5), _LADDER)
    models = [row for row in table if row["method"] == "neural"]
    latencies = [row["ms_per_frame"] for row in (*ladder, *models) if row["ms_per_frame"] is not None]
    _models(panel, models, middle=(min(latencies) * max(latencies)) ** 0.5)
    top = max(row["error"] for row in table if row["method"] in {"mpm", "still", "neural"} and row["error"])
    for method, label, dashes in _LINES:
        for row in (row for row in table if row["method"] == method):
            panel.axhline(row["error"], label=label, linestyle=dashes, color=_BOUND)
    for row in (row for row in table if row["method"] == "merged"):
        panel.axhline(row["error"], label="floor of the models' $r_p$", linestyle="-.", color=_MODEL, lw=1)
    zeros = [row["error"] for row in table if row["method"] == "zero"]
    beyond = " (off the chart)" if min(zeros) > 1.18 * top else ""
    text = "\n".join(sorted({f"free fall {error:.2f}{beyond}" for error in zeros}))
    panel.text(0.98, 0.97, text, transform=panel.transAxes, ha="right", va="top", fontsize=8, color=_BOUND)
    panel.set(xscale="log", xlabel="ms per frame", ylim=(0, 1.18 * top))
    charts.plain_log_ticks(panel.xaxis)
    panel.margins(x=0.12)


def _models(panel: Any, models: Sequence[Row], middle: float) -> None:
    """Draw the models, with their names towards the middle of all latencies [ms]."""
    for row in models:
        if row["error"] is None or row["ms_per_frame"] is None:
            continue
        dominated = row["dominated_by"] is not None
        colour = _DOMINATED if dominated else _MODEL
        panel.errorbar(
            [row["ms_per_frame"]],
            [row["error"]],
            [row["error_se"] or 0.0],
            marker=charts.MARKERS[1],
            color=colour,
            markerfacecolor="white" if dominated else colour,
            linestyle="none",
            capsize=2,
            label="model, dominated" if dominated else "model",
        )
        # Away from the ladder, which is below what it dominates.
        across = 1 if dominated and row["ms_per_frame"] < middle else -1
        _name(panel, row, row["label"], (across, 9 if dominated else -14), colour)


def _name(panel: Any, row: Row, text: str, offset: tuple[int, int], colour: str) -> None:
    panel.annotate(
        text,
        (row["ms_per_frame"], row["error"]),
        offset,
        textcoords="offset points",
        ha="left" if offset[0] > 0 else "right",
        fontsize=8,
        color=colour,
        bbox={"facecolor": "white", "alpha": 0.7, "edgecolor": "none", "pad": 0.5},
    )
