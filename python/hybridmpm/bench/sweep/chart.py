"""The sweep as a chart: error against latency, and latency against r_t, scenario by scenario."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from hybridmpm._support import charts
from hybridmpm.bench.accuracy.conventions import RATIOS
from hybridmpm.bench.report.pareto import dominating
from hybridmpm.bench.report.rows import Row
from hybridmpm.bench.sweep.family import SIZES, STRIDES

_COLOURS = dict(zip(RATIOS, charts.COLOURS, strict=False))
_MARKERS = dict(zip(SIZES, charts.MARKERS, strict=False))
_DASHES: dict[str, Any] = dict(zip(SIZES, ("-", "--", ":"), strict=True))
_MPM = "#333333"
_FAINT = 0.35
_SMALL, _LARGE = 5, 9


def chart(rows: Sequence[Row], file: Path) -> None:
    """Draw two panels for each scenario, as SVG and PNG; raises as `charts` does.

    The upper panel holds the trained networks: faint where another dominates them, hollow where MPM does,
    large where they were trained for longer than others. The lower panel holds all networks, untrained ones
    hollow.
    """
    names = list(dict.fromkeys(row["scenario"] for row in rows))
    figure, axes = charts.panels(len(names), 2, width=5.2, height=3.8)
    for name, (errors, latencies) in zip(names, axes.T, strict=True):
        mine = [row for row in rows if row["scenario"] == name]
        _errors(errors, mine)
        _latencies(latencies, mine)
        errors.set_title(name)
    axes[0, 0].set_ylabel("grid_rmse, mean of the span")
    axes[1, 0].set_ylabel("ms per frame")
    minutes = [row["minutes"] for row in rows if row["method"] == "neural" and row["trained"]]
    _legend(figure, minutes, columns=4 if len(names) > 1 else 2)
    charts.save(figure, file)


def _errors(panel: Any, rows: Sequence[Row]) -> None:
    ladder = sorted(
        (row["ms_per_frame"], row["error"], row["label"]) for row in rows if row["method"] == "mpm"
    )
    panel.plot([one[0] for one in ladder], [one[1] for one in ladder], marker="x", color=_MPM)
    for ms, error, label in ladder:
        panel.annotate(label, (ms, error), (5, 4), textcoords="offset points", fontsize=8, color=_MPM)
    networks = [
        row
        for row in rows
        if row["method"] == "neural" and row["error"] is not None and row["ms_per_frame"] is not None
    ]
    shortest = min((row["minutes"] for row in networks), default=0.0)
    for row in networks:
        best = dominating(row, networks) is None
        _point(panel, row, best=best, size=_LARGE if row["minutes"] > shortest else _SMALL)
    still = next(row["error"] for row in rows if row["method"] == "still")
    panel.axhline(still, linestyle=":", color=_MPM, linewidth=1)
    panel.annotate(
        "initial state held", (0, still), (4, 3), xycoords=("axes fraction", "data"),
        textcoords="offset points", fontsize=8, color=_MPM, zorder=4,
    )  # fmt: skip
    zeros = [row["error"] for row in rows if row["method"] == "zero"]
    text = f"free fall {min(zeros):.2f} to {max(zeros):.2f}\nnumbers at points: $r_t$"
    panel.text(0.02, 0.04, text, transform=panel.transAxes, va="bottom", fontsize=8, color=_MPM)
    panel.set(xscale="log", ylim=(0, 1.25 * still), xlabel="ms per frame")
    panel.margins(x=0.1)


def _point(panel: Any, row: Row, *, best: bool, size: float) -> None:
    colour = _COLOURS[_ratio(row)]
    panel.errorbar(
        [row["ms_per_frame"]],
        [row["error"]],
        [row["error_se"] or 0.0],
        marker=_MARKERS[row["size"]],
        color=colour,
        markerfacecolor="white" if row["dominated_by"] else colour,
        markersize=size,
        elinewidth=1,
        alpha=1.0 if best else _FAINT,
        zorder=3 if best else 2,
    )
    if best:
        at = (row["ms_per_frame"], row["error"])
        panel.annotate(f"{row['r_t']}", at, (4, -10), textcoords="offset points", fontsize=8, color=colour)


def _latencies(panel: Any, rows: Sequence[Row]) -> None:
    """Draw a line for each size and r_p of the networks with the smaller radius; the larger costs more."""
    networks = [row for row in rows if row["method"] == "neural" and row["ms_per_frame"] is not None]
    radius = min((row["spacings"] for row in networks), default=None)
    for ratio in RATIOS:
        for size in SIZES:
            line = sorted(
                (row["r_t"], row["ms_per_frame"], bool(row["trained"]))
                for row in networks
                if row["size"] == size and _ratio(row) == ratio and row["spacings"] == radius
            )
            colour = _COLOURS[ratio]
            panel.plot(
                [one[0] for one in line], [one[1] for one in line], linestyle=_DASHES[size], color=colour
            )
            for r_t, ms, trained in line:
                face = colour if trained else "white"
                panel.plot(r_t, ms, marker=_MARKERS[size], markersize=4, color=colour, markerfacecolor=face)
    for row in rows:
        if row["method"] == "mpm":
            panel.axhline(row["ms_per_frame"], color=_MPM, linewidth=0.8, zorder=1)
            panel.annotate(
                f"MPM {row['label']}", (1, row["ms_per_frame"]), (-3, 2), xycoords=("axes fraction", "data"),
                textcoords="offset points", fontsize=7, color=_MPM, ha="right",
            )  # fmt: skip
    panel.set(xscale="log", yscale="log", xlabel="$r_t$", xticks=STRIDES, xticklabels=STRIDES, xlim=(0.9, 40))
    panel.minorticks_off()


def _ratio(row: Row) -> str:
    return min(RATIOS, key=lambda label: abs(RATIOS[label] - row["r_p"]))


def _legend(figure: Any, minutes: Sequence[float], columns: int) -> None:
    from matplotlib.lines import Line2D  # noqa: PLC0415 - an extra

    entries = [
        Line2D([], [], color=colour, linewidth=3, label=f"$r_p$ {label}")
        for label, colour in _COLOURS.items()
    ]
    entries += [
        Line2D([], [], color=_MPM, marker=_MARKERS[size], linestyle=_DASHES[size], label=f"network {size}")
        for size in SIZES
    ]
    entries.append(Line2D([], [], color=_MPM, marker="x", label="MPM at $r_p$"))
    hollow: dict[str, Any] = {"marker": "o", "markerfacecolor": "white", "linestyle": "", "color": _MPM}
    entries += [
        Line2D([], [], label="hollow: dominated by MPM; below: untrained", markersize=_SMALL, **hollow),
        Line2D([], [], label="faint: dominated by a network", alpha=_FAINT, markersize=_SMALL, **hollow),
    ]
    if minutes and max(minutes) > min(minutes):
        text = f"large: trained for more than {min(minutes):g} minutes"
        entries.append(Line2D([], [], label=text, markersize=_LARGE, **hollow))
    figure.legend(handles=entries, loc="outside upper center", ncols=columns)
