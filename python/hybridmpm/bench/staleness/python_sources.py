"""Which files of the package a module needs, and which names of the compiled module these use."""

import ast
import functools
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

PACKAGE = "hybridmpm"
NATIVE = f"{PACKAGE}._native"
ALL = "*"
"""Stands for every name of a module."""

_UNCOUNTED = {f"{PACKAGE}.bench.report.provenance", f"{PACKAGE}._support.charts"}
"""Modules that name, write and draw figures: no figure depends on them."""


@dataclass(frozen=True, kw_only=True)
class PythonNeeds:
    """What the modules of a benchmark need."""

    files: frozenset[Path]
    """Files of the modules and of all that they import, directly or not."""
    native: frozenset[str]
    """Names of `hybridmpm._native` that these files use; `ALL` where that cannot be told."""


class _Use(NamedTuple):
    """A name that a file takes from a module of this package."""

    module: str
    name: str


class PythonSources:
    """The package `hybridmpm` as files, read and never run.

    Parameters
    ----------
    folder : Path
        Folder that holds the package's folder.
    """

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._uses = functools.cache(lambda path: frozenset(self._found_uses(path)))

    def needed_by(self, modules: tuple[str, ...], programs: frozenset[Path] = frozenset()) -> PythonNeeds:
        """Follow the imports of modules, and of files beside the package, through the whole package.

        What a package's `__init__` takes from its modules counts only where it is used. A module that is not
        there is passed over.
        """
        files: set[Path] = set()
        native: set[str] = set()
        todo = [_Use(module, ALL) for module in modules]
        todo += [use for program in programs for use in self._uses(program)]
        seen: set[_Use] = set()
        while todo:
            use = todo.pop()
            if use in seen or use.module in _UNCOUNTED:
                continue
            seen.add(use)
            if use.module == NATIVE:
                native.add(use.name)
                continue
            path = self.path(use.module)
            if path is None:
                continue
            if path.name == "__init__.py" and use.name != ALL:
                origin = self._origin(use, path)
                if origin != use:
                    todo.append(origin)
                    continue
            files.add(path)
            todo += self._uses(path)
        return PythonNeeds(files=frozenset(files), native=frozenset(native))

    def path(self, module: str) -> Path | None:
        """Return the file of a module or the `__init__.py` of a package; None where there is none."""
        place = self._folder.joinpath(*module.split("."))
        for path in (place.with_suffix(".py"), place / "__init__.py"):
            if path.is_file():
                return path
        return None

    def _found_uses(self, path: Path) -> Iterator[_Use]:
        tree = _parsed(path)
        # What is imported for type checkers is not run; the names of a package's `__init__` are found apart.
        unrun = {id(node) for guard in ast.walk(tree) if _is_unrun(guard) for node in ast.walk(guard)}
        for node in (one for one in ast.walk(tree) if id(one) not in unrun):
            if isinstance(node, ast.Import):
                for one in node.names:
                    if one.name.split(".")[0] == PACKAGE:
                        yield _Use(one.name, ALL)
            elif isinstance(node, ast.ImportFrom) and _is_ours(node):
                for one in node.names:
                    yield from self._taken(str(node.module), one.name, one.asname or one.name, tree)

    def _taken(self, module: str, name: str, bound: str, tree: ast.Module) -> Iterator[_Use]:
        """Yield what `from module import name as bound` takes: of a module, what is used of it."""
        whole = f"{module}.{name}"
        if whole != NATIVE and self.path(whole) is None:
            yield _Use(module, name)
            return
        attributes = [
            node.attr
            for node in ast.walk(tree)
            if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name) and node.value.id == bound
        ]
        mentions = sum(
            isinstance(node, ast.Name) and node.id == bound and isinstance(node.ctx, ast.Load)
            for node in ast.walk(tree)
        )
        for attribute in attributes if mentions == len(attributes) else [ALL]:
            yield from self._attribute(whole, attribute)

    def _attribute(self, module: str, name: str) -> Iterator[_Use]:
        is_module = name != ALL and self.path(f"{module}.{name}") is not None
        yield _Use(f"{module}.{name}", ALL) if is_module else _Use(module, name)

    def _origin(self, use: _Use, path: Path) -> _Use:
        """Return where a package's `__init__` has a name from: the use itself where it defines the name."""
        for node in ast.walk(_parsed(path)):
            if isinstance(node, ast.ImportFrom) and _is_ours(node):
                for one in node.names:
                    if (one.asname or one.name) == use.name:
                        return next(self._attribute(str(node.module), one.name))
        return use


@functools.cache
def _parsed(path: Path) -> ast.Module:
    return ast.parse(path.read_bytes())


def _is_unrun(node: ast.AST) -> bool:
    return isinstance(node, ast.If) and isinstance(node.test, ast.Name) and node.test.id == "TYPE_CHECKING"


def _is_ours(node: ast.ImportFrom) -> bool:
    return node.module is not None and node.module.split(".")[0] == PACKAGE
