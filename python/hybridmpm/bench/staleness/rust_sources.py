"""Which Rust files the names of the compiled module `hybridmpm._native` are built of."""

import re
import tomllib
from collections.abc import Iterable, Iterator
from pathlib import Path

from hybridmpm.bench.staleness.python_sources import ALL
from hybridmpm.errors import ConfigError

_MPM, _NEIGHBORS, _NEURAL, _GUIDANCE = "mpm", "neighbors", "neural", "guidance"

CRATES: dict[str, str | None] = {
    "BatchError": None,
    "ConfigError": None,
    "DomainError": None,
    "FrameCancelledError": None,
    "GraphSizeError": None,
    "InvertedError": None,
    "NonFiniteError": None,
    "SimulationError": None,
    "SnapshotError": None,
    "StepSizeError": None,
    "SOLVER_VERSION": None,
    "__version__": None,
    "cpu_features": None,
    "CancelFlag": _MPM,
    "Carrier": _MPM,
    "Diagnostics": _MPM,
    "Emitter": _MPM,
    "FrameReport": _MPM,
    "Material": _MPM,
    "MotionReport": _MPM,
    "Obstacle": _MPM,
    "Solver": _MPM,
    "advance_all": _MPM,
    "grid_mass": _MPM,
    "limit_instructions": _MPM,
    "RadiusGraph": _NEIGHBORS,
    "VerletList": _NEIGHBORS,
    "radius_graph": _NEIGHBORS,
    "AccelerationHistory": _NEURAL,
    "AccelerationSignal": _NEURAL,
    "answer_weights": _NEURAL,
    "relaxed": _NEURAL,
    "FreeSpace": _GUIDANCE,
    "Matching": _GUIDANCE,
    "Timing": _GUIDANCE,
    "Tracks": _GUIDANCE,
    "least_acceleration": _GUIDANCE,
    "match_to_region": _GUIDANCE,
    "hand_out_times": "threads",
}
"""Folder below rust/ of the crate that does a name's work; None where no figure depends on the name."""

_BINDINGS = "bindings"
_PATH = re.compile(r"\b(crate|super)(?=::)((?:::\w+)*)")
_SUBMODULE = re.compile(r"^(?:pub(?:\([^)]*\))? )?mod (\w+);", re.MULTILINE)


def rust_sources(folder: Path, names: Iterable[str]) -> set[Path]:
    """Return the manifests and sources of the crates behind names of `hybridmpm._native`, tests left out.

    A crate brings the crates that its manifest depends on by path. Of the bindings come the files that use
    one of the crates behind the names, and the files that these refer to.

    Parameters
    ----------
    folder : Path
        Folder that holds the crates' folders.
    names : iterable of str
        Names of the compiled module; `ALL` stands for every one.

    Raises
    ------
    ConfigError
        A name is not in `CRATES`, or the folder of its crate is missing.
    """
    crates = {folder / crate for name in names for crate in _crates(name)}
    if not crates:
        return set()
    found: set[Path] = set()
    for crate in _with_dependencies(crates):
        found |= {crate / "Cargo.toml", *_files(crate)}
    bindings = folder / _BINDINGS
    return found | {bindings / "Cargo.toml"} | _bindings(bindings, {_library(crate) for crate in crates})


def _crates(name: str) -> list[str]:
    if name != ALL and name not in CRATES:
        raise ConfigError(f"hybridmpm._native.{name} has no crate in {__name__}.CRATES; enter it there")
    behind = CRATES.values() if name == ALL else [CRATES[name]]
    return [crate for crate in behind if crate is not None]


def _with_dependencies(crates: Iterable[Path]) -> set[Path]:
    found: set[Path] = set()
    todo = list(crates)
    while todo:
        crate = todo.pop()
        if crate not in found:
            found.add(crate)
            dependencies = _manifest(crate).get("dependencies", {}).values()
            todo += [
                (crate / one["path"]).resolve()
                for one in dependencies
                if isinstance(one, dict) and "path" in one
            ]
    return found


def _manifest(crate: Path) -> dict[str, dict[str, str | dict[str, str]]]:
    try:
        return tomllib.loads((crate / "Cargo.toml").read_text(encoding="utf-8"))
    except OSError as error:
        raise ConfigError(f"{crate} holds no crate: {error.strerror or error}") from None


def _library(crate: Path) -> str:
    """Return the name by which other crates use this one."""
    manifest = _manifest(crate)
    return str(manifest.get("lib", {}).get("name") or manifest["package"]["name"]).replace("-", "_")


def _files(crate: Path) -> Iterator[Path]:
    sources = crate / "src"
    for file in sorted(sources.rglob("*.rs")):
        parts = file.relative_to(sources).with_suffix("").parts
        if not any(part == "tests" or part.endswith("_tests") for part in parts):
            yield file


def _bindings(crate: Path, libraries: Iterable[str]) -> set[Path]:
    """Return the sources of the bindings that use a library, and all that these refer to."""
    uses = re.compile(rf"\b({'|'.join(libraries)})::")
    todo = [file for file in _files(crate) if uses.search(file.read_text(encoding="utf-8"))]
    found: set[Path] = set()
    while todo:
        file = todo.pop()
        if file not in found:
            found.add(file)
            todo += _referred(file, crate / "src")
    return found


def _referred(file: Path, sources: Path) -> Iterator[Path]:
    """Yield a file's submodules, and the modules that its paths `crate::...` and `super::...` lead to."""
    text = file.read_text(encoding="utf-8")
    own = file.parent if file.stem in {"mod", "lib"} else file.with_suffix("")
    paths = [(sources if start == "crate" else own.parent, tail) for start, tail in _PATH.findall(text)]
    if file.stem != "lib":
        paths += [(own, f"::{name}") for name in _SUBMODULE.findall(text)]
    for place, tail in paths:
        known = _module(place)
        for part in tail.split("::")[1:]:
            place = place.parent if part == "super" else place / part  # noqa: PLW2901 - along the path
            deeper = _module(place)
            if deeper is None:
                break
            known = deeper
        if known is not None:
            yield known


def _module(place: Path) -> Path | None:
    """Return the file of the module that has its submodules in a folder."""
    for file in (place.with_suffix(".rs"), place / "mod.rs", place / "lib.rs"):
        if file.is_file():
            return file
    return None
