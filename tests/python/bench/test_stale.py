"""A result is stale when code that it depends on computes something else since, and only then."""

import ast
import importlib
import json
import re
import subprocess
from pathlib import Path

import pytest
from click.testing import CliRunner

from hybridmpm import ConfigError
from hybridmpm.bench.catalogue import BENCHES
from hybridmpm.bench.staleness.program import program
from hybridmpm.bench.staleness.python_sources import ALL, PythonSources
from hybridmpm.bench.staleness.results import Origin, dated_results
from hybridmpm.bench.staleness.rust_sources import CRATES, rust_sources
from hybridmpm.cli import cli
from hybridmpm.cli.bench import bench

HOME = Path(__file__).parents[3]
SPEED, ERRORS = "python/hybridmpm/bench/speed.py", "python/hybridmpm/bench/errors.py"
SOLVER = "python/hybridmpm/solver.py"
SERVER = "service/hybridmpm_service/routes/stream.py"
FILES = {
    "python/hybridmpm/__init__.py": "from hybridmpm.solver import solve\n",
    SPEED: "from hybridmpm import _native, solve\n\nprint(_native.Solver, solve())\n",
    ERRORS: "from hybridmpm import _native\n\nprint(_native.radius_graph)\n",
    SOLVER: '"""Solve."""\n\nimport math\n\n\ndef solve():\n    """Add."""\n'
    "    return math.pi + 1  # so much\n",
    "python/hybridmpm/other.py": "1\n",
    "weights/net.txt": "1",
    SERVER: "from hybridmpm.other import listen\n\nlisten()\n",
    **{
        f"rust/{crate}/Cargo.toml": f'[package]\nname = "hybridmpm-{crate}"\n[lib]\nname = "{library}"\n'
        "[dependencies]\n" + "".join(f'{one} = {{ path = "../{one}" }}\n' for one in needs)
        for crate, library, needs in (
            ("mpm", "mpm", ["team"]),
            ("neighbors", "neighbors", ["team"]),
            ("team", "team", []),
            ("bindings", "_native", ["mpm", "neighbors", "team"]),
        )
    },
    "rust/mpm/src/lib.rs": "mod p2g;\n",
    "rust/mpm/src/p2g.rs": "pub fn p2g() {}\n\n#[cfg(test)]\nmod tests {\n    fn law() {}\n}\n",
    "rust/mpm/tests/laws.rs": "fn law() {}\n",
    "rust/neighbors/src/lib.rs": "pub fn search() {}\n",
    "rust/team/src/lib.rs": "pub fn run() {}\n",
    "rust/bindings/src/lib.rs": "mod convert;\nmod graph;\nmod solver;\n",
    "rust/bindings/src/convert.rs": "pub fn convert() {}\n",
    "rust/bindings/src/solver.rs": "use crate::convert::convert;\nfn solver() { mpm::p2g() }\n",
    "rust/bindings/src/graph/mod.rs": "mod rows;\nuse neighbors::search;\n",
    "rust/bindings/src/graph/rows.rs": "use super::super::convert::convert;\nfn rows() {}\n",
}
ORIGINS = {
    "speed": Origin(modules=("hybridmpm.bench.speed",)),
    "errors": Origin(modules=("hybridmpm.bench.errors",), data=("weights/*",)),
}


