"""From the rows of `bench tradeoff` to the errors that plans know."""

import json
from collections.abc import Sequence
from pathlib import Path

from hybridmpm import _core
from hybridmpm.errors import DataError
from hybridmpm.planner.calibration import MEASURES, VERSION, Calibration, MachineTimes, MethodErrors
from hybridmpm.planner.candidates import candidates
from hybridmpm_lab.harness.rows import Row

_FLOOR = "jitter"


def calibration_of(rows: Sequence[Row], times: MachineTimes) -> Calibration:
    """Return the calibration of rows of `bench tradeoff` and of times.

    Candidates that failed in a scene are left out: nobody should be advised to take them.
    """
    found = []
    for row in rows:
        name = " ".join(part for part in (row["method"], row["label"]) if part)
        if (name in candidates(row["scenario"]) or name == _FLOOR) and row["error"] is not None:
            found.append(
                MethodErrors(
                    scenario=row["scenario"],
                    name=name,
                    scenes=row["scenes"],
                    means={measure: row[field] for measure, field in MEASURES.items()},
                    standard_errors={
                        measure: row[f"{field}_se"]
                        for measure, field in MEASURES.items()
                        if row[f"{field}_se"] is not None
                    },
                )
            )
    return Calibration(
        version=VERSION,
        solver_version=_core.SOLVER_VERSION,
        commit=rows[0]["commit"] if rows else None,
        errors=tuple(found),
        times=times,
    )


def read_rows(file: Path) -> list[Row]:
    """Read a file that `bench tradeoff --json` wrote; raises `DataError` where it is none."""
    try:
        rows: list[Row] = json.loads(file.read_text(encoding="utf-8"))
        if not rows or not all(
            {"scenario", "method", "label", "error", "commit"} <= set(row) for row in rows
        ):
            raise ValueError("rows without errors")  # noqa: TRY301 - as of a damaged file
    except (OSError, ValueError, TypeError) as error:
        raise DataError(f"{file} holds no rows of the trade-off: {error}") from None
    return rows
