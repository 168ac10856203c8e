"""Simulators of sessions: MPM, a network, or a network that MPM takes over from."""

import logging
import threading
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Literal, TypeAlias, TypeVar

from hybridmpm import Scene, SceneError, simulators
from hybridmpm.decisions import Mode
from hybridmpm.errors import ConfigError, DataError
from hybridmpm.hybrid import Cosine
from hybridmpm.physics import NeuralModel, default_model, models
from hybridmpm.physics.manifest import WEIGHTS, Entry, read_model
from hybridmpm.simulator import Kind, Simulator
from hybridmpm_service.errors import FieldError, ModelDamagedError

SafeguardKind: TypeAlias = Literal["ours", "paper"]

__all__ = ["ChosenSolver", "Kind", "Mode", "SafeguardKind", "SolverChoice", "SolverFactory", "Watch"]

_log = logging.getLogger(__name__)
T = TypeVar("T")


@dataclass(frozen=True)
class Watch:
    """Settings of a safeguard."""

    kind: SafeguardKind
    """Which mean of the cosines."""
    r_c: float
    """Value below which the safeguard alarms."""


@dataclass(frozen=True, kw_only=True)
class SolverChoice:
    """Simulator that a session asks for; None where the default of an option holds.

    Raises
    ------
    FieldError
        An option belongs to another kind of simulator.
    """

    solver: Kind = "mpm"
    model: str | None = None
    r_c: float | None = None
    safeguard: SafeguardKind | None = None

    def __post_init__(self) -> None:
        for name in ("model", "r_c", "safeguard"):
            if getattr(self, name) is not None and name not in simulators.settings_of(self.solver):
                takers = [kind for kind in simulators.SIMULATORS if name in simulators.settings_of(kind)]
                solvers = " and ".join(f'"{kind}"' for kind in takers)
                raise FieldError(f"body.{name}", f'belongs to the solver {solvers}, got "{self.solver}"')

    def watch(self) -> Watch | None:
        """Return what is told about the safeguard; None for a simulator without one."""
        if "safeguard" not in simulators.settings_of(self.solver):
            return None
        usual = Cosine()
        return Watch(kind=self.safeguard or usual.safeguard, r_c=usual.r_c if self.r_c is None else self.r_c)


@dataclass(frozen=True)
class ChosenSolver:
    """A simulator at frame 0, and what it was made with."""

    simulator: Simulator
    model: str | None = None
    """Name of the network; None without one."""
    watch: Watch | None = None
    """Safeguard that watches the network; None without one."""


class SolverFactory:
    """Makes solvers. May be used by several threads.

    Parameters
    ----------
    threads : int
        Of each solver; the result does not depend on it.
    folder : Path
        Of the models and their manifest.

    Raises
    ------
    DataError
        The manifest is missing or damaged.
    """

    def __init__(self, *, threads: int, folder: Path = WEIGHTS) -> None:
        self._threads, self._folder = threads, folder
        self._models = models(folder)
        self._loaded: dict[str, NeuralModel] = {}
        self._lock = threading.Lock()

    @property
    def models(self) -> dict[str, Entry]:
        """The models by name, those to be preferred first."""
        return dict(self._models)

    def make(self, choice: SolverChoice, scene: Scene, scenario: str | None = None) -> ChosenSolver:
        """Return a simulator on a scene; `scenario`, where the scene is one's, chooses the model.

        Raises
        ------
        SceneError
            The scene cannot be filled with particles.
        FieldError
            There is no such model, or it was not made for such a scene.
        ModelDamagedError
            The model's file is not the one that the manifest names.
        """
        name: str | None = None
        model: NeuralModel | None = None
        if "model" in simulators.settings_of(choice.solver):
            name = choice.model or _for_model(lambda: self._default(scenario))
            model = self._model(name)
        simulator = _for_model(
            lambda: simulators.make(
                choice.solver,
                scene,
                model=model,
                r_c=choice.r_c,
                safeguard=choice.safeguard,
                threads=self._threads,
            )
        )
        return ChosenSolver(simulator, name, choice.watch())

    def _default(self, scenario: str | None) -> str:
        if scenario is None:
            known = ", ".join(self._models) or "none yet"
            raise FieldError("body.model", f"is required with a scene of your own; known are {known}")
        return default_model(scenario, self._folder)

    def _model(self, name: str) -> NeuralModel:
        if name not in self._models:
            known = ", ".join(self._models) or "none yet"
            raise FieldError("body.model", f"there is no model {name!r}; known are {known}")
        with self._lock:
            if name not in self._loaded:
                self._loaded[name] = self._load(name)
            return self._loaded[name]

    def _load(self, name: str) -> NeuralModel:
        try:
            data = read_model(name, self._folder)
            return NeuralModel(data, where=f"model {name}", threads=self._threads)
        except (DataError, ConfigError) as err:
            _log.exception("model %s cannot be loaded", name)
            raise ModelDamagedError(
                f"model {name!r} cannot be loaded; the server's log has the cause. Choose another, "
                'or the solver "mpm"'
            ) from err


def _for_model(make: Callable[[], T]) -> T:
    """Call, and report what is wrong as a fault of the chosen model, unless the scene itself is at fault."""
    try:
        return make()
    except SceneError:
        raise
    except ConfigError as err:
        raise FieldError("body.model", str(err)) from err
