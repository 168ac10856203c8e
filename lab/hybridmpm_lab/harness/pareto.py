"""Which methods others dominate in error and latency, and which coarse level of a ladder reaches a method's error."""

from collections.abc import Sequence

from hybridmpm_lab.harness.rows import Row


def compared(rows: Sequence[Row]) -> list[Row]:
    """Add to each row of one table the methods that it has to be read against.

    `as_good` is the label, and `as_good_ms` the latency, of the cheapest MPM whose error is not above the
    row's: the latency that the row needs to beat. `dominated_by` is the cheapest model or MPM that is neither
    slower nor worse.
    """
    ladder = [row for row in rows if row["method"] == "mpm"]
    rivals = [row for row in rows if row["method"] in {"neural", "mpm"}]
    more = []
    for row in rows:
        level, better = cheapest_as_good(row, ladder), dominating(row, rivals)
        more.append(
            {
                **row,
                "as_good": level and level["label"],
                "as_good_ms": level and level["ms_per_frame"],
                "dominated_by": better and f"{better['method']} {better['label']}",
            }
        )
    return more


def dominating(row: Row, others: Sequence[Row]) -> Row | None:
    """Return the cheapest of the others that is neither slower nor worse than a row, and not equal in both.

    Rows without `error` or `ms_per_frame` neither dominate nor are dominated.
    """
    if not _measured(row):
        return None
    better = [
        other
        for other in others
        if _measured(other)
        and other["ms_per_frame"] <= row["ms_per_frame"]
        and other["error"] <= row["error"]
        and (other["ms_per_frame"], other["error"]) != (row["ms_per_frame"], row["error"])
    ]
    return min(better, key=lambda other: other["ms_per_frame"], default=None)


def cheapest_as_good(row: Row, ladder: Sequence[Row]) -> Row | None:
    """Return the cheapest coarse level whose error is at most the row's: a method pays only below that latency."""
    if row["error"] is None:
        return None
    as_good = [level for level in ladder if _measured(level) and level["error"] <= row["error"]]
    return min(as_good, key=lambda level: level["ms_per_frame"], default=None)


def _measured(row: Row) -> bool:
    return row["error"] is not None and row["ms_per_frame"] is not None
