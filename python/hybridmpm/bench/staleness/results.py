"""Results in a checkout that are older than the code that made them."""

import json
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

from hybridmpm.bench.staleness.history import History
from hybridmpm.bench.staleness.python_sources import PACKAGE, PythonSources
from hybridmpm.bench.staleness.rust_sources import rust_sources
from hybridmpm.errors import ConfigError, DataError


@dataclass(frozen=True, kw_only=True)
class Origin:
    """The code and the data that make a result."""

    modules: tuple[str, ...]
    """Modules that measure; what they import counts with them."""
    programs: tuple[str, ...] = ()
    """Patterns of Python files beside the library that run as well, relative to the checkout; what they
    import of the library counts with them."""
    data: tuple[str, ...] = ()
    """Patterns of the files that the measurement reads, relative to the checkout."""


@dataclass(frozen=True)
class DatedResult:
    """A file of results, and what has changed since its measurement."""

    file: str
    """Name of the file of results."""
    commit: str
    """Commit of the measurement."""
    changed: tuple[str, ...]
    """Files with other contents than at that commit, relative to the checkout; or why none can be named."""


def dated_results(folder: Path, benches: Mapping[str, Origin]) -> list[DatedResult]:
    """Compare the code behind each `NAME.json` of a folder with what the code was at the measurement.

    A file that has only been moved counts as unchanged, and so does one of which other things have changed
    than what it computes (see `program`).

    Parameters
    ----------
    folder : Path
        Folder of results, in a checkout of this project.
    benches : mapping of str to Origin
        What makes each result, by its name.

    Returns
    -------
    list of DatedResult
        One for each file and each commit that the rows of the file name.

    Raises
    ------
    ConfigError
        The folder is in no checkout of this project.
    DataError
        A file is damaged or names no commit.
    """
    if not folder.is_dir():
        raise ConfigError(f"there is no folder {folder}; run this in a checkout, or name it with --results")
    history = History(folder)
    if not (history.root / "python" / PACKAGE).is_dir():
        raise ConfigError(f"{history.root} is no checkout of {PACKAGE}; run this in a checkout of it")
    python = PythonSources(history.root / "python")
    return [
        DatedResult(file.name, commit, tuple(_changed(history, python, commit, benches.get(file.stem))))
        for file in sorted(folder.glob("*.json"))
        for commit in sorted(_commits(file))
    ]


def _changed(history: History, python: PythonSources, commit: str, origin: Origin | None) -> Iterator[str]:
    if origin is None:
        yield "the list of benchmarks, which lacks this result"
        return
    if not history.has(commit):
        yield "all that may have, for the history lacks this commit"
        return
    for missing in (module for module in origin.modules if python.path(module) is None):
        yield f"{missing}, which is gone"
    programs = frozenset(_matching(history.root, origin.programs))
    needs = python.needed_by(origin.modules, programs)
    files = needs.files | rust_sources(history.root / "rust", needs.native)
    files |= programs | set(_matching(history.root, origin.data))
    yield from sorted(history.name(file) for file in files if history.is_changed(file, commit))


def _matching(root: Path, patterns: tuple[str, ...]) -> Iterator[Path]:
    return (file for pattern in patterns for file in root.glob(pattern))


def _commits(file: Path) -> set[str]:
    try:
        rows = json.loads(file.read_text(encoding="utf-8"))
        return {row["commit"].removesuffix("-dirty") for row in rows}
    except (ValueError, TypeError, KeyError, AttributeError):
        raise DataError(f"{file} is damaged, or a row of it names no commit; measure it anew") from None
