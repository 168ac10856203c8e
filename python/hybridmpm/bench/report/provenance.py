"""Where and from what a measurement came, and writing its rows."""

import datetime as dt
import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from hybridmpm._support.files import replacing
from hybridmpm._support.machine import cpu_model, usable_cores
from hybridmpm.bench.report.git import git
from hybridmpm.errors import ConfigError


@dataclass(frozen=True)
class Provenance:
    """Fields that every row of a result carries beside its figures."""

    machine: str
    date: str
    """Of the run, ISO 8601, UTC."""
    commit: str | None
    """Of the checkout that holds this code, "-dirty" where changed since; None outside a checkout."""
    command: str


def provenance(command: str) -> Provenance:
    """Describe a run that starts now."""
    return Provenance(
        machine=f"{cpu_model()}, {usable_cores()} cores",
        date=dt.datetime.now(dt.UTC).date().isoformat(),
        commit=_commit(Path(__file__)),
        command=command,
    )


def write_rows(path: Path, rows: Sequence[dict[str, Any]]) -> None:
    """Write rows as a JSON list of flat objects; raises `ExportError`."""
    with replacing(path) as part:
        part.write_text(json.dumps(rows, indent=1) + "\n", encoding="utf-8")


def _commit(file: Path) -> str | None:
    try:
        # An installed copy may lie in some other project's checkout, which does not track it.
        git(file.parent, "ls-files", "--error-unmatch", file.name)
        head = git(file.parent, "rev-parse", "HEAD")
        changed = git(file.parent, "status", "--porcelain", "--untracked-files=no")
    except ConfigError:
        return None
    return f"{head}-dirty" if changed else head
