"""Simulators of sessions: MPM, a network, or a network that MPM takes over from."""

import logging
import threading
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TypeVar

from hybridmpm import Scene, SceneError, simulators
from hybridmpm.coarse import coarse_table
from hybridmpm.errors import ConfigError, DataError
from hybridmpm.physics import WEIGHTS, Entry, NeuralModel, default_model, models, read_model
from hybridmpm.simulator import Kind, Simulator
from hybridmpm_service.errors import FieldError, ModelDamagedError

_log = logging.getLogger(__name__)
T = TypeVar("T")


@dataclass(frozen=True, kw_only=True)
class SolverChoice:
    """Choice of a session's simulator. An option that is None takes its default.

    Raises
    ------
    FieldError
        An option belongs to another kind of simulator, or there is no such level.
    """

    solver: Kind = "mpm"
    coarse: str | None = None
    model: str | None = None
    r_c: float | None = None

    def __post_init__(self) -> None:
        for name in ("coarse", "model", "r_c"):
            if getattr(self, name) is not None and name not in simulators.settings_of(self.solver):
                takers = [kind for kind in simulators.SIMULATORS if name in simulators.settings_of(kind)]
                solvers = " and ".join(f'"{kind}"' for kind in takers)
                raise FieldError(f"body.{name}", f'belongs to the solver {solvers}, got "{self.solver}"')
        levels = coarse_table().ratios
        if self.coarse is not None and self.coarse not in levels:
            known = ", ".join(f'"{name}"' for name in levels)
            raise FieldError("body.coarse", f'must be one of {known}, got "{self.coarse}"')


@dataclass(frozen=True)
class ChosenSolver:
    """A simulator at frame 0, and its settings."""

    simulator: Simulator
    model: str | None = None
    """Name of the network; None without one."""
    r_c: float | None = None
    """Mean cosine in [-1, 1] below which the safeguard alarms; None where other guards alone do."""
    coarse: str | None = None
    """Name of the coarse level; None where all particles are simulated."""
    model_sha256: str | None = None
    """SHA-256 of the network's file; None without one."""


class SolverFactory:
    """Factory of the simulators of sessions, which share loaded networks. Safe to use from many threads.

    Parameters
    ----------
    threads : int
        Number of threads of each simulator; the result does not depend on it.
    folder : path
        Folder of the models and their manifest; if empty, that of the library.

    Raises
    ------
    DataError
        The manifest is missing or damaged.
    """

    def __init__(self, *, threads: int, folder: str | Path = "") -> None:
        self.threads = threads
        self.folder = Path(folder) if folder else WEIGHTS
        self._models = models(self.folder)
        self._loaded: dict[str, NeuralModel] = {}
        self._lock = threading.Lock()

    @property
    def models(self) -> dict[str, Entry]:
        """Models by name; the first that serves a scenario is its default."""
        return dict(self._models)

    def make(self, choice: SolverChoice, scene: Scene, scenario: str | None = None) -> ChosenSolver:
        """Return the chosen simulator on a scene.

        Parameters
        ----------
        choice : SolverChoice
        scene : Scene
        scenario : str, optional
            Scenario of the scene. It decides which model serves where none is chosen.

        Raises
        ------
        SceneError
            The scene cannot be filled with particles.
        FieldError
            There is no such model, or the model or coarse level does not fit the scene.
        ModelDamagedError
            The digest of the model's file differs from the manifest.
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
                threads=self.threads,
            ),
        )
        return ChosenSolver(
            simulator,
            model=name,
            model_sha256=None if model is None else model.sha256,
            r_c=choice.r_c,
            coarse=choice.coarse,
        )

    def _default(self, scenario: str | None) -> str:
        if scenario is None:
            known = ", ".join(self._models) or "none yet"
            raise FieldError("body.model", f"is required with a scene of your own; known are {known}")
        return default_model(scenario, self.folder)

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
            data = read_model(name, self.folder)
            return NeuralModel(data, where=f"model {name}", name=name, threads=self.threads)
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
