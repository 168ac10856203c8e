"""How much slower learning is than MPM of equal error, over resolution and over stiffness."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from hybridmpm._support import charts
from hybridmpm_lab.compare.crossing.table import LATENCY_ALONE, LEARNED
from hybridmpm_lab.harness.rows import Row

_TITLES = {"resolution": "cells per metre", "compression": "compression by its own weight"}


def chart(rows: Sequence[Row], file: Path) -> None:
    """Draw a column for each scenario, over resolution and over stiffness, as SVG and PNG.

    A line is a learned method; its height is its time over that of the cheapest MPM that errs no more. Below
    one it pays. Points of cases that the library refuses are hollow; raises as `charts` does.
    """
    names = list(dict.fromkeys(row["scenario"] for row in rows))
    figure, axes = charts.panels(len(names), len(_TITLES), width=3.9, height=3.3)
    lines = list(dict.fromkeys(_line(row) for row in rows if row["method"] in LEARNED))
    looks = dict(zip(lines, zip(charts.COLOURS, charts.MARKERS, strict=True), strict=False))
    for column, name in enumerate(names):
        mine = [row for row in rows if row["scenario"] == name]
        for panel, axis in zip(axes[:, column], _TITLES, strict=True):
            _panel(panel, mine, axis, looks)
        axes[0, column].set_title(name)
    for row in axes:
        row[0].set_ylabel("times slower than MPM of equal error")
    _legend(figure, axes)
    charts.save(figure, file)


def _line(row: Row) -> str:
    kind = "network" if row["method"] == "neural" else "hybrid"
    as_many = ", as many particles as cells ask for, untrained" if row["variant"] == LATENCY_ALONE else ""
    return f"{kind} {row['label']}{as_many}"


def _panel(panel: Any, rows: Sequence[Row], axis: str, looks: dict[str, tuple[str, str]]) -> None:
    stiffer = axis == "compression"
    there = [row for row in rows if (row["compression"] is not None) == stiffer]
    panel.axhline(1.0, color="#303030", lw=1.2, linestyle="--", label="equal error, equal time")
    for name, (colour, marker) in looks.items():
        mine = [row for row in there if row["method"] in LEARNED and _line(row) == name]
        points = sorted(
            (row[axis], row["times_slower"], row["refused"]) for row in mine if row["times_slower"]
        )
        if not points:
            continue
        at, heights, _ = zip(*points, strict=True)
        panel.plot(at, heights, color=colour, lw=1, label=name, marker=marker, markerfacecolor="white")
        known = [(x, y) for x, y, refused in points if not refused]
        if known:
            panel.plot(*zip(*known, strict=True), color=colour, marker=marker, linestyle="none")
    panel.set(xscale="log", yscale="log", xlabel=_TITLES[axis])
    ticks = sorted({row[axis] for row in there})
    panel.set_xticks(ticks, [f"{100 * one:g} %" if stiffer else f"{one}" for one in ticks])
    panel.minorticks_off()
    charts.plain_log_ticks(panel.yaxis)
    if stiffer:
        panel.invert_xaxis()


def _legend(figure: Any, axes: Any) -> None:
    entries = {
        label: handle
        for panel in axes.flat
        for handle, label in zip(*panel.get_legend_handles_labels(), strict=True)
    }
    figure.legend(
        entries.values(), entries.keys(), loc="outside upper center", ncols=min(3, axes.shape[1]), fontsize=8
    )
