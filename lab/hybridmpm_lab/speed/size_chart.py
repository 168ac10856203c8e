"""Lines of figures over the number of particles: ours by threads, and a peer's."""

from collections.abc import Sequence
from typing import Any

from hybridmpm._support import charts
from hybridmpm_lab.harness.rows import Row


def draw_over_particles(panel: Any, rows: Sequence[Row], field: str, peer: tuple[str, str] | None) -> None:
    """Draw a field of rows over their particles, one line for each number of threads.

    Parameters
    ----------
    panel : matplotlib Axes
    rows : sequence of Row
        Rows with `particles` and `threads`.
    field : str
        Field to be drawn.
    peer : tuple of str, optional
        Label of the peer, and field of its figures; rows of all numbers of threads have the same.
    """
    threads = sorted({row["threads"] for row in rows})
    lines = [(f"hybridmpm, {count} thread{'' if count == 1 else 's'}", field, count) for count in threads]
    if peer is not None:
        lines.append((*peer, threads[0]))
    for (label, drawn, count), marker in zip(lines, charts.MARKERS, strict=False):
        points = sorted(
            (row["particles"], row[drawn])
            for row in rows
            if row["threads"] == count and row[drawn] is not None
        )
        panel.plot(*zip(*points, strict=True), marker=marker, label=label)
