"""The models that come with the library: a manifest with the digest of each file."""

import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Self

from hybridmpm import scenarios
from hybridmpm._support.files import read_checked
from hybridmpm._support.suggestions import did_you_mean
from hybridmpm.errors import ConfigError, DataError

WEIGHTS = Path(__file__).parent / "weights"
_MANIFEST = "manifest.json"


@dataclass(frozen=True, kw_only=True)
class Entry:
    """A model of the manifest."""

    file: str
    sha256: str
    scenarios: tuple[str, ...]
    """Whose scenes it serves."""
    r_p: float
    r_t: int
    latent: int
    layers: int
    radius: float
    """[m]."""
    parameters: int
    solver_versions: tuple[int, ...]
    """Of the solvers that made its data; see `hybridmpm.SOLVER_VERSION`."""

    @classmethod
    def from_dict(cls, data: Mapping[str, Any]) -> Self:
        """Read what `dataclasses.asdict` gives."""
        lists = {key: tuple(data[key]) for key in ("scenarios", "solver_versions")}
        return cls(**{**data, **lists})


def models(folder: Path = WEIGHTS) -> dict[str, Entry]:
    """Return the models by name, those to be preferred first.

    Raises
    ------
    DataError
        The manifest is missing or damaged.
    """
    path = folder / _MANIFEST
    try:
        plain = json.loads(path.read_text(encoding="utf-8"))
        return {name: Entry.from_dict(entry) for name, entry in plain.items()}
    except (OSError, ValueError, TypeError, KeyError, AttributeError) as error:
        raise DataError(f"{path} is missing or damaged: {error!r}; install the library anew") from None


def default_model(scenario: str, folder: Path = WEIGHTS) -> str:
    """Return the name of the first model that serves a scenario.

    Raises
    ------
    UnknownScenarioError
        There is no such scenario.
    ConfigError
        No model serves it; the message lists what the models serve.
    """
    scenarios.describe(scenario)
    known = models(folder)
    for name, entry in known.items():
        if scenario in entry.scenarios:
            return name
    served = sorted({name for entry in known.values() for name in entry.scenarios})
    raise ConfigError(f"no model serves {scenario}; there are models for {', '.join(served) or 'none yet'}")


def read_model(name: str, folder: Path = WEIGHTS) -> bytes:
    """Return the bytes of a model's file, once its digest has been checked.

    Raises
    ------
    ConfigError
        There is no model of this name; the message lists the names.
    DataError
        The file is missing, or is not the one that the manifest names: the message has both digests.
    """
    known = models(folder)
    if name not in known:
        listed = ", ".join(known) or "none yet"
        raise ConfigError(f"there is no model {name!r}; known are {listed}{did_you_mean(name, known)}")
    return read_checked(folder / known[name].file, known[name].sha256)


def write_entry(name: str, entry: Entry, folder: Path = WEIGHTS) -> None:
    """Add a model to the manifest, or replace the one of this name in its place."""
    entries = {key: asdict(value) for key, value in models(folder).items()} | {name: asdict(entry)}
    (folder / _MANIFEST).write_text(json.dumps(entries, indent=1) + "\n", encoding="utf-8")
