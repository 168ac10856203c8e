"""Error against latency, a panel a scenario and a chart a measure: the front, and who stays behind it."""

from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import Any

from hybridmpm._support import charts
from hybridmpm_lab.compare.tradeoff.measures import FRONTS
from hybridmpm_lab.harness.rows import Row

_COLUMNS = 4
_BOUND, _FRONT = charts.COLOURS[5], "#303030"
_LINES = (("still", "initial state held (ceiling)", ":"), ("jitter", "truth, other jitter (floor)", "--"))
_MARKS = {
    ("mpm", "plain"): ("o", "MPM, the few alone"),
    ("mpm", "softer"): ("v", "MPM, softer material"),
    ("mpm", "sleeping"): ("h", "MPM, sleeping"),
    ("coarse", "plain"): ("s", "coarse, unfitted"),
    ("coarse", "fitted"): ("D", "coarse"),
    ("coarse", "sleeping"): ("p", "coarse, sleeping"),
    ("neural", "alone"): ("^", "network"),
    ("neural", "all shown"): (">", "network, all shown"),
    ("hybrid", "default guards"): ("X", "hybrid"),
    ("hybrid", "cosine"): ("P", "hybrid by the cosine alone, at $r_c$"),
    ("peer", None): ("*", "peer, ground truth's substeps"),
}
"""Marker and name of each kind of point."""
_ROOM = 1.12
"""Height of a panel over the ceiling."""


def chart(rows: Sequence[Row], file: Path) -> None:
    """Draw FILE by `grid_rmse`, and FILE-MEASURE by each other measure, as SVG and PNG.

    Points on the front are filled and joined, dominated ones are hollow; the colour tells the share of the
    frames that MPM simulated. Raises as `charts` does.
    """
    for measure in FRONTS:
        name = file.stem if measure == "error" else f"{file.stem}-{measure.replace('_', '-')}"
        if any(row[measure] is not None and row["ms_per_frame"] is not None for row in rows):
            _draw(rows, measure, file.with_name(f"{name}{file.suffix}"))


