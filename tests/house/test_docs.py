"""The documents: their length, their links, the weight of what they show, and versions as in the code."""

import re
import subprocess
import tomllib
from pathlib import Path

import pytest

from hybridmpm import SOLVER_VERSION, MpmSolver, _core, scenarios, snapshots
from hybridmpm.control import guidance, keyframes
from hybridmpm.hybrid import simulator as hybrid
from hybridmpm.mpm import stepper
from hybridmpm.physics import simulator as physics
from hybridmpm.planner import auto

ROOT = Path(__file__).parents[2]
LENGTHS = {"README.md": 90, "ARCHITECTURE.md": 100, "CHANGELOG.md": 40}
"""Most lines of the documents that everybody reads first."""
FILMS = {".gif", ".mp4", ".webm"}
MOST = {
    "docs": 6_000_000,
    "docs films": 4_000_000,
    # 25 kB are rows of shapes and of several goals in turn; 70 of what grows, of packages, and of transport
    # and densities of coarse levels and networks; 25 of a GPU.
    "docs/results rows": 1_140_000,
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


PAGE = ROOT / "docs" / "reference" / "snapshots.md"
MAGIC = re.compile(r"HMPM[A-Z]{4}")


def expected() -> dict[str, str]:
    """Return the version of each format by its magic; without a number where the format has none."""
    solver = MpmSolver(scenarios.water_2d(0), r_p=1 / 16, show_all=True)
    joint = solver.snapshot()
    mpm, shown = stepper._parted(joint)
    assert int.from_bytes(mpm[8:12], "little") == _core.SNAPSHOT_VERSION
    assert int.from_bytes(mpm[12:16], "little") == SOLVER_VERSION
    assert int.from_bytes(shown[8:12], "little") == _core.UPSAMPLER_VERSION
    start = MpmSolver(scenarios.water_2d(0)).start_file()
    versions = {
        start[:8]: int.from_bytes(start[8:12], "little"),
        snapshots.MAGIC: snapshots.VERSION,
        mpm[:8]: _core.SNAPSHOT_VERSION,
        shown[:8]: _core.UPSAMPLER_VERSION,
        physics._MAGIC: physics._VERSION,
        hybrid._MAGIC: hybrid._VERSION,
        auto._MAGIC: auto._VERSION,
        guidance._MAGIC: guidance._VERSION,
        keyframes._MAGIC: keyframes._VERSION,
    }
    return {magic.decode(): str(version) for magic, version in versions.items()} | {
        joint[:8].decode(): "none"
    }


def rows(title: str) -> list[list[str]]:
    """Return the cells of the table below a title of the page."""
    text = PAGE.read_text(encoding="utf-8").split(f"## {title}\n", 1)[1].split("\n## ", 1)[0]
    lines = [line for line in text.splitlines() if line.startswith("|")]
    return [[cell.strip().strip("`") for cell in line.strip("|").split("|")] for line in lines[2:]]


def test_the_table_of_formats_is_that_of_the_code() -> None:
    assert {magic: version for _, magic, version in rows("Versions of formats")} == expected()


def test_no_format_of_the_code_is_missing() -> None:
    sources = [*ROOT.glob("python/hybridmpm/**/*.py"), *ROOT.glob("rust/**/*.rs")]
    found = {magic for file in sources for magic in MAGIC.findall(file.read_text(encoding="utf-8"))}
    assert found == set(expected())


def test_each_version_of_the_solver_has_its_row() -> None:
    assert [row[0] for row in rows("Versions of the solver")] == [
        str(number) for number in range(1, SOLVER_VERSION + 1)
    ]


def test_all_distributions_and_the_citation_have_one_version() -> None:
    files = [ROOT / name / "pyproject.toml" for name in ("service", "lab")]
    projects = [tomllib.loads(file.read_text("utf-8")) for file in files]
    cited = re.findall(r"^version: (.+)$", (ROOT / "CITATION.cff").read_text("utf-8"), re.MULTILINE)
    logged = re.findall(r"^## (\S+)", (ROOT / "CHANGELOG.md").read_text("utf-8"), re.MULTILINE)[:1]
    versions = [project["project"]["version"] for project in projects] + cited + logged
    assert versions == [_core.__version__] * 4
