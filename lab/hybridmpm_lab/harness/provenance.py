"""The origin of a measurement, and the file of its rows."""

import dataclasses
import datetime as dt
import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from hybridmpm._support.files import replacing
from hybridmpm._support.machine import cpu_model, usable_cores
from hybridmpm.errors import ConfigError
from hybridmpm_lab.harness.git import git
from hybridmpm_lab.harness.rows import Row


@dataclass(frozen=True)
class Provenance:
    """Fields that every row of a result carries beside its figures."""

    machine: str
    """Processor, and the number of cores that this process may use."""
    date: str
    """Date of the run, ISO 8601, UTC."""
    commit: str | None
    """Commit of the checkout that holds this code; None outside a checkout.

    "-dirty" follows the commit where files have been changed since.
    """
    command: str
    """Command that measures the rows again."""

    def stamped(self, row: Row) -> Row:
        """Return a row with these fields behind its own."""
        return row | dataclasses.asdict(self)


def provenance(command: str) -> Provenance:
    """Describe a run of a command that starts now."""
    return Provenance(
        machine=f"{cpu_model()}, {usable_cores()} cores",
        date=dt.datetime.now(dt.UTC).date().isoformat(),
        commit=_commit(Path(__file__)),
        command=command,
    )


def write_rows(path: Path, rows: Sequence[Row]) -> None:
    """Write rows as a JSON list of flat objects; raises `ExportError`."""
    with replacing(path) as part:
        part.write_text(json.dumps(rows, indent=1) + "\n", encoding="utf-8")


def other_commit(folder: Path) -> str:
    """Return the commit of another checkout; raises a ConfigError where the folder is none."""
    return git(folder, "rev-parse", "--short", "HEAD")


def _commit(file: Path) -> str | None:
    try:
        # An installed copy may lie in some other project's checkout, which does not track it.
        git(file.parent, "ls-files", "--error-unmatch", file.name)
        head = git(file.parent, "rev-parse", "HEAD")
        changed = git(file.parent, "status", "--porcelain", "--untracked-files=no")
    except ConfigError:
        return None
    return f"{head}-dirty" if changed else head
