"""Imports: public names only, declared, and locked with hashes; licences of what is compiled in."""

import ast
import importlib
import re
import subprocess
import sys
import tomllib
from collections.abc import Iterator
from itertools import chain
from pathlib import Path
from typing import Any

import pytest
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

ROOT = Path(__file__).parents[2]
ROOMS = {"python/hybridmpm": "pyproject.toml", "service/hybridmpm_service": "service/pyproject.toml"}
"""Folders of Python, and the files that declare what they import."""
DISTRIBUTIONS = {
    "markdown_it": "markdown-it-py",
    "PIL": "pillow",
    "ot": "pot",
    "pxr": "usd-core",
    "yaml": "pyyaml",
}
"""Names of distributions, by those of their packages where they differ."""
PIN = re.compile(
    r"^(?P<name>[\w.-]+)==(?P<version>\S+)( ; [^\\]+)? \\\n(    --hash=sha256:[0-9a-f]{64}( \\)?\n)+",
    re.MULTILINE,
)


def _project(file: str) -> dict[str, Any]:
    project: dict[str, Any] = tomllib.loads((ROOT / file).read_text(encoding="utf-8"))["project"]
    return project


def _imported(folder: Path) -> dict[str, str]:
    """Return the packages that the files of a folder import from elsewhere, each with one of these files."""
    found: dict[str, str] = {}
    for file in sorted(folder.rglob("*.py")):
        for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Import):
                names = [alias.name for alias in node.names]
            elif isinstance(node, ast.ImportFrom) and not node.level and node.module:
                names = [node.module]
            else:
                continue
            found.update(dict.fromkeys((name.partition(".")[0] for name in names), str(file)))
    return {name: file for name, file in found.items() if name not in sys.stdlib_module_names}


@pytest.mark.parametrize("room", ROOMS)
def test_imports_are_declared_with_a_lower_bound(room: str) -> None:
    project = _project(ROOMS[room])
    extras = chain.from_iterable(project.get("optional-dependencies", {}).values())
    declared = [Requirement(text) for text in (*project["dependencies"], *extras)]
    for one in declared:
        bounded = any(part.operator in (">=", "==", "~=") for part in one.specifier)
        assert bounded or one.name == "hybridmpm", one
    names = {canonicalize_name(one.name) for one in declared} | {canonicalize_name(Path(room).name)}
    for package, file in _imported(ROOT / room).items():
        name = canonicalize_name(DISTRIBUTIONS.get(package, package))
        assert name in names, f"{file} imports {package}, which {ROOMS[room]} does not declare"


def test_the_lock_has_hashes_and_what_serves() -> None:
    text = (ROOT / "service/requirements.txt").read_text(encoding="utf-8")
    assert "://" not in text
    pins = {canonicalize_name(found["name"]): found["version"] for found in PIN.finditer(text)}
    # Whatever is not a comment belongs to a pin with hashes.
    assert not [line for line in PIN.sub("", text).splitlines() if line.strip() and not line.startswith("#")]
    for file in ROOMS.values():
        for one in map(Requirement, _project(file)["dependencies"]):
            if one.name != "hybridmpm":
                version = pins.get(canonicalize_name(one.name))
                assert version is not None, f"{one.name} of {file} is not locked: make lock"
                assert version in one.specifier, f"{one} of {file} excludes the lock's {version}: make lock"


SERVICE = Path(__file__).parents[2] / "service" / "hybridmpm_service"


def library_imports(source: str) -> Iterator[tuple[str, str]]:
    """Yield the module and the name of each import from the library; the name is empty for whole modules."""
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Import):
            found = [(alias.name, "") for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            found = [(node.module or "", alias.name) for alias in node.names]
        else:
            continue
        yield from (one for one in found if one[0].split(".")[0] == "hybridmpm")


def is_public(module: str, name: str) -> bool:
    """Return whether an import is public by the rule above."""
    if module.count(".") > 1 or any(part.startswith("_") for part in module.split(".")):
        return False
    found = importlib.import_module(module)
    exported = getattr(found, "__all__", None)
    if not name or (exported is not None and name in exported):
        return True
    # A module in a package needs no place in its `__all__`: its own name says whether it is public.
    is_module = module == "hybridmpm" and importlib.util.find_spec(f"hybridmpm.{name}") is not None
    return not name.startswith("_") and (exported is None or is_module)


def test_the_service_imports_public_names_of_the_library_alone() -> None:
    imports = [
        (file.relative_to(SERVICE).as_posix(), *found)
        for file in SERVICE.rglob("*.py")
        for found in library_imports(file.read_text(encoding="utf-8"))
    ]
    assert len(imports) > 50
    assert [one for one in imports if not is_public(one[1], one[2])] == []


@pytest.mark.parametrize(
    ("statement", "public"),
    [
        ("import hybridmpm", True),
        ("from hybridmpm import Scene, checking", True),
        ("from hybridmpm.errors import ConfigError", True),
        ("from hybridmpm.control import Goal", True),
        ("from hybridmpm.control.goal.goal import Goal", False),
        ("from hybridmpm.control import follow, laws", False),
        ("from hybridmpm._core import CancelFlag", False),
        ("from hybridmpm.simulator import _secret", False),
    ],
)
def test_the_rule_tells_public_names_from_others(statement: str, *, public: bool) -> None:
    assert all(is_public(*one) for one in library_imports(statement)) == public


def test_the_licence_of_each_crate_in_the_module_is_in_the_wheel() -> None:
    command = ["cargo", "tree", "--locked", "--package", "hybridmpm-bindings", "--edges", "normal"]
    listed = subprocess.run(
        [*command, "--prefix", "none", "--format", "{p}"],
        cwd=ROOT,
        check=True,
        capture_output=True,
        text=True,
    ).stdout.splitlines()
    crates = {tuple(line.split()[:2]) for line in listed if not line.startswith("hybridmpm-")}
    texts = (ROOT / "rust" / "licences" / "THIRD-PARTY.txt").read_text(encoding="utf-8")
    missing = [f"{name} {version}" for name, version in crates if f"\n- {name} {version[1:]}" not in texts]
    assert missing == [], "make licences"
    assert len(crates) > 20
    assert "rust/licences/THIRD-PARTY.txt" in _project("pyproject.toml")["license-files"]