@pytest.fixture
def checkout(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Return a small checkout with two benchmarks and results of its first commit."""
    for variable in ("GIT_DIR", "GIT_WORK_TREE", "GIT_INDEX_FILE"):
        monkeypatch.delenv(variable, raising=False)
    git(tmp_path, "init", "-q")
    for name, text in FILES.items():
        write(tmp_path, name, text)
    commit(tmp_path)
    row = {"commit": git(tmp_path, "rev-parse", "HEAD") + "-dirty"}
    for name in ORIGINS:
        write(tmp_path, f"results/{name}.json", json.dumps([row, row]))
    return tmp_path


def git(folder: Path, *arguments: str) -> str:
    run = subprocess.run(["git", *arguments], cwd=folder, check=True, capture_output=True, text=True)
    return run.stdout.strip()


def write(folder: Path, name: str, text: str) -> None:
    (folder / name).parent.mkdir(parents=True, exist_ok=True)
    (folder / name).write_text(text)


def edit(folder: Path, name: str, old: str, new: str) -> None:
    text = (folder / name).read_text()
    assert old in text
    write(folder, name, text.replace(old, new))


def move(folder: Path, old: str, new: str) -> None:
    (folder / new).parent.mkdir(parents=True, exist_ok=True)
    git(folder, "mv", old, new)


def commit(folder: Path) -> None:
    git(folder, "add", ".")
    git(folder, "-c", "user.name=n", "-c", "user.email=e", "commit", "-qm", "m")


def changed(folder: Path) -> dict[str, tuple[str, ...]]:
    found = dated_results(folder / "results", ORIGINS)
    return {one.file.removesuffix(".json"): one.changed for one in found}


def invoke(folder: Path) -> tuple[int, str]:
    result = CliRunner().invoke(cli, ["bench", "--stale", "--results", str(folder)])
    return result.exit_code, result.output


def test_an_edit_makes_the_results_stale_that_depend_on_it(checkout: Path) -> None:
    assert changed(checkout) == {"speed": (), "errors": ()}
    edit(checkout, "python/hybridmpm/other.py", "1", "2")
    assert changed(checkout) == {"speed": (), "errors": ()}
    edit(checkout, SOLVER, "+ 1", "+ 2")
    assert changed(checkout) == {"speed": (SOLVER,), "errors": ()}
    commit(checkout)
    assert changed(checkout) == {"speed": (SOLVER,), "errors": ()}
    edit(checkout, "weights/net.txt", "1", "2")
    assert changed(checkout) == {"speed": (SOLVER,), "errors": ("weights/net.txt",)}


def test_a_program_beside_the_library_counts_with_what_it_imports(checkout: Path) -> None:
    row = json.loads((checkout / "results" / "speed.json").read_text())
    write(checkout, "results/served.json", json.dumps(row))
    origin = Origin(modules=("hybridmpm.bench.speed",), programs=("service/hybridmpm_service/**/*.py",))

    def served() -> tuple[str, ...]:
        found = dated_results(checkout / "results", ORIGINS | {"served": origin})
        return next(one.changed for one in found if one.file == "served.json")

    assert served() == ()
    edit(checkout, SERVER, "\n\nlisten()", "\n\n# Here.\nlisten()")
    assert served() == ()
    edit(checkout, "python/hybridmpm/other.py", "1", "2")
    assert served() == ("python/hybridmpm/other.py",)
    edit(checkout, SERVER, "listen()", "listen(2)")
    write(checkout, "service/hybridmpm_service/new.py", "3\n")
    assert served() == (
        "python/hybridmpm/other.py", "service/hybridmpm_service/new.py", SERVER,
    )  # fmt: skip


def test_a_move_alone_changes_nothing(checkout: Path) -> None:
    moved = "python/hybridmpm/mpm/solver.py"
    move(checkout, SOLVER, moved)
    edit(checkout, "python/hybridmpm/__init__.py", "hybridmpm.solver", "hybridmpm.mpm.solver")
    assert changed(checkout) == {"speed": (), "errors": ()}
    commit(checkout)
    move(checkout, moved, "python/hybridmpm/solving/solver.py")
    edit(checkout, "python/hybridmpm/__init__.py", "hybridmpm.mpm.solver", "hybridmpm.solving.solver")
    commit(checkout)
    assert changed(checkout) == {"speed": (), "errors": ()}


def test_a_move_with_other_prose_changes_nothing(checkout: Path) -> None:
    moved = "python/hybridmpm/mpm/solver.py"
    move(checkout, SOLVER, moved)
    edit(checkout, "python/hybridmpm/__init__.py", "hybridmpm.solver", "hybridmpm.mpm.solver")
    edit(checkout, moved, "Solve.", "\n".join(f"This is line {line} of a long text." for line in range(10)))
    commit(checkout)
    assert changed(checkout) == {"speed": (), "errors": ()}


def test_a_move_with_an_edit_counts(checkout: Path) -> None:
    moved = "python/hybridmpm/mpm/solver.py"
    move(checkout, SOLVER, moved)
    edit(checkout, "python/hybridmpm/__init__.py", "hybridmpm.solver", "hybridmpm.mpm.solver")
    edit(checkout, moved, "math.pi", "math.tau")
    assert changed(checkout) == {"speed": (moved,), "errors": ()}


def test_imports_comments_and_docstrings_do_not_count(checkout: Path) -> None:
    edit(checkout, SOLVER, "import math", "import cmath, math")
    edit(checkout, SOLVER, "# so much", "# this much")
    edit(checkout, SOLVER, "Add.", "Return a number.")
    edit(checkout, "rust/mpm/src/lib.rs", "mod p2g;", "//! The solver.\nuse team::run;\nmod p2g;")
    edit(checkout, "rust/mpm/src/p2g.rs", "fn law", "fn other_law")
    edit(checkout, "rust/mpm/tests/laws.rs", "fn law", "fn other_law")
    assert changed(checkout) == {"speed": (), "errors": ()}


def test_a_new_file_counts_if_it_computes(checkout: Path) -> None:
    new = "python/hybridmpm/new.py"
    edit(checkout, SOLVER, "import math", "import math\n\nfrom hybridmpm.new import number")
    write(checkout, new, '"""A new room."""\n\nfrom math import pi as number\n')
    write(checkout, "rust/mpm/src/grid/mod.rs", "mod layout;\npub use layout::Layout;\n")
    assert changed(checkout) == {"speed": (), "errors": ()}
    write(checkout, new, "number = 1\n")
    assert changed(checkout) == {"speed": (new,), "errors": ()}


@pytest.mark.parametrize(
    ("file", "stale"),
    [
        ("rust/mpm/src/p2g.rs", {"speed"}),
        ("rust/neighbors/src/lib.rs", {"errors"}),
        ("rust/team/src/lib.rs", {"speed", "errors"}),
        ("rust/bindings/src/solver.rs", {"speed"}),
        ("rust/bindings/src/graph/rows.rs", {"errors"}),
        ("rust/bindings/src/convert.rs", {"speed", "errors"}),
    ],
)
def test_a_result_depends_on_the_crates_that_it_uses(checkout: Path, file: str, stale: set[str]) -> None:
    write(checkout, file, (checkout / file).read_text() + "pub fn more() {}\n")
    assert changed(checkout) == {name: (file,) if name in stale else () for name in ORIGINS}


def test_of_a_manifest_counts_what_changes_the_build(checkout: Path) -> None:
    file = "rust/mpm/Cargo.toml"
    move(checkout, "rust/team", "rust/thread_pool")
    for crate in ("mpm", "neighbors", "bindings"):
        edit(checkout, f"rust/{crate}/Cargo.toml", "../team", "../thread_pool")
    assert changed(checkout) == {"speed": (), "errors": ()}
    write(checkout, file, (checkout / file).read_text() + 'wide = "1"\n')
    assert changed(checkout) == {"speed": (file,), "errors": ()}


def test_what_the_command_says(checkout: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    command = importlib.import_module("hybridmpm.cli.bench")
    monkeypatch.setattr(command, "BENCHES", ORIGINS)
    assert invoke(checkout / "results") == (0, "all 2 results are those of the present code\n")
    edit(checkout, SOLVER, "+ 1", "+ 2")
    code, text = invoke(checkout / "results")
    assert code == 0
    assert re.fullmatch(rf"speed\.json: since [0-9a-f]{{10}} changed {SOLVER}\n", text)
    for index in range(9):
        write(checkout, f"weights/{index}", "1")
    text = invoke(checkout / "results")[1]
    assert "changed weights/0, weights/1, " in text
    assert "weights/7 and 1 more\n" in text
    (checkout / SPEED).unlink()
    assert "speed.json: since" in invoke(checkout / "results")[1]
    assert changed(checkout)["speed"] == ("hybridmpm.bench.speed, which is gone",)
    monkeypatch.setattr(command, "BENCHES", {})
    assert "the list of benchmarks, which lacks this result" in invoke(checkout / "results")[1]


def test_what_is_compared_of_a_file() -> None:
    assert program("a.py", b"from x import (\n    y,\n)\ny(1)\n") == program("b.py", b"y(  1)  # call\n")
    assert program("a.py", b"y(1)") != program("a.py", b"y(2)")
    guarded = b"from typing import TYPE_CHECKING\nif TYPE_CHECKING:\n    import x\n"
    assert program("a.py", guarded) == program("a.py", b"__all__ = ['x']") == program("a.py", b"")
    assert program("a.rs", b"pub(crate) use a::{\n  b, c};\nfn f() {}") == program("a.rs", b"fn f()\n{}")
    assert program("a.rs", b"fn f() { 1 }") != program("a.rs", b"fn f() { 2 }")
    network = (HOME / "python/hybridmpm/physics/weights/fluids_2d.onnx").read_bytes()
    assert program("a.onnx", network) == program("a.onnx", network + b"\x42\x01x")
    assert program("a.onnx", network) != program("a.onnx", network + b"\x3a\x01x")
    assert program("a.txt", b"x ") != program("a.txt", b"x")


def test_what_the_benchmarks_need() -> None:
    python = PythonSources(HOME / "python")
    needs = {name: python.needed_by(origin.modules) for name, origin in BENCHES.items()}
    crates = {name: {CRATES[one] for one in need.native} - {None} for name, need in needs.items()}
    assert crates["neighbors"] == {"neighbors"}
    assert crates["stability"] == {"mpm"}
    # MPM with fewer particles clusters neighbours.
    assert crates["mpm"] == {"mpm", "neighbors"}
    assert ALL not in {one for need in needs.values() for one in need.native}
    assert crates["safeguard"] == {CRATES[name] for name in ("Solver", "radius_graph", "AccelerationHistory")}
    names = {path.name for path in needs["downsampling"].files}
    assert {"ladders.py", "timing.py", "solver.py", "grid.py", "scenarios.py", "recording.py"} < names
    assert names.isdisjoint({"provenance.py", "charts.py", "doctor.py", "constant.py"})
    assert "graph_network.py" in {path.name for path in needs["sweep"].files}
    served = [file for pattern in BENCHES["service"].programs for file in HOME.glob(pattern)]
    assert HOME / "service/hybridmpm_service/routes/stream.py" in served
    names = {path.relative_to(HOME).as_posix() for path in python.needed_by((), frozenset(served)).files}
    assert {f"python/hybridmpm/{name}" for name in ("mpm/solver.py", "scene/scene.py")} <= names
    for name, origin in BENCHES.items():
        assert all(python.path(module) for module in origin.modules), name
        assert all(list(HOME.glob(pattern)) for pattern in origin.data), name


def test_every_result_and_every_command_has_its_origin() -> None:
    # The map is an option of the command that finds the limits, thresholds and spoilt networks are methods of
    # shares, and a calibration is no result.
    assert {*BENCHES, "calibrate"} == {*bench.commands, "stability-map", "thresholds", "spoilt"}
    assert {file.stem for file in (HOME / "docs" / "results").glob("*.json")} <= set(BENCHES)


def test_every_name_of_the_compiled_module_has_its_crate() -> None:
    stub = ast.parse((HOME / "python" / "hybridmpm" / "_native.pyi").read_text())
    named = {node.name for node in stub.body if isinstance(node, ast.ClassDef | ast.FunctionDef)}
    named |= {
        node.target.id
        for node in stub.body
        if isinstance(node, ast.AnnAssign) and isinstance(node.target, ast.Name)
    }
    assert set(CRATES) == named
    for name, crate in CRATES.items():
        assert crate is None or HOME / "rust" / crate / "Cargo.toml" in rust_sources(HOME / "rust", [name])
    # No figure depends on an exception, which only ends a measurement.
    assert rust_sources(HOME / "rust", ["ConfigError"]) == set()
    with pytest.raises(ConfigError, match="unheard_of has no crate"):
        rust_sources(HOME / "rust", ["unheard_of"])
    with pytest.raises(ConfigError, match="holds no crate"):
        rust_sources(HOME / "docs", ["Solver"])


def test_bad_input_is_named(
    checkout: Path, tmp_path_factory: pytest.TempPathFactory, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(importlib.import_module("hybridmpm.cli.bench"), "BENCHES", ORIGINS)
    file = checkout / "results" / "speed.json"
    file.write_text(json.dumps([{"commit": "0" * 40}]))
    code, text = invoke(file.parent)
    assert code == 0
    assert "speed.json: since 0000000000 changed all that may have, for the history lacks this commit" in text
    file.write_text("[{}]")
    code, text = invoke(file.parent)
    assert code == 2
    assert "speed.json is damaged, or a row of it names no commit" in text
    code, text = invoke(checkout / "absent")
    assert code == 2
    assert "there is no folder" in text
    outside = tmp_path_factory.mktemp("outside")
    code, text = invoke(outside)
    assert code == 2
    assert "run this in a checkout" in text
    git(outside, "init", "-q")
    code, text = invoke(outside)
    assert code == 2
    assert "is no checkout of hybridmpm" in text


def test_without_a_command_there_is_help() -> None:
    result = CliRunner().invoke(cli, ["bench"])
    assert result.exit_code == 0
    assert "--stale" in result.output
