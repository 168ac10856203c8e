"""Who simulates a session: MPM, a network, or a network that MPM stands in for."""

import logging
import threading
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Literal, TypeAlias, TypeVar

from hybridmpm import MpmSolver, Scene, SceneError, _native
from hybridmpm.errors import ConfigError, DataError
from hybridmpm.hybrid import Cosine, HybridSimulator
from hybridmpm.physics import NeuralModel, NeuralPhysics, default_model, models
from hybridmpm.physics.manifest import WEIGHTS, Entry, read_model
from hybridmpm.physics.track import warmup_frames
from hybridmpm_service.errors import FieldError, ModelDamagedError

Solver: TypeAlias = MpmSolver | HybridSimulator | NeuralPhysics
Kind: TypeAlias = Literal["mpm", "hybrid", "neural"]
Mode: TypeAlias = Literal["mpm", "neural"]
SafeguardKind: TypeAlias = Literal["ours", "paper"]

_log = logging.getLogger(__name__)
T = TypeVar("T")


@dataclass(frozen=True, kw_only=True)
class SolverChoice:
    """What a session is simulated by; None where the default holds.

    Raises
    ------
    FieldError
        An option belongs to another kind of solver.
    """

    solver: Kind = "mpm"
    model: str | None = None
    r_c: float | None = None
    safeguard: SafeguardKind | None = None

    def __post_init__(self) -> None:
        if self.model is not None and self.solver == "mpm":
            raise FieldError("body.model", 'belongs to the solvers "hybrid" and "neural"; "mpm" has none')
        for name in ("r_c", "safeguard"):
            if getattr(self, name) is not None and self.solver != "hybrid":
                raise FieldError(f"body.{name}", f'belongs to the solver "hybrid", got "{self.solver}"')


@dataclass(frozen=True)
class ChosenSolver:
    """A solver at frame 0, and what it was made with."""

    kind: Kind
    solver: Solver
    model: str | None = None
    safeguard: SafeguardKind | None = None


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
        """Return a solver on a scene; `scenario`, where it is one's, chooses the model.

        Raises
        ------
        SceneError
            The scene cannot be filled with particles.
        FieldError
            There is no such model, or it was not made for such a scene.
        ModelDamagedError
            The model's file is not the one that the manifest names.
        """
        if choice.solver == "mpm":
            return ChosenSolver("mpm", MpmSolver(scene, threads=self._threads))
        name = choice.model or _for_model(lambda: self._default(scenario))
        model = self._model(name)
        if choice.solver == "neural":
            neural = _for_model(lambda: NeuralPhysics(scene, model, threads=self._threads))
            return ChosenSolver("neural", neural, name)
        usual = Cosine()
        safeguard = choice.safeguard or usual.safeguard
        r_c = usual.r_c if choice.r_c is None else choice.r_c
        hybrid = _for_model(
            lambda: HybridSimulator(scene, model, r_c=r_c, safeguard=safeguard, threads=self._threads)
        )
        return ChosenSolver("hybrid", hybrid, name, safeguard)

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
    """Call, and lay what is wrong to the choice of the model, but for a scene that is no scene."""
    try:
        return make()
    except SceneError:
        raise
    except ConfigError as err:
        raise FieldError("body.model", str(err)) from err


def mode_of(solver: Solver) -> Mode:
    """Return who simulates the next frame."""
    if isinstance(solver, HybridSimulator):
        return solver.mode
    if isinstance(solver, NeuralPhysics) and solver.frame >= warmup_frames(solver.model.r_t):
        return "neural"
    return "mpm"


def ratio_of(solver: Solver) -> float:
    """Return r_p, particles over those of the scene."""
    if isinstance(solver, HybridSimulator):
        return solver.physics.r_p
    return solver.model.r_p if isinstance(solver, NeuralPhysics) else 1.0


def stride_of(solver: Solver) -> int:
    """Return r_t, the frames that a network computes at once; 1 for MPM."""
    if isinstance(solver, HybridSimulator):
        return solver.physics.r_t
    return solver.model.r_t if isinstance(solver, NeuralPhysics) else 1


def report_of(solver: Solver) -> _native.FrameReport | None:
    """Return how MPM cut the latest frame; None where a network made it, or before the first."""
    if isinstance(solver, NeuralPhysics) or solver.frame == 0:
        return None
    return solver.last_frame
