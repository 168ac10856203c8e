"""The errors that plans assume, from the rows of the trade-off."""

from collections.abc import Sequence
from pathlib import Path

import click

from hybridmpm import SOLVER_VERSION
from hybridmpm._support.files import replacing
from hybridmpm.planner import store
from hybridmpm.planner.calibration import MEASURES, VERSION, Calibration, MachineTimes, MethodErrors
from hybridmpm.planner.candidates import candidates
from hybridmpm_lab.harness.rows import Row, read_rows, row_name

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
        deviations=store.shipped().deviations,
        times=times,
    )


def refresh(file: Path, rows: Sequence[Row]) -> None:
    """Write the errors of the rows, and the times of the calibration that ships, as a calibration."""
    made = calibration_of(rows, store.shipped().times)
    with replacing(file) as part:
        part.write_text(made.model_dump_json(indent=1) + "\n", encoding="utf-8")


@click.command("plan-errors")
@click.argument("rows_file", type=click.Path(exists=True, dir_okay=False, path_type=Path))
@click.argument("calibration", type=click.Path(dir_okay=False, path_type=Path))
def plan_errors(*, rows_file: Path, calibration: Path) -> None:
    """Write the errors of ROWS_FILE, made by `tradeoff --json`, with the shipped times into CALIBRATION."""
    refresh(calibration, read_rows(rows_file))
    click.echo(f"wrote {calibration}")
