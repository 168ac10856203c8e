"""The learned simulators that come with the library."""

from dataclasses import dataclass
from pathlib import Path

from hybridmpm import scenarios
from hybridmpm._support.networks import NetworkFolder
from hybridmpm.errors import ConfigError, DataError

WEIGHTS = Path(__file__).parent / "weights"
"""Folder of their files."""


@dataclass(frozen=True, kw_only=True)
class Entry:
    """A model in the manifest."""

    file: str
    sha256: str
    scenarios: tuple[str, ...]
    """Scenarios in the training data."""
    r_p: float
    r_t: int
    latent: int
    layers: int
    radius: float
    """[m]."""
    parameters: int
    solver_versions: tuple[int, ...]
    """Solver versions of the training data; see `hybridmpm.SOLVER_VERSION`."""


def models(folder: Path = WEIGHTS) -> dict[str, Entry]:
    """Return the models by name, in order of preference.

    Raises
    ------
    DataError
        The manifest is missing or damaged.
    """
    found = {}
    for name, plain in NetworkFolder(folder).entries().items():
        try:
            lists = {key: tuple(plain[key]) for key in ("scenarios", "solver_versions")}
            found[name] = Entry(**{**plain, **lists})
        except (TypeError, KeyError) as error:
            raise DataError(f"the entry {name} in {folder} is damaged: {error!r}") from None
    return found


def default_model(scenario: str, folder: Path = WEIGHTS) -> str:
    """Return the name of the first model that serves a scenario.

    Raises
    ------
    UnknownScenarioError
        There is no such scenario.
    ConfigError
        No model serves it; the message lists the scenarios that are served.
    """
    scenarios.describe(scenario)
    known = models(folder)
    for name, entry in known.items():
        if scenario in entry.scenarios:
            return name
    served = sorted({name for entry in known.values() for name in entry.scenarios})
    raise ConfigError(f"no model serves {scenario}; there are models for {', '.join(served) or 'none yet'}")


def read_model(name: str, folder: Path = WEIGHTS) -> bytes:
    """Return the bytes of a model's file; errors as `NetworkFolder.read`."""
    return NetworkFolder(folder).read(name)
