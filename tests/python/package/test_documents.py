"""The Python and the commands of the documents run, page by page, from top to bottom."""

import json
import re
import shlex
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest
import yaml
from tests.browser.conftest import LiveService

from hybridmpm import Scene

ROOT = Path(__file__).parents[3]
BLOCK = re.compile(r"```(\w+)\n(.*?)```", re.DOTALL)
SERVICE = "docs/reference/http-api.md"


def blocks(page: str, language: str) -> list[str]:
    """Return the code of a page in a language."""
    return [code for kind, code in BLOCK.findall((ROOT / page).read_text("utf-8")) if kind == language]


PAGES = [
    str(file.relative_to(ROOT))
    for file in [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))]
    if "python" in {kind for kind, _ in BLOCK.findall(file.read_text("utf-8"))}
]


def run(*command: str, folder: Path) -> None:
    """Run a command in a folder; its last line of complaint is the failure."""
    result = subprocess.run(command, check=False, cwd=folder, capture_output=True, text=True)
    assert result.returncode == 0, result.stderr.strip().splitlines()[-1:]


def with_a_data_set(folder: Path) -> None:
    """Make the data set that the page reads, a smaller one."""
    made = "dataset generate sand_2d --trajectories 2 --out data/sand_2d"
    run(sys.executable, "-m", "hybridmpm", *made.split(), folder=folder)


def with_a_network(folder: Path) -> None:
    """Train the network of the page by its own commands, for some steps."""
    lines = [line for code in blocks("docs/guide/networks.md", "sh") for line in code.splitlines()]
    for line in lines:
        if "dam-breaks" in line and re.match("hybridmpm (train|export)", line):
            short = re.sub("--trajectories [0-9]+", "--trajectories 2", line)
            short = re.sub("--steps [0-9]+", "--steps 3", short)
            run(sys.executable, "-m", *short.split(), folder=folder)


def with_a_scene(folder: Path) -> None:
    """Write the scene of the page to the file that it reads."""
    (folder / "scene.yaml").write_text(blocks("docs/guide/scenes.md", "yaml")[0], encoding="utf-8")


BEFORE: dict[str, Callable[[Path], None]] = {
    "docs/guide/datasets.md": with_a_data_set,
    "docs/guide/networks.md": with_a_network,
    "docs/guide/scenes.md": with_a_scene,
}


def test_scene_files_of_the_guide_are_scenes() -> None:
    """Parts of a file are put into a scene of one ball."""
    ball = {"shape": "ball", "material": "water", "center": [0.5, 0.3], "radius": 0.05}
    whole = {"dim": 2, "resolution": 64, "bodies": [ball]}
    pages = sorted((ROOT / "docs" / "guide").glob("*.md"))
    files = [code for page in pages for code in blocks(str(page.relative_to(ROOT)), "yaml")]
    assert len(files) > 4
    for file in files:
        part = yaml.safe_load(file)
        assert Scene.parse(whole | part)


@pytest.mark.long
@pytest.mark.timeout(1200)
@pytest.mark.parametrize("page", [page for page in PAGES if page != SERVICE])
def test_the_python_of_a_page_runs(page: str, tmp_path: Path) -> None:
    (tmp_path / "docs").symlink_to(ROOT / "docs")
    BEFORE.get(page, lambda _: None)(tmp_path)
    run(sys.executable, "-W", "ignore", "-c", "\n".join(blocks(page, "python")), folder=tmp_path)


@pytest.mark.long
def test_the_python_of_the_service_runs(tmp_path: Path) -> None:
    with LiveService() as service:
        code = "\n".join(blocks(SERVICE, "python")).replace("http://127.0.0.1:8000", service.url)
        run(sys.executable, "-c", code, folder=tmp_path)


@pytest.mark.long
def test_the_calls_of_the_service_are_answered() -> None:
    calls = next(code for code in blocks(SERVICE, "sh") if code.startswith("curl")).splitlines()
    with LiveService() as service:
        number = ""
        for call in calls:
            here = call.replace("http://127.0.0.1:8000", service.url).replace("/ID", f"/{number}")
            words = [*shlex.split(here, comments=True), "--silent", "--fail-with-body"]
            done = subprocess.run(words, check=False, capture_output=True, text=True)
            assert done.returncode == 0, done.stdout
            number = number or json.loads(done.stdout)["id"]


SMALL = {"scenes": 4, "trajectories": 2, "steps": 3, "valid": 2, "until": 2}
"""Numbers that would let a command run for hours."""


def commands(page: str) -> list[list[str]]:
    """Return the calls of the program `hybridmpm` on a page, made small."""
    lines = [line for code in blocks(page, "sh") for line in code.splitlines()]
    text = [line.partition("  #")[0] for line in lines if line.startswith("hybridmpm ")]
    for option, number in SMALL.items():
        text = [re.sub(rf"--{option} [0-9]+", f"--{option} {number}", line) for line in text]
    return [shlex.split(line)[1:] for line in text if " serve" not in line]


@pytest.mark.long
@pytest.mark.timeout(1800)
@pytest.mark.parametrize(
    "page", [str(page.relative_to(ROOT)) for page in sorted((ROOT / "docs" / "guide").glob("*.md"))]
)
def test_the_commands_of_a_page_run(page: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    called = commands(page)
    (tmp_path / "docs").symlink_to(ROOT / "docs")
    (tmp_path / "lesson.md").write_text("# A lesson\n", encoding="utf-8")
    # The calibration stays in the folder of the test.
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    with_a_scene(tmp_path)
    for command in called:
        run(sys.executable, "-W", "ignore", "-m", "hybridmpm", *command, folder=tmp_path)
