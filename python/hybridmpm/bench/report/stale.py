"""Which results in a checkout are older than the code that made them."""

import ast
import importlib.util
import json
import subprocess
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from hybridmpm.errors import ConfigError, DataError

_PACKAGE = "hybridmpm"
_NATIVE = f"{_PACKAGE}._native"
_HOME = Path(__file__).parents[3]
_NO_MATTER = {f"{_PACKAGE}.bench.report.provenance", f"{_PACKAGE}._support.charts"}
"""Modules that no figure depends on."""
_RUST = ("rust", ":(exclude)rust/*/tests", ":(exclude)rust/*/benches")


@dataclass(frozen=True)
class Result:
    """A file of results and what has changed since."""

    file: str
    commit: str
    """Of the measurement."""
    changed: tuple[str, ...]
    """Files, relative to the checkout, that the benchmark imports or that the compiled module is built of."""


def results(folder: Path) -> list[Result]:
    """Compare each `NAME.json` of a folder with the module `hybridmpm.bench.NAME` and all it imports.

    Raises
    ------
    ConfigError
        The folder is in no checkout of this package, or a commit is not in its history.
    DataError
        A file is damaged or names no commit.
    """
    if not folder.is_dir():
        raise ConfigError(f"there is no folder {folder}; run this in a checkout, or name it with --results")
    root = Path(_git(folder, "rev-parse", "--show-toplevel"))
    return [
        Result(file.name, commit, tuple(_changed(root, commit, file.stem)))
        for file in sorted(folder.glob("*.json"))
        for commit in sorted(_commits(file))
    ]


def sources(module: str) -> set[Path]:
    """Return the files of a module and of all modules of this package that it imports, directly or not.

    A package's `__init__` is left out: what it re-exports counts only if it is imported. So are modules that
    name, write and draw figures.
    """
    found: set[Path] = set()
    todo = [module]
    while todo:
        name = todo.pop()
        path = None if name in _NO_MATTER else _path(name)
        if path is None or path in found:
            continue
        found.add(path)
        if path.suffix == ".py":
            todo += _imports(path)
    return {path for path in found if path.name != "__init__.py"}


def _imports(path: Path) -> Iterator[str]:
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            yield from (one.name for one in node.names if one.name.split(".")[0] == _PACKAGE)
        elif isinstance(node, ast.ImportFrom) and node.module and node.module.split(".")[0] == _PACKAGE:
            yield from (_origin(node.module, one.name) for one in node.names)


def _origin(module: str, name: str) -> str:
    """Return the module that a name comes from: a submodule, or what a package takes it from."""
    path = _path(module)
    if path is None or path.name != "__init__.py":
        return module
    if _path(f"{module}.{name}") is not None:
        return f"{module}.{name}"
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.ImportFrom) and any((one.asname or one.name) == name for one in node.names):
            return _origin(node.module or module, name)
    return module


def _path(module: str) -> Path | None:
    try:
        spec = importlib.util.find_spec(module)
    except ModuleNotFoundError:
        return None
    return Path(spec.origin) if spec is not None and spec.origin else None


def _changed(root: Path, commit: str, name: str) -> list[str]:
    found = sorted(Path(__file__).parents[1].rglob(f"{name}.py"))
    module = ".".join(found[0].relative_to(_HOME).with_suffix("").parts) if found else f"{_PACKAGE}.bench"
    files = sources(module)
    native = _path(_NATIVE)
    specs = [str(file) for file in files if file != native]
    if native in files:
        specs += _RUST
    if not specs:
        return [f"there is no benchmark {name}"]
    return _git(root, "diff", "--name-only", commit, "--", *specs).splitlines()


def _commits(file: Path) -> set[str]:
    try:
        rows = json.loads(file.read_text(encoding="utf-8"))
        return {row["commit"].removesuffix("-dirty") for row in rows}
    except (ValueError, TypeError, KeyError, AttributeError):
        raise DataError(f"{file} is damaged, or a row of it names no commit; measure it anew") from None


def _git(folder: Path, *arguments: str) -> str:
    command = ["git", "-C", str(folder), *arguments]
    try:
        run = subprocess.run(command, capture_output=True, text=True, check=True)  # noqa: S603 - constants
    except OSError as error:
        raise ConfigError(f"this needs git: {error.strerror or error}") from None
    except subprocess.CalledProcessError as error:
        raise ConfigError(
            f"{folder}: {error.stderr.strip()}; run this in a checkout with its history"
        ) from None
    return run.stdout.strip()
