"""The methods of a comparison: ways to simulate a scene, by name."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

from hybridmpm import scenarios
from hybridmpm.bench.accuracy.rollouts import FIRST_SEED
from hybridmpm.mpm import MpmSolver
from hybridmpm.physics.free_fall import FreeFall, RelaxedFreeFall
from hybridmpm.physics.simulator import NeuralPhysics
from hybridmpm.physics.spec import NetworkSpec
from hybridmpm.physics.stepper import Stepper
from hybridmpm.physics.track import warmup_frames
from hybridmpm.scene import Scene
from hybridmpm.simulator import Simulator

RATIOS = {"1": 1.0, "1/1.75": 1 / 1.75, "1/4": 1 / 4, "1/8": 1 / 8, "1/16": 1 / 16}
"""r_p of networks by label."""
LADDER = {**RATIOS, "1/32": 1 / 32, "1/64": 1 / 64}
"""r_p of the rungs of MPM by label: down to where MPM is as quick as the quickest network."""

_CROWD = 100
"""Test seeds of which the one with the most particles is timed."""


@dataclass(frozen=True, kw_only=True)
class Method:
    """A way to simulate any scene of a scenario."""

    kind: str
    """"neural", "relaxed", "zero" or "mpm"."""
    label: str
    r_p: float
    r_t: int
    make: Callable[[Scene], Simulator]
    """Gives a simulator at frame 0."""
    parameters: int | None = None

    @property
    def name(self) -> str:
        """Kind and label, unique in a table."""
        return f"{self.kind} {self.label}"

    @property
    def warm_up(self) -> int:
        """Frames that MPM makes before the first prediction."""
        return 0 if self.kind == "mpm" else warmup_frames(self.r_t)


def mpm(label: str, r_p: float, *, threads: int) -> Method:
    """MPM with merged particles on a coarse grid, at CFL substeps."""
    return Method(kind="mpm", label=label, r_p=r_p, r_t=1, make=partial(MpmSolver, r_p=r_p, threads=threads))


def neural(label: str, stepper: Stepper, *, threads: int, parameters: int) -> Method:
    """Return a learned simulator."""

    def make(scene: Scene) -> NeuralPhysics:
        return NeuralPhysics(scene, stepper, threads=threads)

    return Method(
        kind="neural", label=label, r_p=stepper.r_p, r_t=stepper.r_t, make=make, parameters=parameters
    )


def zero(r_p: float, r_t: int, *, threads: int) -> Method:
    """Return free fall between walls, with the warm-up of a network."""

    def make(scene: Scene) -> NeuralPhysics:
        return NeuralPhysics(scene, FreeFall(scene.frame_dt, r_p=r_p, r_t=r_t), threads=threads)

    label = f"r_p {ratio_label(r_p)}, r_t {r_t}"
    return Method(kind="zero", label=label, r_p=r_p, r_t=r_t, make=make, parameters=0)


def relaxed(spec: NetworkSpec, *, threads: int) -> Method:
    """Return what a network does without what it learned: free fall and its relaxation of density."""
    stepper = RelaxedFreeFall(spec)
    label = f"r_p {ratio_label(spec.r_p)}, r_t {spec.r_t}, R {spec.radius:.3g}, {spec.relaxations} rounds"

    def make(scene: Scene) -> NeuralPhysics:
        return NeuralPhysics(scene, stepper, threads=threads)

    return Method(kind="relaxed", label=label, r_p=spec.r_p, r_t=spec.r_t, make=make, parameters=0)


def ratio_label(r_p: float) -> str:
    """Label of an r_p: that of the ladder if it is on it."""
    return next((label for label, rung in LADDER.items() if abs(rung - r_p) < 1e-6), f"{r_p:.3g}")


def reference_scene(scenario: str) -> Scene:
    """Return the test scene with the most particles of a hundred: latencies are taken there."""
    scenes = [scenarios.get(scenario, seed) for seed in range(FIRST_SEED, FIRST_SEED + _CROWD)]
    return max(scenes, key=lambda scene: len(scene.sample().x))
