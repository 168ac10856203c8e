"""The methods of a comparison: ways to simulate a scene, by name."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial

from hybridmpm import scenarios
from hybridmpm.mpm import MpmSolver
from hybridmpm.physics.free_fall import FreeFall, RelaxedFreeFall
from hybridmpm.physics.simulator import NeuralPhysics
from hybridmpm.physics.spec import NetworkSpec
from hybridmpm.physics.stepper import Stepper
from hybridmpm.physics.track import warmup_frames
from hybridmpm.planner.calibrating.impact import first_frame
from hybridmpm.scene import Scene
from hybridmpm.simulator import Simulator
from hybridmpm_lab.compare.accuracy.conventions import FIRST_SEED, ratio_label
from hybridmpm_lab.compare.accuracy.latency import Latency, Timing, latencies_by_turns

_CROWD = 100
"""Number of test scenes of which the one with the most particles is timed."""


@dataclass(frozen=True, kw_only=True)
class Method:
    """A way to simulate any scene of a scenario."""

    kind: str
    """Kind of the method: "neural", "relaxed", "zero" or "mpm"."""
    label: str
    """Name of the method among those of its kind."""
    r_p: float
    """Share of the particles that it simulates."""
    r_t: int
    """Frames that it computes at once."""
    make: Callable[[Scene], Simulator]
    """Makes a simulator at frame 0."""
    parameters: int | None = None
    """Number of parameters of a network; None of MPM."""

    @property
    def name(self) -> str:
        """Kind and label of the method, unique in a table."""
        return f"{self.kind} {self.label}"

    @property
    def warm_up(self) -> int:
        """Frames that MPM computes before the method's first prediction."""
        return 0 if self.kind == "mpm" else warmup_frames(self.r_t)


def mpm(label: str, r_p: float, *, threads: int) -> Method:
    """Return MPM with merged particles on a coarse grid, at CFL substeps."""
    return Method(kind="mpm", label=label, r_p=r_p, r_t=1, make=partial(MpmSolver, r_p=r_p, threads=threads))


def neural(label: str, stepper: Stepper, *, threads: int, parameters: int) -> Method:
    """Return a learned simulator."""

    def make(scene: Scene) -> NeuralPhysics:
        return NeuralPhysics(scene, stepper, show_all=False, threads=threads)

    return Method(
        kind="neural", label=label, r_p=stepper.r_p, r_t=stepper.r_t, make=make, parameters=parameters
    )


def zero(r_p: float, r_t: int, *, threads: int) -> Method:
    """Return free fall between walls, with the particles and the warm-up of a network."""

    def make(scene: Scene) -> NeuralPhysics:
        return NeuralPhysics(
            scene, FreeFall(scene.frame_dt, r_p=r_p, r_t=r_t), show_all=False, threads=threads
        )

    label = f"r_p {ratio_label(r_p)}, r_t {r_t}"
    return Method(kind="zero", label=label, r_p=r_p, r_t=r_t, make=make, parameters=0)


def relaxed(spec: NetworkSpec, *, threads: int) -> Method:
    """Return a network without what it learned: free fall, and the network's relaxation of density."""
    stepper = RelaxedFreeFall(spec)
    label = f"r_p {ratio_label(spec.r_p)}, r_t {spec.r_t}, R {spec.radius:.3g}, {spec.relaxations} rounds"

    def make(scene: Scene) -> NeuralPhysics:
        return NeuralPhysics(scene, stepper, show_all=False, threads=threads)

    return Method(kind="relaxed", label=label, r_p=spec.r_p, r_t=spec.r_t, make=make, parameters=0)


def reference_scene(scenario: str) -> Scene:
    """Return the scene for latencies: of a hundred test scenes that with the most particles."""
    scenes = [scenarios.get(scenario, seed) for seed in range(FIRST_SEED, FIRST_SEED + _CROWD)]
    return max(scenes, key=lambda scene: len(scene.sample().x))


def method_latencies(
    methods: Sequence[Method],
    scenario: str,
    *,
    earliest: int,
    span: int,
    passes: int = 2,
    seconds: float = 5.0,
) -> dict[str, Latency | None]:
    """Time methods by turns over a rollout of the scenario's reference scene.

    Parameters
    ----------
    methods : sequence of Method
    scenario : str
    earliest, span : int
        Timed are the `span` frames after `first_frame(scene, earliest)`.
    passes : int
        Number of rollouts.
    seconds : float
        Time for the timed calls of a method beyond its first three [s].

    Returns
    -------
    dict
        Latency by the method's name; None where the method failed too early.
    """
    scene = reference_scene(scenario)
    found = latencies_by_turns(
        [Timing(one.make(scene), one.r_t) for one in methods],
        start=first_frame(scene, earliest),
        span=span,
        passes=passes,
        seconds=seconds,
    )
    return dict(zip((one.name for one in methods), found, strict=True))
