"""`write_site`: the gallery as a folder of pages that play by themselves, which any web host serves."""

import html
import json
import re
import shutil
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from importlib import resources
from pathlib import Path
from typing import Any

from hybridmpm import (
    ConfigError,
    ExportError,
    MpmSolver,
    Scene,
    __version__,
    control,
    play,
    probes,
    scenarios,
)

_GALLERY = resources.files("hybridmpm_service") / "page" / "gallery"
_SECTIONS = {"lessons": "Lessons", "scenes": "Scenes", "demos": "Control by sketches"}
"""Titles of the kinds of entries."""


@dataclass(frozen=True)
class Entry:
    """A scene or a demonstration of the gallery."""

    name: str
    """Name of its files."""
    kind: str
    """Key of its section."""
    title: str
    about: str
    """What is seen, in a sentence."""
    to_try: str
    """What a visitor can do."""
    settings: dict[str, Any]
    """What else the gallery says of it."""


def _listed() -> dict[str, Any]:
    listed: dict[str, Any] = json.loads((_GALLERY / "entries.json").read_text(encoding="utf-8"))
    return listed


def entries() -> list[Entry]:
    """Return what the gallery contains, in its order."""
    return [
        Entry(name, kind, about.pop("title"), about.pop("about"), about.pop("try"), about)
        for kind in _SECTIONS
        for name, about in _listed()[kind].items()
    ]


def write_site(
    folder: str | Path, names: Iterable[str] | None = None, on_page: Callable[[Path], object] = lambda _: None
) -> list[Path]:
    """Write a page that plays for each entry of the gallery, and an index of them with pictures.

    Parameters
    ----------
    folder : str or Path
        Folder of the site, which is made where it is missing. Files in it are replaced, and others stay.
    names : iterable of str, optional
        Names of the entries; all of them if absent.
    on_page : callable
        Called with each page that has been written.

    Returns
    -------
    list of Path
        The pages, the index first.

    Raises
    ------
    ConfigError
        The gallery has no entry of a name.
    ExportError
        The folder or a file in it cannot be written.
    """
    known = {entry.name: entry for entry in entries()}
    chosen = list(known) if names is None else list(names)
    for name in chosen:
        if name not in known:
            raise ConfigError(f"the gallery has no {name!r}; it has {', '.join(known)}")
    target = Path(folder)
    try:
        (target / "pictures").mkdir(parents=True, exist_ok=True)
        for name in chosen:
            with resources.as_file(_GALLERY / f"{name}.png") as picture:
                shutil.copy(picture, target / "pictures")
    except OSError as error:
        raise ExportError(f"cannot write {folder}: {error.strerror or error}") from error
    pages = [target / f"{name}.html" for name in chosen]
    for name, page in zip(chosen, pages, strict=True):
        _write_page(known[name], page)
        on_page(page)
    index = target / "index.html"
    index.write_text(_index([known[name] for name in chosen]), encoding="utf-8")
    on_page(index)
    return [index, *pages]


def _write_page(entry: Entry, page: Path) -> None:
    parts = [entry.about]
    if entry.kind == "lessons":
        about = entry.settings
        parts += [f"**Question:** {about['question']}", f"**Answer:** {about['answer']}", about["law"]]
    parts += [f"**Try:** {entry.to_try}", "[All scenes](index.html)"]
    text = "\n\n".join(parts)
    solver, more = _demo(entry) if entry.kind == "demos" else _scene(entry)
    play(solver, page, name=entry.title, text=text, **more)


def scene_of(name: str) -> Scene:
    """Return the scene of an entry that is one."""
    return Scene.model_validate_json((_GALLERY / f"{name}.json").read_text(encoding="utf-8"))


def _scene(entry: Entry) -> tuple[MpmSolver, dict[str, Any]]:
    gauges = {
        name: getattr(probes, kind)(**given)
        for name, probe in entry.settings.get("probes", {}).items()
        for kind, given in probe.items()
    }
    return MpmSolver(scene_of(entry.name), coarse=entry.settings.get("coarse")), {"probes": gauges}


def _demo(entry: Entry) -> tuple[MpmSolver, dict[str, Any]]:
    listed = _listed()
    played = listed["played"]
    solver = MpmSolver(scenarios.get(entry.settings["scenario"], played["seed"]))
    drawn_on = solver.copy()
    drawn_on.advance(played["frame"])
    sketch = control.parse_strokes([listed["sketches"][entry.settings["sketch"]]])
    guidance = control.prepare(drawn_on, sketch, method=played["method"], hold=played["hold"])
    return solver, {"guidance": guidance}


def _index(shown: list[Entry]) -> str:
    sections = []
    for kind, title in _SECTIONS.items():
        cards = "\n".join(_card(entry) for entry in shown if entry.kind == kind)
        if cards:
            sections.append(f"<h2>{title}</h2>\n<ul>\n{cards}\n</ul>")
    parts = {"version": __version__, "sections": "\n".join(sections)}
    template = (resources.files(__package__) / "index.html").read_text(encoding="utf-8")
    return re.sub(r"\{\{([a-z]+)\}\}", lambda place: parts[place[1]], template)


def _card(entry: Entry) -> str:
    title, about, to_try = (html.escape(text) for text in (entry.title, entry.about, entry.to_try))
    return (
        f'<li><a href="{entry.name}.html"><img src="pictures/{entry.name}.png" alt="">'
        f"<h3>{title}</h3></a><p>{about}</p><p><b>Try:</b> {to_try}</p></li>"
    )
