"""The chart of speed over size: our solver by threads, and the baselines."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from hybridmpm_lab.harness import charts
from hybridmpm_lab.harness.rows import Row
from hybridmpm_lab.speed.solver import INSTRUCTIONS

_LABEL = "ns per particle substep"


def draw(rows: Sequence[Row], file: Path) -> None:
    """Draw the time of a particle in a substep over the particles, with the widest vector instructions.

    A panel is a material in a dimension, a line a number of threads or the fastest baseline.
    """
    widest = max((row["instructions"] for row in rows), key=INSTRUCTIONS.index)
    rows = [row for row in rows if row["instructions"] == widest]
    cases = list(dict.fromkeys((row["material"], row["dim"]) for row in rows))
    columns = 2 if len(cases) == 4 else len(cases)
    figure, axes = charts.panels(columns, len(cases) // columns)
    legend: dict[str, Any] = {}
    for axis, case in zip(axes.flat, cases, strict=True):
        here = [row for row in rows if (row["material"], row["dim"]) == case]
        threads = sorted({row["threads"] for row in here})
        lines = [(f"hybridmpm, threads: {count}", "ns_per_particle_substep", count) for count in threads]
        if any(row["peer_ns"] is not None for row in here):
            lines.append(("fastest baseline", "peer_ns", threads[0]))
        for (label, field, count), marker in zip(lines, charts.MARKERS, strict=False):
            mine = [row for row in here if row["threads"] == count and row[field] is not None]
            points = sorted((row["particles"], row[field]) for row in mine)
            (legend[label],) = axis.plot(*zip(*points, strict=True), marker=marker)
        axis.set(title=f"{case[0]} {case[1]}D", xscale="log", xlabel="particles", ylabel=_LABEL)
        axis.set(ylim=(0, 1.1 * axis.dataLim.y1))
    figure.legend(legend.values(), legend.keys(), loc="outside upper center", ncols=3)
    charts.save(figure, file)
