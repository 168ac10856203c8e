"""The documents: their length, their links, and the weight of what they show."""

import re
import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
LENGTHS = {"README.md": 90, "ARCHITECTURE.md": 100, "CHANGELOG.md": 35}
"""Most lines of the documents that everybody reads first."""
FILMS = {".gif", ".mp4", ".webm"}
MOST = {
    "docs": 6_000_000,
    "docs films": 4_000_000,
    "docs/results rows": 1_000_000,
    "docs/results charts": 1_500_000,
}
"""Most bytes of the committed documents."""


def tracked(*folders: str) -> list[Path]:
    """Return the tracked files below folders, relative to the repository."""
    command = ["git", "ls-files", *folders]
    listed = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True).stdout
    return [Path(line) for line in listed.splitlines() if (ROOT / line).is_file()]


@pytest.mark.parametrize(("name", "most"), LENGTHS.items())
def test_documents_that_everybody_reads_are_short(name: str, most: int) -> None:
    assert len((ROOT / name).read_text(encoding="utf-8").splitlines()) <= most


def links(text: str) -> set[str]:
    """Return the targets of the links and pictures of a Markdown text, without addresses of the web."""
    found = re.findall(r"\]\(([^)\s]+)\)", text)
    return {target for target in found if not re.match(r"[a-z]+:", target)}


def anchors(text: str) -> set[str]:
    """Return the fragments by which the headings of a Markdown text are reached."""
    titles = re.findall(r"^#+ (.+)$", re.sub(r"```.*?```", "", text, flags=re.DOTALL), re.MULTILINE)
    plain = (
        re.sub(r"[^\w\- ]", "", re.sub(r"\[([^]]*)\]\([^)]*\)", r"\1", title)).lower() for title in titles
    )
    return {title.strip().replace(" ", "-") for title in plain}


def test_links_lead_to_files_and_headings() -> None:
    broken = []
    for file in (file for file in tracked() if file.suffix == ".md"):
        text = (ROOT / file).read_text(encoding="utf-8")
        for target in links(text):
            path, _, fragment = target.partition("#")
            there = (ROOT / file.parent / path).resolve() if path else ROOT / file
            if not there.exists():
                broken.append(f"{file}: {target}")
            elif fragment and there.suffix == ".md" and fragment not in anchors(there.read_text("utf-8")):
                broken.append(f"{file}: {target} (heading)")
    assert broken == []


def test_documents_are_light() -> None:
    sizes = dict.fromkeys(MOST, 0)
    for file in tracked("docs"):
        size = (ROOT / file).stat().st_size
        sizes["docs films" if file.suffix in FILMS else "docs"] += size
        if file.parent == Path("docs/results"):
            sizes["docs/results rows" if file.suffix == ".json" else "docs/results charts"] += (
                size if file.suffix in {".json", ".svg", ".png"} else 0
            )
    print(sizes)  # noqa: T201 - shown by `pytest -rP`
    assert {name: size for name, size in sizes.items() if size > MOST[name]} == {}


def test_every_file_of_the_documents_is_named_somewhere() -> None:
    """A picture or table that no text, code or test names is read by nobody."""
    readers = {".md", ".py", ".ipynb", ".js", ".html", ".toml", ".rs"}
    texts = [(ROOT / file).read_text("utf-8") for file in tracked() if file.suffix in readers]
    shown = [file for file in tracked("docs") if file.suffix not in {".md", ".ipynb"}]
    assert [str(file) for file in shown if not any(file.name in text for text in texts)] == []
