"""The origin of a measurement and its ingredients."""

import dataclasses
import datetime as dt
import hashlib
import json
import subprocess
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import onnx

import hybridmpm
from hybridmpm import SOLVER_VERSION
from hybridmpm._support.machine import cpu_model, usable_cores
from hybridmpm.errors import ConfigError
from hybridmpm_lab.harness.rows import Row

_LIBRARY = Path(hybridmpm.__file__).parent
_LEVELS = _LIBRARY / "coarse/levels.json"
_CONSTANTS = ("material", "dim", "name", "particles_per_cell", "modulus", "cfl", "affine_share", "relaxation")
"""Fields of the levels that take part in a simulation."""
_DIGITS = 12
"""Hexadecimal digits of a digest in a row."""


@cache
def shipped() -> dict[str, str]:
    """Return the digest of each fitted file of the library: networks by their names, and "levels"."""
    entries = json.loads(_LEVELS.read_text(encoding="utf-8"))["entries"]
    constants = [[entry[name] for name in _CONSTANTS] for entry in entries]
    contents = {file.stem: _without_description(file) for file in sorted(_LIBRARY.rglob("*.onnx"))}
    contents["levels"] = json.dumps(constants).encode()
    return {name: hashlib.sha256(data).hexdigest()[:_DIGITS] for name, data in contents.items()}


def _without_description(file: Path) -> bytes:
    """Return an ONNX file without its description, which is written after the network has been measured."""
    model = onnx.load(file)
    model.ClearField("metadata_props")
    kept: bytes = model.SerializeToString()
    return kept


@dataclass(frozen=True)
class Provenance:
    """Fields that every row of a result has beside its figures."""

    machine: str
    """Processor, and the number of cores that this process may use."""
    date: str
    """Date of the run, ISO 8601, UTC."""
    commit: str | None
    """Commit of the checkout, with "-dirty" where more than results differs; None outside a checkout."""
    command: str
    """Command that measures the rows again."""
    solver_version: int = SOLVER_VERSION
    """Version of the solver whose results these are."""
    ingredients: str | None = None
    """Names and digests of the fitted files that took part, as "fluids_2d=863b085e5a4d levels=..."."""

    def using(self, *names: str) -> "Provenance":
        """Return the same origin with these ingredients, of the keys of `shipped`."""
        digests = shipped()
        listed = " ".join(f"{name}={digests[name]}" for name in sorted(set(names)))
        return dataclasses.replace(self, ingredients=listed or None)

    def stamped(self, row: Row) -> Row:
        """Return a row with these fields behind its own."""
        return row | dataclasses.asdict(self)


ORIGIN = tuple(one.name for one in dataclasses.fields(Provenance))
"""Names of these fields."""


def provenance(command: str) -> Provenance:
    """Return the origin of a run of a command that starts now."""
    return Provenance(
        machine=f"{cpu_model()}, {usable_cores()} cores",
        date=dt.datetime.now(dt.UTC).date().isoformat(),
        commit=_commit(Path(__file__)),
        command=command,
    )


def gpu_model() -> str:
    """Return the name of the first GPU, as NVIDIA's driver gives it.

    Raises
    ------
    ConfigError
        There is no such driver or GPU.
    """
    try:
        query = ["nvidia-smi", "--query-gpu=name", "--format=csv,noheader"]
        found = subprocess.run(query, capture_output=True, check=True, text=True).stdout  # noqa: S603
        return found.splitlines()[0]
    except (OSError, subprocess.CalledProcessError, IndexError):
        raise ConfigError("nvidia-smi finds no GPU on this machine; choose the device cpu") from None


def has_gpu() -> bool:
    """Return whether `gpu_model` finds a GPU."""
    try:
        return bool(gpu_model())
    except ConfigError:
        return False


def outdated(row: Row) -> str | None:
    """Return which ingredient of a row is no longer the one that ships; None where all are.

    A row without `solver_version` has no known ingredients, and is outdated.
    """
    if row.get("solver_version") != SOLVER_VERSION:
        return f"solver version {row.get('solver_version')}, now {SOLVER_VERSION}"
    for ingredient in (row.get("ingredients") or "").split():
        name, _, digest = ingredient.partition("=")
        if shipped().get(name) != digest:
            return f"{name} {digest}, now {shipped().get(name, 'retired')}"
    return None


def _commit(file: Path) -> str | None:
    def git(*arguments: str) -> str:
        command = ["git", "-C", str(file.parent), *arguments]
        return subprocess.run(command, capture_output=True, check=True, text=True).stdout.strip()  # noqa: S603

    try:
        # An installed copy may lie in some other project's checkout, which does not track it.
        git("ls-files", "--error-unmatch", file.name)
        head = git("rev-parse", "--short=12", "HEAD")
        # Results of earlier measurements take no part in this one.
        but_results = ("--untracked-files=no", "--", ":(top,exclude)docs/results")
        return f"{head}-dirty" if git("status", "--porcelain", *but_results) else head
    except (OSError, subprocess.CalledProcessError):
        return None
