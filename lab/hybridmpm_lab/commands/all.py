"""`python -m hybridmpm_lab all`: the published results that are no longer of what ships."""

import subprocess
import sys
from pathlib import Path

import click

from hybridmpm.errors import ConfigError
from hybridmpm_lab.harness import results
from hybridmpm_lab.harness.table import print_table


@click.command("all")
@click.option("--stale", is_flag=True, help="List the stale results, and make none.")
@click.option(
    "--runs",
    type=click.Path(file_okay=False, path_type=Path),
    default=Path("runs"),
    show_default=True,
    metavar="FOLDER",
    help="Folder of the runs so far; the same command resumes with them after an interruption.",
)
def all(*, stale: bool, runs: Path) -> None:  # noqa: A001 - the name of the command
    """Make the stale published results anew, in order; times need an idle machine.

    A result is stale where the solver, a network, a fitted table or a result that took part is no longer the
    one that ships.
    """
    found = list(results.stale())
    rows = [
        {
            "result": one.name,
            "minutes": one.minutes,
            "needs": ", ".join(one.needs),
            "command": " ".join(["python -m hybridmpm_lab", *one.words(runs)]),
            "reason": "; ".join(reasons),
        }
        for one, reasons in found
    ]
    if rows:
        print_table(rows, tuple(rows[0]))
    minutes = sum(one.minutes for one, _ in found)
    click.echo(
        f"{len(found)} of {len(results.RESULTS)} results are stale; making them takes {minutes} minutes"
    )
    if stale:
        return
    runs.mkdir(parents=True, exist_ok=True)
    for one, _ in found:
        for words in (one.words(runs), (one.after or "").split()):
            command = [sys.executable, "-m", "hybridmpm_lab", *words]
            if words and subprocess.run(command, check=False).returncode:  # noqa: S603 - constants
                raise ConfigError(f"{one.name} could not be made; the same command resumes here")
