"""The chart of a comparison: error against time of a frame, a panel a scenario, with the Pareto front."""

from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import Any

from matplotlib import colormaps
from matplotlib.cm import ScalarMappable
from matplotlib.colors import LinearSegmentedColormap, Normalize
from matplotlib.lines import Line2D

from hybridmpm_lab.harness import charts
from hybridmpm_lab.harness.rows import Row

_COLUMNS = 4
_BOUND, _FRONT = charts.COLOURS[5], "#303030"
_LINES = (("still", "initial state held (ceiling)", ":"), ("jitter", "truth, other jitter (floor)", "--"))
_MARKS = {
    ("mpm", "plain"): ("o", "MPM"),
    ("mpm", "softer"): ("v", "MPM, softer material"),
    ("coarse", "plain"): ("s", "coarse, unfitted"),
    ("coarse", "fitted"): ("D", "coarse"),
    ("neural", "alone"): ("^", "network"),
    ("neural", "all shown"): (">", "network, all shown"),
    ("hybrid", "default guards"): ("X", "hybrid"),
    ("hybrid", "cosine"): ("P", "hybrid by the cosine alone, at $r_c$"),
    ("free fall", None): ("d", "free fall"),
    ("peer", None): ("*", "peer, ground truth's substeps"),
}
"""Marker and name of each kind of point."""
_ROOM = 1.12
"""Height of a panel over the ceiling."""


def chart(rows: Sequence[Row], file: Path) -> None:
    """Draw the errors, `grid_rmse`, against the times.

    Points on the Pareto front are filled and joined, dominated ones are hollow; the colour is the share of
    the frames that MPM simulated. Raises as `charts` does.
    """
    names = list(dict.fromkeys(row["scenario"] for row in rows))
    columns = len(names) + 1 if len(names) <= _COLUMNS else _COLUMNS
    figure, axes = charts.panels(columns, -(-(len(names) + 1) // columns), width=4.4, height=3.9)
    panels = list(axes.flat)
    shades = _shades()
    for panel, name in zip(panels, names, strict=False):
        _panel(panel, [row for row in rows if row["scenario"] == name], shades)
        panel.set_title(name)
    explained, *unused = panels[len(names) :]
    for panel in (explained, *unused):
        panel.axis("off")
    kinds = [(row["method"], row["variant"]) for row in rows]
    marks = dict(_MARKS[kind] for kind in _MARKS if kind in kinds)
    _explain(explained, panels[: len(names)], marks, shades)
    for row in axes:
        row[0].set_ylabel("grid_rmse")
    charts.save(figure, file)


def _shades() -> Any:
    """Return the colours of shares of frames, from none (violet) to all (yellow-green) by MPM."""
    part = LinearSegmentedColormap.from_list("share", colormaps["plasma"]([0.05, 0.3, 0.55, 0.8]))
    return ScalarMappable(Normalize(0.0, 1.0), part)


def _panel(panel: Any, rows: Sequence[Row], shades: Any) -> None:
    points = [row for row in rows if row["ms_per_frame"] is not None and row["error"] is not None]
    points = [row for row in points if (row["method"], row["variant"]) in _MARKS]
    front = sorted((row for row in points if row["on_front"]), key=lambda row: row["ms_per_frame"])
    bounds = {row["method"]: row["error"] for row in rows if row["method"] in {"still", "jitter"}}
    ceiling, highest = bounds.get("still"), max((row["error"] for row in points), default=1.0) or 1.0
    top = _ROOM * (min(highest, ceiling) if ceiling else highest)
    for method, label, dashes in _LINES:
        if bounds.get(method):
            panel.axhline(bounds[method], label=label, linestyle=dashes, color=_BOUND, lw=1.2)
    at, heights = [row["ms_per_frame"] for row in front], [row["error"] for row in front]
    panel.plot(at, heights, color=_FRONT, lw=1, label="Pareto front", zorder=2)
    for row in points:
        share = 1.0 if row["mpm_share"] is None else float(row["mpm_share"])
        _point(panel, row, is_front=row["on_front"], colour=shades.to_rgba(share))
    for index, row in enumerate(front):
        panel.annotate(
            str(row["label"]).replace("unfitted ", "").replace(" all shown", ""),
            (row["ms_per_frame"], row["error"]),
            (3, -11) if index % 2 else (4, 6),
            textcoords="offset points",
            fontsize=6.5,
            zorder=5,
            bbox={"facecolor": "white", "alpha": 0.6, "edgecolor": "none", "pad": 0.3},
        )
    beyond = sum(row["error"] > top for row in points)
    look = {"va": "top", "ha": "right", "fontsize": 7, "color": _BOUND}
    panel.text(0.98, 0.98, f"{beyond} beyond" if beyond else "", transform=panel.transAxes, **look)
    panel.set(xscale="log", xlabel="ms per frame", ylim=(0, top))
    charts.plain_log_ticks(panel.xaxis)
    panel.tick_params(axis="x", labelsize=7, labelrotation=45)
    panel.margins(x=0.06)


def _point(panel: Any, row: Row, *, is_front: bool, colour: Any) -> None:
    marker, _ = _MARKS[row["method"], row["variant"]]
    panel.errorbar(
        [row["ms_per_frame"]],
        [row["error"]],
        [row["error_se"] or 0.0],
        marker=marker,
        markersize=7 if is_front else 5,
        color=colour,
        markerfacecolor=colour if is_front else "white",
        elinewidth=0.8,
        linestyle="none",
        alpha=1.0 if is_front else 0.75,
        zorder=4 if is_front else 3,
    )


def _explain(panel: Any, others: Sequence[Any], marks: dict[str, str], shades: Any) -> None:
    """Fill the last panel with the meaning of lines, markers and colours."""
    lines = charts.entries(others)
    grey = partial(Line2D, [], [], color="#555555", linestyle="none")
    hollow = grey(marker="o", markerfacecolor="white")
    points = {label: grey(marker=marker) for marker, label in marks.items()}
    entries = {**lines, **points, "hollow: dominated by another": hollow}
    panel.legend(entries.values(), entries.keys(), loc="upper left", fontsize=7.5)
    bar = panel.figure.colorbar(shades, ax=panel, location="bottom", shrink=0.8, aspect=25)
    bar.set_label("share of the frames that MPM simulated", fontsize=8)
