"""Imports of Python, of the page and of Rust flow one way, and no circle exists."""

import os
import re
import subprocess
import sys
import tomllib
from collections.abc import Iterator, Mapping
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

import pytest

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


def _source(module: Path) -> Path:
    """Return the file of a module of the page; that of rigid bodies is the library's."""
    modules = PAGE / "modules"
    return ROOT / "python/hybridmpm/playing" / module.name if module.parent == modules else module


def page_imports() -> dict[str, set[str]]:
    """Return for each module of the page those that it imports, by their paths in it."""
    arrows: dict[str, set[str]] = {}
    for file in PAGE.rglob("*.js"):
        named = re.findall(r"""(?:from|import)\s*\(?["'](\.[^"']+)["']""", file.read_text(encoding="utf-8"))
        targets = [(file.parent / name).resolve() for name in named]
        assert all(target.is_file() for target in map(_source, targets)), file
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


RUST = Path(__file__).parents[2] / "rust"
DEPENDS_ON = {
    "bindings": {"guidance", "mpm", "neighbors", "neural", "threads"},
    "guidance": {"threads"},
    "mpm": {"rigid", "threads"},
    "neighbors": {"threads"},
    "neural": set(),
    "rigid": set(),
    "threads": set(),
    "web": {"guidance", "mpm"},
}
"""The crates of this project that each one may use."""

Module = tuple[str, ...]
"""Names of the modules from the root of a crate; the root itself is ()."""

_TEST_MODULE = re.compile(r"^#\[cfg\(test\)\]\nmod (\w+)(?:;| \{\n.*?^\})", re.MULTILINE | re.DOTALL)
_INLINE_MODULE = re.compile(r"^mod \w+ \{\n.*?^\}", re.MULTILINE | re.DOTALL)
_COMMENT_OR_TEXT = re.compile(r"//[^\n]*|\"(?:\\.|[^\"\\])*\"")
_USE = re.compile(r"^ *(pub(?:\(\w+\))? )?use ([^;]+);", re.MULTILINE)
_PATH = re.compile(r"(?<![\w:])\w+(?:::\w+)+")


class Crate:
    """Modules of a crate, what each re-exports and which paths each names."""

    def __init__(self, folder: Path) -> None:
        texts = {_module(file.relative_to(folder / "src")): file.read_text() for file in _sources(folder)}
        tests = {(*module, name) for module, text in texts.items() for name in _TEST_MODULE.findall(text)}
        self.texts = {
            module: _COMMENT_OR_TEXT.sub("", _TEST_MODULE.sub("", text))
            for module, text in texts.items()
            if module not in tests
        }
        self.exports: dict[Module, dict[str, Module]] = {module: {} for module in self.texts}
        for module, text in self.texts.items():
            for public, tree in _USE.findall(text):
                for path in _paths(tree) if public else ():
                    self.exports[module][path[-1]] = path

    def arrows(self) -> dict[Module, set[Module]]:
        """Return for each module those that define what it uses, itself left out."""
        return {module: set(self._used_by(module)) - {module} for module in self.texts}

    def _used_by(self, module: Module) -> Iterator[Module]:
        text = self.texts[module]
        inner = _INLINE_MODULE.findall(text)
        for depth, part in ((0, _INLINE_MODULE.sub("", text)), (1, "\n".join(inner))):
            private = [path for public, tree in _USE.findall(part) if not public for path in _paths(tree)]
            named = [tuple(path.split("::")) for path in _PATH.findall(_USE.sub("", part))]
            for path in (*private, *named):
                found = self._resolve(module, path, depth)
                if found is not None:
                    yield found

    def _resolve(self, module: Module, path: Module, depth: int = 0) -> Module | None:
        """Return the module that defines what a path in `module` ends at, None if it is another crate's."""
        if path[0] == "crate":
            module = ()
        elif path[0] == "super":
            ups = next((k for k, name in enumerate(path) if name != "super"), len(path))
            # In an inline module the first `super` is the file around it.
            module = module[: len(module) + depth - ups]
            path = path[ups - 1 :]
        elif path[0] != "self":
            if depth or (*module, path[0]) not in self.texts:
                return None
            path = ("self", *path)
        rest = list(path[1:])
        while rest and (*module, rest[0]) in self.texts:
            module = (*module, rest.pop(0))
        if rest and rest[0] in self.exports[module]:
            return self._resolve(module, self.exports[module][rest[0]])
        return module


