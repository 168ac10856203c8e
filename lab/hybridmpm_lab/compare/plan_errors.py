"""The errors that plans assume, from the rows of the trade-off."""

import json
from collections.abc import Sequence
from pathlib import Path

from hybridmpm import SOLVER_VERSION
from hybridmpm._support.files import replacing
from hybridmpm.errors import DataError
from hybridmpm.planner import store
from hybridmpm.planner.calibration import MEASURES, VERSION, Calibration, MachineTimes, MethodErrors
from hybridmpm.planner.candidates import candidates
from hybridmpm_lab.harness.rows import Row
from hybridmpm_lab.harness.table import row_name

_FLOOR = "jitter"


def calibration_of(rows: Sequence[Row], times: MachineTimes) -> Calibration:
    """Return the calibration of rows of the trade-off and of times.

    Candidates that failed in a scene are left out: no plan should choose them.
    """
    known = {scenario: candidates(scenario) for scenario in {row["scenario"] for row in rows}}
    errors = [
        MethodErrors(
            scenario=row["scenario"],
            name=row_name(row),
            scenes=row["scenes"],
            means={measure: row[field] for measure, field in MEASURES.items()},
            standard_errors={
                measure: row[f"{field}_se"]
                for measure, field in MEASURES.items()
                if row[f"{field}_se"] is not None
            },
        )
        for row in rows
        if row["error"] is not None and row_name(row) in (*known[row["scenario"]], _FLOOR)
    ]
    return Calibration(
        version=VERSION,
        solver_version=SOLVER_VERSION,
        commit=rows[0]["commit"],
        errors=tuple(errors),
        times=times,
    )


def read_rows(file: Path) -> list[Row]:
    """Read the file of `python -m hybridmpm_lab tradeoff --json`; raises `DataError` where it is none."""
    try:
        rows: list[Row] = json.loads(file.read_text(encoding="utf-8"))
        if not rows or not all(
            {"scenario", "method", "label", "error", "commit"} <= set(row) for row in rows
        ):
            raise ValueError("rows without errors")  # noqa: TRY301 - as of a damaged file
    except (OSError, ValueError, TypeError) as error:
        raise DataError(f"{file} has no rows of the trade-off: {error}") from None
    return rows


def refresh(file: Path, rows: Sequence[Row]) -> None:
    """Write the errors of the rows, and the times of the calibration that ships, as a calibration."""
    made = calibration_of(rows, store.shipped().times)
    with replacing(file) as part:
        part.write_text(made.model_dump_json(indent=1) + "\n", encoding="utf-8")
