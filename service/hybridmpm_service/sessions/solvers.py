"""Simulators of sessions: MPM, a network, or a network that MPM takes over from."""

import logging
import threading
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Literal, TypeAlias, TypeVar

from hybridmpm import Scene, SceneError, simulators
from hybridmpm.coarse import coarse_table
from hybridmpm.decisions import Mode
from hybridmpm.errors import ConfigError, DataError
from hybridmpm.physics import NeuralModel, default_model, models
from hybridmpm.physics.manifest import WEIGHTS, Entry, read_model
from hybridmpm.simulator import Kind, Simulator
from hybridmpm_service.errors import FieldError, ModelDamagedError

SafeguardKind: TypeAlias = Literal["ours", "paper"]

__all__ = [
    "ChosenSolver",
    "Kind",
    "Mode",
    "SafeguardKind",
    "SafeguardSettings",
    "SolverChoice",
    "SolverFactory",
]

_log = logging.getLogger(__name__)
T = TypeVar("T")


@dataclass(frozen=True)
class SafeguardSettings:
    """Settings of the safeguard that watches a hybrid simulator's network."""

    kind: SafeguardKind
    """Mean of the cosines that is taken: over the particles that are not calm ("ours"), or all ("paper")."""
    r_c: float | None
    """Mean cosine in [-1, 1] below which the safeguard alarms; None where other guards alone do."""


@dataclass(frozen=True, kw_only=True)
class SolverChoice:
    """Simulator that a session asks for. An option that is None takes its default.

    Raises
    ------
    FieldError
        An option belongs to another kind of simulator, or there is no such level.
    """

    solver: Kind = "mpm"
    coarse: str | None = None
    model: str | None = None
    r_c: float | None = None
    safeguard: SafeguardKind | None = None

    def __post_init__(self) -> None:
        for name in ("coarse", "model", "r_c", "safeguard"):
            if getattr(self, name) is not None and name not in simulators.settings_of(self.solver):
                takers = [kind for kind in simulators.SIMULATORS if name in simulators.settings_of(kind)]
                solvers = " and ".join(f'"{kind}"' for kind in takers)
                raise FieldError(f"body.{name}", f'belongs to the solver {solvers}, got "{self.solver}"')
        levels = coarse_table().ratios
        if self.coarse is not None and self.coarse not in levels:
            known = ", ".join(f'"{name}"' for name in levels)
            raise FieldError("body.coarse", f'must be one of {known}, got "{self.coarse}"')

    def safeguard_settings(self) -> SafeguardSettings | None:
        """Return the settings of the safeguard, defaults included; None for a simulator without one."""
        if self.solver != "hybrid":
            return None
        return SafeguardSettings(kind=self.safeguard or "ours", r_c=self.r_c)


@dataclass(frozen=True)
class ChosenSolver:
    """A simulator at frame 0, and what it was made with."""

    simulator: Simulator
    model: str | None = None
    """Name of the network; None without one."""
    safeguard: SafeguardSettings | None = None
    """Settings of the safeguard that watches the network; None without one."""
    coarse: str | None = None
    """Name of the coarse level that few particles simulate at; None where no coarse level was chosen."""
    model_sha256: str | None = None
    """SHA-256 of the network's file; None without one."""


class SolverFactory:
    """Makes the simulators of sessions, and shares loaded networks among them. Safe to use from many threads.

    Parameters
    ----------
    threads : int
        Number of threads of each simulator; the result does not depend on it.
    folder : Path
        Folder that holds the models and their manifest.

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
        """The models by name; the first that serves a scenario is its default."""
        return dict(self._models)

    def make(self, choice: SolverChoice, scene: Scene, scenario: str | None = None) -> ChosenSolver:
        """Return the chosen simulator on a scene.

        Parameters
        ----------
        choice : SolverChoice
        scene : Scene
        scenario : str, optional
            Scenario that the scene was drawn from. Where no model is chosen, it decides which one serves.

        Raises
        ------
        SceneError
            The scene cannot be filled with particles.
        FieldError
            There is no such model, or it or the coarse level was not made for such a scene.
        ModelDamagedError
            The model's file is not the one that the manifest names.
        """
        name: str | None = None
        model: NeuralModel | None = None
        if "model" in simulators.settings_of(choice.solver):
            name = choice.model or _for_option("model", lambda: self._default(scenario))
            model = self._model(name)
        simulator = _for_option(
            "model" if choice.coarse is None else "coarse",
            lambda: simulators.make(
                choice.solver,
                scene,
                coarse=choice.coarse,
                model=model,
                r_c=choice.r_c,
                safeguard=choice.safeguard,
                threads=self._threads,
            ),
        )
        return ChosenSolver(
            simulator,
            model=name,
            model_sha256=None if model is None else model.sha256,
            safeguard=choice.safeguard_settings(),
            coarse=choice.coarse,
        )

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
            return NeuralModel(data, where=f"model {name}", name=name, threads=self._threads)
        except (DataError, ConfigError) as err:
            _log.exception("model %s cannot be loaded", name)
            raise ModelDamagedError(
                f"model {name!r} cannot be loaded; the server's log has the cause. Choose another, "
                'or the solver "mpm"'
            ) from err


def _for_option(name: str, make: Callable[[], T]) -> T:
    """Call `make`, and report a ConfigError as a fault of an option, unless the scene is at fault."""
    try:
        return make()
    except SceneError:
        raise
    except ConfigError as err:
        raise FieldError(f"body.{name}", str(err)) from err