def _sources(crate: Path) -> list[Path]:
    return sorted((crate / "src").rglob("*.rs"))


def _module(file: Path) -> Module:
    names = file.with_suffix("").parts
    return names[:-1] if names[-1] in {"mod", "lib"} else names


def _paths(tree: str) -> Iterator[Module]:
    """Yield the paths of a `use`, those in braces one by one."""
    prefix, brace, inside = re.sub(r"\s+", " ", tree).strip().partition("{")
    if not brace:
        yield tuple(prefix.split(" as ", maxsplit=1)[0].split("::"))
        return
    level, item = 0, ""
    for letter in inside.rstrip().removesuffix("}") + ",":
        level += (letter == "{") - (letter == "}")
        if letter == "," and level == 0:
            if item.strip():
                yield from _paths(prefix + item.strip())
            item = ""
        else:
            item += letter


def _rooms(arrows: Mapping[Module, set[Module]]) -> dict[Module, set[Module]]:
    """Join the modules below each child of the root."""
    rooms: dict[Module, set[Module]] = {}
    for module, targets in arrows.items():
        rooms.setdefault(module[:1], set()).update(target[:1] for target in targets)
    return {room: targets - {room} for room, targets in rooms.items()}


def _circle(arrows: Mapping[Module, set[Module]]) -> str | None:
    try:
        TopologicalSorter(arrows).prepare()
    except CycleError as error:
        return " <- ".join("::".join(module) or "lib" for module in error.args[1])
    return None


@pytest.mark.parametrize("crate", sorted(DEPENDS_ON))
def test_modules_of_a_crate_form_no_circle(crate: str) -> None:
    arrows = Crate(RUST / crate).arrows()
    assert _circle(arrows) is None
    assert _circle(_rooms(arrows)) is None


def test_crates_depend_on_each_other_in_one_direction() -> None:
    manifests = {file.parent.name: tomllib.loads(file.read_text()) for file in RUST.glob("*/Cargo.toml")}
    found = {
        crate: {Path(entry["path"]).name for entry in manifest["dependencies"].values() if "path" in entry}
        for crate, manifest in manifests.items()
    }
    assert found == DEPENDS_ON
    TopologicalSorter(DEPENDS_ON).prepare()


def _write(folder: Path, files: dict[str, str]) -> Crate:
    for name, text in files.items():
        file = folder / "src" / name
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text(text)
    return Crate(folder)


ROOMS = {
    "lib.rs": "mod a;\nmod b;\n\npub use a::One;\n",
    "a/mod.rs": "mod one;\nmod two;\n\npub use one::{One, SIZE};\npub(crate) use two::Two;\n",
    "a/one.rs": "pub const SIZE: usize = 1;\n#[cfg(test)]\nmod tests {\n    use crate::b::B;\n}\n",
    "a/two.rs": "// crate::b::B\nuse super::one::One;\n",
    "b.rs": "use crate::a::{One, Two};\n",
}


def test_facades_comments_and_tests_make_no_circle(tmp_path: Path) -> None:
    arrows = _write(tmp_path, ROOMS).arrows()
    one, two = ("a", "one"), ("a", "two")
    assert arrows == {(): set(), ("a",): set(), one: set(), two: {one}, ("b",): {one, two}}


@pytest.mark.parametrize(
    ("file", "text"),
    [
        ("a/one.rs", "use super::Two;\n"),
        ("a/one.rs", "fn f(two: &crate::a::two::Two) {}\n"),
        ("a/one.rs", "mod wide {\n    use super::super::two::Two;\n}\n"),
    ],
)
def test_a_circle_of_files_is_found(tmp_path: Path, file: str, text: str) -> None:
    assert _circle(_write(tmp_path, ROOMS | {file: text}).arrows()) is not None


def test_a_circle_of_rooms_is_found_where_files_have_none(tmp_path: Path) -> None:
    back = {"a/two.rs": "use crate::b::B;\n", "b.rs": "use crate::a::One;\n"}
    arrows = _write(tmp_path, ROOMS | back).arrows()
    assert _circle(arrows) is None
    assert _circle(_rooms(arrows)) is not None
