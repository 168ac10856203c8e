"""Candidates of a plan: methods of simulating a scene, by name."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from functools import cache, partial
from typing import Any, Literal

from hybridmpm.coarse import CoarseSimulator, coarse_table
from hybridmpm.hybrid import HybridSimulator
from hybridmpm.mpm import MpmSolver
from hybridmpm.physics.manifest import models
from hybridmpm.physics.model import NeuralModel
from hybridmpm.physics.simulator import NeuralPhysics
from hybridmpm.scene import Scene

Method = Literal["mpm", "coarse", "neural", "hybrid"]

RATIOS = {
    "1": 1.0,
    "1/1.75": 1 / 1.75,
    "1/4": 1 / 4,
    "1/8": 1 / 8,
    "1/16": 1 / 16,
    "1/32": 1 / 32,
    "1/64": 1 / 64,
}
"""r_p by label."""
SOFTER = {"1/4": 1 / 4, "1/16": 1 / 16}
"""Factors on the elastic moduli by label, for all particles at full resolution."""


@dataclass(frozen=True, kw_only=True)
class Candidate:
    """A method of simulating a scene."""

    method: Method
    """"mpm" shows the particles simulated, "coarse" all of the scene; "neural" is a network, "hybrid" a
    network with guards and MPM."""
    label: str
    """Name within its method."""
    variant: str
    """Group within its method, such as "fitted"."""
    r_p: float
    """Share of the particles that are simulated."""
    r_t: int = 1
    """Frames of a step."""
    settings: dict[str, Any] = field(default_factory=dict)
    """Settings of the simulator, besides scene, network and threads."""
    softer: float = 1.0
    """Factor on the elastic moduli of the scene."""
    model: str | None = None
    """Name of the network; None without."""

    @property
    def name(self) -> str:
        """Method and label, unique among the candidates of a scene."""
        return f"{self.method} {self.label}"

    @property
    def show_all(self) -> bool:
        """Whether all particles of the scene are shown where fewer are simulated."""
        return self.method == "coarse" or bool(self.settings.get("show_all", self.method == "hybrid"))

    def make(self, scene: Scene, threads: int = 1) -> CoarseSimulator:
        """Return a simulator of a scene at frame 0; raises as its class does."""
        if self.model is not None:
            kind: Callable[..., CoarseSimulator] = (
                NeuralPhysics if self.method == "neural" else HybridSimulator
            )
            return kind(scene, loaded(self.model, threads), threads=threads, **self.settings)
        return MpmSolver(softened(scene, self.softer), threads=threads, **self.settings)


def softened(scene: Scene, factor: float) -> Scene:
    """Return a scene whose bodies and emitters have `factor` times their elastic moduli."""
    if factor == 1:
        return scene
    soft = {
        name: tuple(
            part.model_copy(update={"material": part.material.softened(factor, scene.potential_drop)})
            for part in parts
        )
        for name, parts in (("bodies", scene.bodies), ("emitters", scene.emitters))
    }
    return scene.model_copy(update=soft)


def candidates(scenario: str) -> dict[str, Candidate]:
    """Return the candidates for scenes like those of a scenario, by name; the costly ones first."""
    return solvers() | {one.name: one for one in _learned(scenario)}


def solvers() -> dict[str, Candidate]:
    """Return the candidates that need no network, by name."""
    return {one.name: one for one in _solvers()}


def _solvers() -> Iterator[Candidate]:
    for label, r_p in RATIOS.items():
        settings = {} if r_p == 1 else {"r_p": r_p}
        yield Candidate(method="mpm", label=label, variant="plain", r_p=r_p, settings=settings)
    full = partial(Candidate, method="mpm", r_p=1.0)
    for label, factor in SOFTER.items():
        yield full(label=f"softer {label}", variant="softer", softer=factor)
    coarse = partial(Candidate, method="coarse")
    for label, r_p in RATIOS.items():
        if r_p < 1:
            yield coarse(
                label=f"unfitted {label}", variant="plain", r_p=r_p, settings={"r_p": r_p, "show_all": True}
            )
    ratios = dict(sorted(coarse_table().ratios.items(), key=lambda item: -item[1]))
    for label, r_p in ratios.items():
        yield coarse(label=label, variant="fitted", r_p=r_p, settings={"coarse": label})


def _learned(scenario: str) -> Iterator[Candidate]:
    """Yield the shipped networks that serve a scenario, and the hybrids with them."""
    for name, entry in models().items():
        if scenario in entry.scenarios:
            learned = partial(Candidate, model=name, r_p=entry.r_p, r_t=entry.r_t)
            yield learned(method="neural", label=name, variant="alone", settings={"show_all": False})
            yield learned(
                method="neural", label=f"{name} all shown", variant="all shown", settings={"show_all": True}
            )
            yield learned(method="hybrid", label=name, variant="default guards")


@cache
def loaded(model: str, threads: int) -> NeuralModel:
    """Return a network of the library, loaded once."""
    return NeuralModel.load(model, threads=threads)
