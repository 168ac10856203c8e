"""Charts of speed over size: our solver and graph by threads, and the baselines."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from hybridmpm._support import charts
from hybridmpm_lab.harness.rows import Row
from hybridmpm_lab.speed.solver import INSTRUCTIONS

_NS = "ns_per_particle_substep"


def draw_solver(rows: Sequence[Row], file: Path) -> None:
    """Draw the time of a particle in a substep, with the widest vector instructions."""
    widest = max((row["instructions"] for row in rows), key=INSTRUCTIONS.index)
    rows = [row for row in rows if row["instructions"] == widest]
    panels = {
        f"{material} {dim}D": [row for row in rows if (row["dim"], row["material"]) == (dim, material)]
        for dim, material in dict.fromkeys((row["dim"], row["material"]) for row in rows)
    }
    _draw(panels, _NS, "peer_ns", file)


def draw_growing(rows: Sequence[Row], file: Path) -> None:
    """Draw the time of a particle in a substep, in growing blocks and in one blob on growing grids."""
    panels = {
        f"growing block, {dim}D": [row for row in rows if (row["series"], row["dim"]) == ("particles", dim)]
        for dim in (2, 3)
    }
    blobs = [row | {"particles": row["resolution"]} for row in rows if row["series"] == "grid"]
    _draw(panels | {"one blob, growing grid (cells per axis)": blobs}, _NS, "", file)


def draw_graph(rows: Sequence[Row], file: Path) -> None:
    """Draw the time of a graph."""
    panels = {f"{dim}D": [row for row in rows if row["dim"] == dim] for dim in (2, 3)}
    _draw(panels, "ms", "peer_ms", file, yscale="log")


def _draw(panels: dict[str, list[Row]], field: str, peer: str, file: Path, **options: Any) -> None:
    """Draw a field over the particles, a panel for each list of rows, a line for each number of threads."""
    columns = 2 if len(panels) == 4 else len(panels)
    figure, axes = charts.panels(columns, len(panels) // columns)
    legend: dict[str, Any] = {}
    for axis, (title, rows) in zip(axes.flat, panels.items(), strict=True):
        threads = sorted({row["threads"] for row in rows})
        lines = [(f"hybridmpm, threads: {count}", field, count) for count in threads]
        if peer and any(row[peer] is not None for row in rows):
            lines.append(("fastest baseline", peer, threads[0]))
        for (label, drawn, count), marker in zip(lines, charts.MARKERS, strict=False):
            mine = [row for row in rows if row["threads"] == count and row[drawn] is not None]
            points = sorted((row["particles"], row[drawn]) for row in mine)
            (legend[label],) = axis.plot(*zip(*points, strict=True), marker=marker)
        axis.set(title=title, xscale="log", xlabel="particles", ylabel=field.replace("_", " "))
        axis.set(**(options or {"ylim": (0, 1.1 * axis.dataLim.y1)}))
    figure.legend(legend.values(), legend.keys(), loc="outside upper center", ncols=3)
    charts.save(figure, file)
