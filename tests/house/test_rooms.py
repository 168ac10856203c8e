"""Imports flow one way, and no circle exists.

Which room of the library may import which stands in pyproject.toml, `[tool.importlinter]`;
test_rust_imports.py holds the crates and their modules.
"""

import os
import re
import subprocess
import sys
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

ROOT = Path(__file__).parents[2]
PAGE = ROOT / "service" / "hybridmpm_service" / "page"


def lint(*arguments: str) -> subprocess.CompletedProcess[str]:
    """Run import-linter on library, service and laboratory."""
    path = os.pathsep.join(str(ROOT / folder) for folder in ("python", "service", "lab"))
    command = [sys.executable, "-c", "from importlinter.cli import lint_imports_command as run; run()"]
    return subprocess.run(
        [*command, "--no-cache", *arguments],
        cwd=ROOT,
        env={**os.environ, "PYTHONPATH": path},
        capture_output=True,
        text=True,
        check=False,
    )


def test_python_imports_flow_one_way_and_form_no_circle() -> None:
    run = lint()
    assert run.returncode == 0, run.stdout + run.stderr
    assert "8 kept, 0 broken" in run.stdout


def test_no_command_imports_torch_before_it_runs() -> None:
    code = (
        "import importlib, pkgutil, sys, hybridmpm.cli as cli\n"
        "for one in pkgutil.walk_packages(cli.__path__, 'hybridmpm.cli.'):\n"
        "    importlib.import_module(one.name)\n"
        "assert 'hybridmpm.cli.train.physics' in sys.modules\n"
        "assert 'torch' not in sys.modules"
    )
    environment = {**os.environ, "PYTHONPATH": str(ROOT / "python")}
    subprocess.run([sys.executable, "-c", code], env=environment, check=True)


def circles(arrows: dict[str, set[str]]) -> list[str]:
    """Return one circle of a graph, or nothing."""
    try:
        TopologicalSorter(arrows).prepare()
    except CycleError as error:
        return list(error.args[1])
    return []


def page_imports() -> dict[str, set[str]]:
    """Return for each module of the page those that it imports, by their paths in it."""
    arrows: dict[str, set[str]] = {}
    for file in PAGE.rglob("*.js"):
        named = re.findall(r"""(?:from|import)\s*\(?["'](\.[^"']+)["']""", file.read_text(encoding="utf-8"))
        targets = [(file.parent / name).resolve() for name in named]
        assert all(target.is_file() for target in targets), file
        arrows[file.relative_to(PAGE).as_posix()] = {
            target.relative_to(PAGE).as_posix() for target in targets
        }
    return arrows


def test_the_pages_modules_and_rooms_form_no_circle() -> None:
    arrows = page_imports()
    assert len(arrows) > 20
    assert sum(map(len, arrows.values())) > 30
    assert circles(arrows) == []
    rooms: dict[str, set[str]] = {}
    for module, targets in arrows.items():
        room = module.split("/")[0]
        rooms.setdefault(room, set()).update(target.split("/")[0] for target in targets)
    assert circles({room: targets - {room} for room, targets in rooms.items()}) == []


def test_a_circle_is_found() -> None:
    assert circles({"a": {"b"}, "b": {"c"}, "c": {"a"}})
    assert circles({"a": {"b", "c"}, "b": {"c"}, "c": set()}) == []
