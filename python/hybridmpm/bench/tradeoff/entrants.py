"""The methods that the chart holds against each other, for each scenario: one committed table."""

import fnmatch
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import cache, partial
from typing import Any

from hybridmpm.bench.accuracy.conventions import LADDER
from hybridmpm.downsampling import CarryingSimulator, rung_table
from hybridmpm.errors import ConfigError
from hybridmpm.hybrid import HybridSimulator
from hybridmpm.mpm import MpmSolver, Sleep
from hybridmpm.physics.manifest import models
from hybridmpm.physics.model import NeuralModel
from hybridmpm.physics.simulator import NeuralPhysics
from hybridmpm.scene import Scene

SOFTER = {"1/4": 1 / 4, "1/16": 1 / 16}
"""Factors on the elastic moduli by label, for all particles at full resolution."""
THRESHOLDS = (0.0, 0.2, 0.4, 0.6, 0.8, 0.9)
"""r_c of the hybrids that only the cosine watches, beside checks of sound states."""
_SOUND = ("non-finite", "outside", "cosine")
_SLEEPING_RUNG = "1/16"


@dataclass(frozen=True, kw_only=True)
class Entrant:
    """A way to simulate the scenes of a scenario."""

    method: str
    """Kind of the method: "mpm", "carried", "neural" or "hybrid"."""
    label: str
    """Name among those of its method."""
    variant: str
    """What sets it apart within its method, such as "fitted"; by this points get their markers."""
    r_p: float
    """Share of the particles that it simulates."""
    make: Callable[[Scene, int], CarryingSimulator]
    """Makes a simulator at frame 0, of a scene, with a number of threads."""
    r_t: int = 1
    """Frames that it computes at once."""
    r_c: float | None = None
    """Threshold of the cosine guard; None without that guard."""

    @property
    def name(self) -> str:
        """Method and label, unique in a scenario."""
        return f"{self.method} {self.label}"


def entrants(scenario: str, patterns: Sequence[str] = ()) -> dict[str, Entrant]:
    """Return the entrants of a scenario by name, those whose names match one of the patterns.

    Raises
    ------
    ConfigError
        There are patterns, and no entrant matches; the message lists the names.
    """
    found = {one.name: one for one in (*_solvers(), *_learned(scenario))}
    chosen = {name: one for name, one in found.items() if matches(name, patterns)}
    if not chosen:
        raise ConfigError(
            f"no entrant of {scenario} matches {', '.join(patterns)}; known: {', '.join(found)}"
        )
    return chosen


def matches(name: str, patterns: Sequence[str]) -> bool:
    """Tell whether a name matches one of the patterns, or there are none."""
    return not patterns or any(fnmatch.fnmatchcase(name, pattern) for pattern in patterns)


def _solvers() -> Iterator[Entrant]:
    """Yield what is MPM throughout."""
    full = partial(Entrant, method="mpm", r_p=1.0)
    yield full(label="truth", variant="plain", make=_mpm(substeps="reference"))
    for label, r_p in LADDER.items():
        yield Entrant(method="mpm", label=label, variant="plain", r_p=r_p, make=_mpm(r_p=r_p))
    for label, factor in SOFTER.items():
        yield full(label=f"softer {label}", variant="softer", make=partial(_softer, factor))
    yield full(label="sleeping", variant="sleeping", make=_mpm(sleep=Sleep()))
    carried = partial(Entrant, method="carried")
    for label, r_p in LADDER.items():
        if r_p < 1:
            yield carried(label=label, variant="plain", r_p=r_p, make=_mpm(r_p=r_p, carry=True))
    ratios = dict(sorted(rung_table().ratios.items(), key=lambda item: -item[1]))
    for label, r_p in ratios.items():
        yield carried(label=f"fitted {label}", variant="fitted", r_p=r_p, make=_mpm(rung=label))
    yield carried(
        label=f"fitted {_SLEEPING_RUNG} sleeping",
        variant="sleeping",
        r_p=ratios[_SLEEPING_RUNG],
        make=_mpm(rung=_SLEEPING_RUNG, sleep=Sleep()),
    )


def _learned(scenario: str) -> Iterator[Entrant]:
    """Yield the shipped networks that serve a scenario, and the hybrids with them."""
    mine = {name: entry for name, entry in models().items() if scenario in entry.scenarios}
    for index, (name, entry) in enumerate(mine.items()):
        neural = partial(Entrant, method="neural", r_p=entry.r_p, r_t=entry.r_t)
        yield neural(label=name, variant="alone", make=partial(_neural, name, carry=False))
        yield neural(label=f"{name} carried", variant="carried", make=partial(_neural, name, carry=True))
        hybrid = partial(Entrant, method="hybrid", r_p=entry.r_p, r_t=entry.r_t)
        yield hybrid(label=name, variant="default guards", make=partial(_hybrid, name, {}))
        if index == 0:  # the model that the scenario gets where none is named
            for r_c in THRESHOLDS:
                settings = {"r_c": r_c, "guards": _SOUND}
                yield hybrid(
                    label=f"{name} r_c {r_c}",
                    variant="cosine",
                    r_c=r_c,
                    make=partial(_hybrid, name, settings),
                )


def _mpm(**settings: Any) -> Callable[[Scene, int], CarryingSimulator]:
    def make(scene: Scene, threads: int) -> CarryingSimulator:
        return MpmSolver(scene, threads=threads, **settings)

    return make


def _softer(factor: float, scene: Scene, threads: int) -> CarryingSimulator:
    bodies = tuple(
        body.model_copy(update={"material": body.material.softened(factor, scene.potential_drop)})
        for body in scene.bodies
    )
    return MpmSolver(scene.model_copy(update={"bodies": bodies}), threads=threads)


def _neural(model: str, scene: Scene, threads: int, *, carry: bool) -> CarryingSimulator:
    return NeuralPhysics(scene, _loaded(model, threads), carry=carry, threads=threads)


def _hybrid(model: str, settings: dict[str, Any], scene: Scene, threads: int) -> CarryingSimulator:
    return HybridSimulator(scene, _loaded(model, threads), threads=threads, **settings)


@cache
def _loaded(model: str, threads: int) -> NeuralModel:
    return NeuralModel.load(model, threads=threads)