def _draw(rows: Sequence[Row], measure: str, file: Path) -> None:
    names = list(dict.fromkeys(row["scenario"] for row in rows))
    columns = min(_COLUMNS, len(names) + 1)
    figure, axes = charts.panels(columns, -(-(len(names) + 1) // columns), width=4.4, height=3.9)
    panels = list(axes.flat)
    shades = _shades()
    for panel, name in zip(panels, names, strict=False):
        _panel(panel, [row for row in rows if row["scenario"] == name], measure, shades)
        panel.set_title(name)
    legend, *unused = panels[len(names) :]
    for panel in (legend, *unused):
        panel.axis("off")
    _explain(legend, panels[: len(names)], figure, shades)
    for row in axes:
        row[0].set_ylabel(FRONTS[measure])
    charts.save(figure, file)


def _shades() -> Any:
    """Return the colours of shares of frames, from none (violet) to all (yellow-green) by MPM."""
    from matplotlib import colormaps  # noqa: PLC0415 - an extra
    from matplotlib.cm import ScalarMappable  # noqa: PLC0415
    from matplotlib.colors import LinearSegmentedColormap, Normalize  # noqa: PLC0415

    part = LinearSegmentedColormap.from_list("share", colormaps["plasma"]([0.05, 0.3, 0.55, 0.8]))
    return ScalarMappable(Normalize(0.0, 1.0), part)


def _panel(panel: Any, rows: Sequence[Row], measure: str, shades: Any) -> None:
    field = "on_front" if measure == "error" else f"on_front_{measure}"
    points = [row for row in rows if row["ms_per_frame"] is not None and row[measure] is not None]
    points = [row for row in points if (row["method"], row["variant"]) in _MARKS]
    front = sorted((row for row in points if row[field]), key=lambda row: row["ms_per_frame"])
    bounds = {row["method"]: row[measure] for row in rows if row["method"] in {"still", "jitter"}}
    top = _top(points, bounds.get("still"), measure)
    for method, label, dashes in _LINES:
        if bounds.get(method) is not None and bounds[method] > 0:
            panel.axhline(bounds[method], label=label, linestyle=dashes, color=_BOUND, lw=1.2)
    panel.plot(
        [row["ms_per_frame"] for row in front],
        [row[measure] for row in front],
        color=_FRONT,
        lw=1,
        label="front",
        zorder=2,
    )
    for row in points:
        _point(panel, row, measure, is_front=row[field], colour=shades.to_rgba(_share(row)))
    for index, row in enumerate(front):
        panel.annotate(
            _short(row),
            (row["ms_per_frame"], row[measure]),
            (3, -11) if index % 2 else (4, 6),
            textcoords="offset points",
            fontsize=6.5,
            zorder=5,
            bbox={"facecolor": "white", "alpha": 0.6, "edgecolor": "none", "pad": 0.3},
        )
    beyond = sum(row[measure] > top for row in points)
    notes = [f"{beyond} beyond"] if beyond else []
    untrained = [row["ms_per_frame"] for row in rows if row["variant"] == "untrained" and row["ms_per_frame"]]
    if untrained:
        listed = ", ".join(f"{ms:.0f}" for ms in sorted(untrained))
        notes.append(f"networks of the paper's size, untrained: {listed} ms")
    panel.text(
        0.98,
        0.98,
        "; ".join(notes),
        transform=panel.transAxes,
        va="top",
        ha="right",
        fontsize=7,
        color=_BOUND,
    )
    panel.set(xscale="log", xlabel="ms per frame", ylim=(0, top))
    charts.plain_log_ticks(panel.xaxis)
    panel.tick_params(axis="x", labelsize=7, labelrotation=45)
    panel.margins(x=0.06)


def _top(points: Sequence[Row], ceiling: float | None, measure: str) -> float:
    """Return the height of a panel: the ceiling, or all points where they stay below it."""
    highest = max((row[measure] for row in points), default=1.0) or 1.0
    return float(_ROOM * (highest if ceiling is None or ceiling <= 0 else min(highest, ceiling)))


def _point(panel: Any, row: Row, measure: str, *, is_front: bool, colour: Any) -> None:
    marker, _ = _MARKS[row["method"], row["variant"]]
    panel.errorbar(
        [row["ms_per_frame"]],
        [row[measure]],
        [row[f"{measure}_se"] or 0.0],
        marker=marker,
        markersize=7 if is_front else 5,
        color=colour,
        markerfacecolor=colour if is_front else "white",
        elinewidth=0.8,
        linestyle="none",
        alpha=1.0 if is_front else 0.75,
        zorder=4 if is_front else 3,
    )


def _share(row: Row) -> float:
    """Return the share of the frames that MPM simulated; peers are MPM, too."""
    return 1.0 if row["mpm_share"] is None else float(row["mpm_share"])


def _short(row: Row) -> str:
    return str(row["label"]).replace("unfitted ", "").replace(" all shown", "")


def _explain(legend: Any, panels: Sequence[Any], figure: Any, shades: Any) -> None:
    """Fill the last panel with what lines, markers and colours mean."""
    from matplotlib.lines import Line2D  # noqa: PLC0415 - an extra

    lines = {
        label: handle
        for panel in panels
        for handle, label in zip(*panel.get_legend_handles_labels(), strict=True)
    }
    grey = partial(Line2D, [], [], color="#555555", linestyle="none")
    marks = {label: grey(marker=marker) for marker, label in _MARKS.values()}
    hollow = grey(marker="o", markerfacecolor="white")
    entries = {**lines, **marks, "hollow: dominated by another": hollow}
    legend.legend(entries.values(), entries.keys(), loc="upper left", fontsize=7.5)
    bar = figure.colorbar(shades, ax=legend, location="bottom", shrink=0.8, aspect=25)
    bar.set_label("share of the frames that MPM simulated", fontsize=8)
