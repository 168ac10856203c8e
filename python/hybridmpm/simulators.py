"""The three simulators by name: `make` builds one, `load` resumes one from a snapshot file."""

import inspect
from pathlib import Path
from typing import Any

from hybridmpm._support.suggestions import did_you_mean
from hybridmpm.errors import ConfigError, SnapshotError
from hybridmpm.hybrid import HybridSimulator
from hybridmpm.mpm import MpmSolver
from hybridmpm.physics import NeuralPhysics
from hybridmpm.physics.load import Model
from hybridmpm.scene import Scene
from hybridmpm.simulator import Kind, Simulator
from hybridmpm.snapshots import read_state

SIMULATORS: dict[Kind, type[MpmSolver | NeuralPhysics | HybridSimulator]] = {
    one.kind: one for one in (MpmSolver, NeuralPhysics, HybridSimulator)
}
"""Classes of the simulators by name."""


def settings_of(kind: Kind) -> frozenset[str]:
    """Return the names of the settings that a kind of simulator takes, besides the scene."""
    return frozenset(inspect.signature(SIMULATORS[kind]).parameters) - {"scene"}


def make(kind: Kind, scene: Scene, **settings: Any) -> Simulator:
    """Make a simulator by name.

    Parameters
    ----------
    kind : "mpm", "neural" or "hybrid"
    scene : Scene
    **settings
        Arguments of the class of this name; those that are None take their defaults.

    Raises
    ------
    ConfigError
        There is no such kind, a setting belongs to another kind, or the class refuses it.
    SceneError
        The scene cannot be filled with particles.
    """
    if kind not in SIMULATORS:
        listed = ", ".join(SIMULATORS)
        raise ConfigError(
            f"the simulator must be among {listed}; got {kind!r}{did_you_mean(kind, SIMULATORS)}"
        )
    given = {name: value for name, value in settings.items() if value is not None}
    for name in sorted(given.keys() - settings_of(kind)):
        takers = " and ".join(repr(other) for other in SIMULATORS if name in settings_of(other))
        raise ConfigError(f"{name} belongs to {takers or 'no simulator'}, not to {kind!r}")
    if "model" in settings_of(kind) and "model" not in given:
        raise ConfigError(f"the simulator {kind!r} needs a network: give a model")
    return SIMULATORS[kind](scene, **given)


def load(path: str | Path, *, model: Model | None = None, threads: int = 1) -> Simulator:
    """Build the simulator of any kind from a file that `Simulator.save` wrote, in the saved state.

    Parameters
    ----------
    path : str or Path
    model : str, Path or Stepper, optional
        The network, for a simulator that has one, where the file names none that is installed.
    threads : int in [1, 1024]
        May differ from before; the result does not depend on it.

    Raises
    ------
    SnapshotError
        The file is of another kind or version, damaged, or its network is missing or another.
    ConfigError
        A model is given for a simulator without a network.
    OSError
        The file cannot be read.
    """
    saved_kind = read_state(Path(path)).kind
    found = [cls for kind, cls in SIMULATORS.items() if kind == saved_kind]
    if not found:
        raise SnapshotError(f"{path} holds a simulator of kind {saved_kind!r}, unknown to this version")
    settings = {} if model is None else {"model": model}
    if model is not None and "model" not in settings_of(found[0].kind):
        raise ConfigError(
            f"{path} holds a simulator of kind {saved_kind!r}, which has no network: drop model"
        )
    return found[0].load(path, **settings, threads=threads)  # type: ignore[arg-type]
