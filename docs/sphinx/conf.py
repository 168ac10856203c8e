"""Settings of the documentation site, which `make docs` builds by Sphinx from the repository's Markdown.

Sphinx reads Python objects with their types, checks every link, and makes a search that needs no server.
The source folder is the root of the repository, so that a page links to the same files here and on a forge.
"""

import json
import re
from pathlib import Path
from typing import Any

from docutils import nodes
from pydantic import BaseModel

import hybridmpm
from hybridmpm.scene.fields import Range
from hybridmpm_service import Settings, create_app
from hybridmpm_service.site import entries, write_site

project = "hybridmpm"
copyright = "the hybridmpm authors, Apache-2.0"  # noqa: A001 - the name that Sphinx reads
release = version = hybridmpm.__version__
root_doc = "docs/sphinx/index"
extensions = ["myst_nb", "sphinx.ext.autodoc", "sphinx.ext.napoleon", "sphinx_click", "sphinx_copybutton"]
include_patterns = ["*.md", "docs/**/*.md", "docs/**/*.ipynb", "service/deploy/README.md"]

html_theme = "furo"
html_title = f"hybridmpm {release}"
html_extra_path = ["root"]
html_static_path = ["static"]
html_css_files = ["play.css"]
# Two hyphens begin an option.
smartquotes = False
html_show_sourcelink = False
html_copy_source = False
# Summaries would be fetched, which browsers refuse to pages from a disk.
html_show_search_summary = False
html_theme_options = {"navigation_with_keys": True}

myst_heading_anchors = 4
myst_enable_extensions = ["colon_fence", "dollarmath"]
# Outputs are committed, and a test keeps them as the library's.
nb_execution_mode = "off"

autodoc_member_order = "groupwise"
autodoc_typehints = "signature"
autodoc_default_options = {"members": True, "imported-members": True, "exclude-members": "model_config"}
napoleon_google_docstring = False
napoleon_use_ivar = True
python_maximum_signature_line_length = 88
# A type that has its name in two modules is found in either.
suppress_warnings = ["ref.python"]


def _operations(_app: Any, document: nodes.document) -> None:
    """Put the table of all operations of the HTTP interface where a page asks for it."""
    for place in list(document.findall(nodes.comment)):
        if place.astext().strip() == "operations":
            place.replace_self(_table(create_app(Settings()).openapi()))


def _table(interface: dict[str, Any]) -> nodes.Node:
    rows = [("Operation", "What it does")]
    for path, operations in sorted(interface["paths"].items()):
        for method, operation in operations.items():
            rows.append((f"{method.upper()} {path}", operation["description"].partition("\n\n")[0]))
    group = nodes.tgroup("", *(nodes.colspec(colwidth=width) for width in (45, 55)), cols=2)
    lines = [
        nodes.row(
            "",
            nodes.entry("", nodes.paragraph("", "", nodes.literal(text=name) if index else nodes.Text(name))),
            nodes.entry("", nodes.paragraph(text=text.replace("`", ""))),
        )
        for index, (name, text) in enumerate(rows)
    ]
    group += nodes.thead("", lines[0])
    group += nodes.tbody("", *lines[1:])
    return nodes.table("", group)


def _playing(app: Any, document: nodes.document) -> None:
    """Put an entry of the gallery where a page has the comment `<!-- play NAME -->`, which no forge shows."""
    to_root = "../" * app.env.docname.count("/")
    titles = {entry.name: entry.title for entry in entries()}
    for place in list(document.findall(nodes.raw)):
        if found := re.fullmatch(r"<!-- play ([\w-]+) -->", place.astext().strip()):
            frame = (
                f'<iframe src="{to_root}play/{found[1]}.html" title="{titles[found[1]]}, simulated here"'
                ' loading="lazy" class="play"></iframe>'
                f'<p><a href="{to_root}play/index.html">All scenes that play</a></p>'
            )
            place.replace_self(nodes.raw("", frame, format="html"))


def _as_rest(_app: Any, _kind: str, _name: str, _object: Any, _options: Any, lines: list[str]) -> None:
    """Make what docstrings have of Markdown reStructuredText: code, bars of norms, tables."""
    text, in_table = [], False
    for line in lines:
        plain = re.sub(r"(?<!`)`([^`]+)`(?![`_])", r"``\1``", line)
        is_row = line.lstrip().startswith("|")
        if is_row and not in_table:
            text += [".. list-table::", "   :header-rows: 1", ""]
        elif in_table and not is_row:
            text.append("")
        in_table = is_row
        cells = plain.strip().strip("|").split("|")
        if not is_row:
            text.append(re.sub(r"(?<!\\)\|", r"\|", plain))
        elif not all(re.fullmatch(r"\s*:?-+:?\s*", cell) for cell in cells):
            text += [f"   {' ' if index else '*'} - {cell.strip()}" for index, cell in enumerate(cells)]
    lines[:] = text


def _fields(_app: Any, kind: str, _name: str, obj: Any, _options: Any, lines: list[str]) -> None:
    """Add the fields of a record, with their units and ranges, to its docstring."""
    if kind == "class" and issubclass(obj, BaseModel):
        for name, field in obj.model_fields.items():
            if field.description is None:
                # The kind, which the class gives.
                continue
            # A default that follows from other fields stands in the description.
            given = "optional" if field.default_factory else f"default ``{field.default!r}``"
            default = "required" if field.is_required() else given
            limits = "; ".join(str(one) for one in field.metadata if isinstance(one, Range))
            about = f"{field.description} Range {limits}." if limits else field.description
            lines += ["", f"``{name}``, {default}", f"    {about}"]


def _short(_app: Any, kind: str, _name: str, obj: Any, *_rest: Any) -> tuple[str, str] | None:
    """Return the signature of a record by the names of its fields; their types are validators."""
    if kind != "class" or not issubclass(obj, BaseModel):
        return None
    required = [name for name, field in obj.model_fields.items() if field.is_required()]
    return f"({', '.join([*required, '**fields'])})", ""


def _finish(app: Any, error: Exception | None) -> None:
    """Add the OpenAPI document, and the gallery."""
    if error is None and app.builder.format == "html":
        document = json.dumps(create_app(Settings()).openapi(), indent=1)
        (Path(app.outdir) / "openapi.json").write_text(document, encoding="utf-8")
        write_site(Path(app.outdir) / "play")


def setup(app: Any) -> None:
    """Connect what this file adds to Sphinx."""
    app.connect("autodoc-process-docstring", _as_rest)
    app.connect("autodoc-process-docstring", _fields)
    app.connect("autodoc-process-signature", _short)
    app.connect("doctree-read", _operations)
    app.connect("doctree-read", _playing)
    app.connect("build-finished", _finish)
