"""The modules that a page needs at its start as one file, because each request takes a round trip.

A module becomes a function that returns its exports. Modules that are loaded on demand find the others in the
same file. It understands the forms of import and export that the page uses, and refuses others.
"""

import posixpath
import re
from collections.abc import Iterable, Mapping

_IMPORT = re.compile(r'^import (\{[^}]*\}|\* as \w+) from "(\.[^"]+)";$', re.MULTILINE)
_EXPORT = re.compile(r"^export ((?:async )?function|class|const) (\w+)", re.MULTILINE)
_ON_DEMAND = re.compile(r'\bimport\("(\.[^"]+)"\)')
_WORKER = re.compile(r'\bnew Worker\(new URL\("(\.[^"]+)", import\.meta\.url\)')
_REST = re.compile(r"^(?:import\b(?!\()|export\b).*", re.MULTILINE)


def bundled(sources: Mapping[str, str], entry: str) -> dict[str, str]:
    """Return the modules whose text is another one when those of the start are one file.

    Parameters
    ----------
    sources : mapping
        Texts of modules by their paths; none imports another in a circle.
    entry : str
        Module of the start, whose name the file has.

    Raises
    ------
    ValueError
        A module imports or exports in another form, or imports a module that is not there.
    """
    order = imported(sources, [entry])
    workers = [_target(name, one) for name, text in sources.items() for one in _WORKER.findall(text)]
    # A worker has no document: its modules stay as they are. A page may load them besides, which has to do
    # no harm: they keep nothing.
    alone = set(imported(sources, workers))
    parts = [_part(name, sources[name], set(order)) for name in order]
    exported = ", ".join(_variable(name) for name in order)
    changed = {entry: "\n".join([*parts, f"export {{ {exported} }};\n"])}
    for name in set(sources) - set(order) - alone:
        changed[name] = _late(name, sources[name], set(order), entry)
    return changed


def imported(sources: Mapping[str, str], entries: Iterable[str]) -> list[str]:
    """Return modules and all that they import, each after those that it imports itself."""
    found: dict[str, None] = {}

    def visit(name: str) -> None:
        if name in found:
            return
        if name not in sources:
            raise ValueError(f"there is no module {name}")
        for _, target in _IMPORT.findall(sources[name]):
            visit(_target(name, target))
        found[name] = None

    for entry in entries:
        visit(entry)
    return list(found)


def _part(name: str, text: str, others: set[str]) -> str:
    """Return a module as a function that is called at once."""
    text = _IMPORT.sub(lambda place: _taken(place, name), text)
    names = [exported for _, exported in _EXPORT.findall(text)]
    text = _EXPORT.sub(r"\1 \2", text)
    if rest := _REST.search(text):
        raise ValueError(f"{name}: cannot be part of one file: {rest[0]}")
    text = _ON_DEMAND.sub(lambda place: f'import("./{_target(name, place[1], but=others)}")', text)
    text = text.replace("import.meta.url", f'new URL("./{name}", import.meta.url).href')
    return f"const {_variable(name)} = (() => {{\n{text}return {{ {', '.join(names)} }};\n}})();"


def _late(name: str, text: str, others: set[str], entry: str) -> str:
    """Return a module that is loaded on demand, with the one file in place of what it imports from there."""
    file = posixpath.relpath(entry, posixpath.dirname(name) or ".")

    def found(place: re.Match[str]) -> str:
        target = _target(name, place[2])
        if target not in others:
            return place[0]
        path = file if file.startswith(".") else f"./{file}"
        return f'import {{ {_variable(target)} }} from "{path}"; {_taken(place, name)}'

    return _IMPORT.sub(found, text)


def _taken(place: re.Match[str], name: str) -> str:
    """Return the constants that an import is, where the module that it names is one."""
    what = place[1].removeprefix("* as ")
    what = re.sub(r"\b(\w+) as (\w+)", r"\1: \2", what)
    return f"const {what} = {_variable(_target(name, place[2]))};"


def _target(name: str, path: str, but: Iterable[str] = ()) -> str:
    """Return the module that another one names by a path; `but` are those that it may not name so."""
    target = posixpath.normpath(posixpath.join(posixpath.dirname(name), path))
    if target in but:
        raise ValueError(f"{name}: {target} is loaded at the start, not on demand")
    return target


def _variable(name: str) -> str:
    """Return the name of a module's exports: by its path, so that it is the same in the next version."""
    return "$" + re.sub(r"\W", "_", name.removesuffix(".js"))
