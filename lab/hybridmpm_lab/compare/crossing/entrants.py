"""Who competes in a crossing: the coarse levels of MPM, and networks, also on scenes that they refuse."""

import fnmatch
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Literal, Protocol

import numpy as np
import numpy.typing as npt

from hybridmpm.coarse import CoarseSimulator
from hybridmpm.errors import ConfigError
from hybridmpm.hybrid import HybridSimulator
from hybridmpm.physics.manifest import models
from hybridmpm.physics.model import NeuralModel
from hybridmpm.physics.simulator import NeuralPhysics
from hybridmpm.planner.candidates import Candidate, loaded, solvers
from hybridmpm.scene import Scene
from hybridmpm_lab.compare.crossing.cases import MANY, Case, CrossingSettings

_FEWEST = 60
"""Particles that a further coarse level simulates at least."""
_STIFFEST = 64
"""Largest factor by which material may be softened where it is stiffer than the scenario's."""


class Entrant(Protocol):
    """A way to simulate the scenes of a case."""

    @property
    def method(self) -> str:
        """Kind: "mpm", "coarse", "neural" or "hybrid"."""

    @property
    def label(self) -> str:
        """Name among those of its kind."""

    @property
    def name(self) -> str:
        """Kind and label."""

    @property
    def r_p(self) -> float:
        """Share of the particles that it simulates."""

    def make(self, scene: Scene, threads: int = 1) -> CoarseSimulator:
        """Return a simulator at frame 0; raises as its class does."""


class Unrefused:
    """A network of the library on any scene, at an r_p for which its particles lie as in its training.

    Parameters
    ----------
    model : NeuralModel
    r_p : float in (0, 1]
        Particles over those of the scene.
    """

    def __init__(self, model: NeuralModel, r_p: float) -> None:
        self._model, self._r_p = model, r_p

    @property
    def r_p(self) -> float:
        """Particles over those of the scene, in (0, 1]."""
        return self._r_p

    @property
    def r_t(self) -> int:
        """Frames that one step spans."""
        return self._model.r_t

    def check(self, _scene: Scene) -> None:
        """Refuse nothing."""

    def step(
        self,
        history: npt.NDArray[np.float32],
        types: npt.NDArray[np.int64],
        acceleration: npt.NDArray[np.float32],
        walls: npt.NDArray[np.float32],
    ) -> npt.NDArray[np.float32]:
        """Return positions one step later; see `Stepper.step`."""
        return self._model.step(history, types, acceleration, walls)


class Enlarged(Unrefused):
    """A network that moves the same share of the particles of a finer scene, for its latency alone.

    Its step is taken in a box that is as much larger, so that its particles have as many neighbours as in its
    training. What it answers means nothing: such a network would have to be trained.

    Parameters
    ----------
    model : NeuralModel
    finer : float
        Resolution of the scene over that of the training.
    """

    def __init__(self, model: NeuralModel, finer: float) -> None:
        super().__init__(model, model.r_p)
        self._finer = np.float32(finer)

    def step(
        self,
        history: npt.NDArray[np.float32],
        types: npt.NDArray[np.int64],
        acceleration: npt.NDArray[np.float32],
        walls: npt.NDArray[np.float32],
    ) -> npt.NDArray[np.float32]:
        """Return positions that mean nothing, after the work of a step."""
        larger = (history * self._finer, types, acceleration * self._finer, walls * self._finer)
        return super().step(*larger) / self._finer


@dataclass(frozen=True, kw_only=True)
class Learned:
    """A network of the library or a hybrid with it, carrying all particles of a scene of any resolution."""

    method: Literal["neural", "hybrid"]
    """Whether the network is alone, or guarded by MPM."""
    label: str
    """Name of the network."""
    r_p: float
    """Particles over those of the scene, so that they lie as in the training."""

    @property
    def name(self) -> str:
        """Kind and label."""
        return f"{self.method} {self.label}"

    def make(self, scene: Scene, threads: int = 1) -> CoarseSimulator:
        """Return a simulator at frame 0; raises as its class does."""
        stepper = Unrefused(loaded(self.label, threads), self.r_p)
        kind = NeuralPhysics if self.method == "neural" else HybridSimulator
        return kind(scene, stepper, threads=threads)


def entrants(case: Case, settings: CrossingSettings, particles: int) -> dict[str, Entrant]:
    """Return those who compete in a case, by name.

    Parameters
    ----------
    case : Case
    settings : CrossingSettings
    particles : int
        Particles of its largest scene. Of more than `MANY`, ways that simulate at least half of them are left
        out, but for plain MPM: they take as long, and no network errs as little.

    Raises
    ------
    ConfigError
        No name matches one of the patterns.
    """
    found: dict[str, Entrant] = {one.name: one for one in _levels(case, particles)}
    found |= {one.name: one for one in _learned(case)}
    chosen = {
        name: one
        for name, one in found.items()
        if not settings.patterns or any(fnmatch.fnmatchcase(name, one) for one in settings.patterns)
    }
    if not chosen:
        raise ConfigError(f"no method matches {', '.join(settings.patterns)}; there are {', '.join(found)}")
    return chosen


def networks(case: Case) -> list[str]:
    """Return the names of the networks that serve a case's scenario."""
    return [name for name, entry in models().items() if case.scenario in entry.scenarios]


def _levels(case: Case, particles: int) -> Iterator[Candidate]:
    for one in solvers().values():
        if particles <= MANY or one.name == "mpm 1" or one.r_p <= 0.5:
            yield one
    if case.compression is not None:
        yield Candidate(
            method="mpm", label=f"softer 1/{_STIFFEST}", variant="softer", r_p=1.0, softer=1 / _STIFFEST
        )
    fewer = 128
    while particles / fewer >= _FEWEST and case.finer > 1:
        settings = {"r_p": 1 / fewer, "show_all": True}
        yield Candidate(
            method="coarse", label=f"1/{fewer}", variant="plain", r_p=1 / fewer, settings=settings
        )
        fewer *= 2


def _learned(case: Case) -> Iterator[Learned]:
    dim = case.scene(0).dim
    for name in networks(case):
        r_p = min(1.0, models()[name].r_p / case.finer**dim)
        yield Learned(method="neural", label=name, r_p=r_p)
        yield Learned(method="hybrid", label=name, r_p=r_p)
