"""Methods: ways to simulate a scene, by name."""

import fnmatch
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from hybridmpm import metrics
from hybridmpm.coarse import CoarseSimulator
from hybridmpm.errors import ConfigError
from hybridmpm.hybrid import HybridSimulator
from hybridmpm.mpm import MpmSolver
from hybridmpm.physics.free_fall import FreeFall
from hybridmpm.physics.manifest import models
from hybridmpm.physics.simulator import NeuralPhysics
from hybridmpm.physics.stepper import Stepper
from hybridmpm.physics.track import warmup_frames
from hybridmpm.planner.candidates import RATIOS, Candidate, candidates, loaded
from hybridmpm.scene import Scene

LEARNED = ("neural", "hybrid")
"""Methods with a network."""
_SOUND = ("non-finite", "outside", "cosine")


@dataclass(frozen=True, kw_only=True)
class Method:
    """A way to simulate any scene of a scenario; it can be sent to other processes."""

    method: str
    """Kind of the method: "mpm", "coarse", "neural", "hybrid", "free fall" or "peer"."""
    label: str
    """Name among those of its kind."""
    variant: str | None = None
    """Difference from others of its kind, such as "fitted"; charts have a marker for each."""
    r_p: float = 1.0
    """Share of the particles that is simulated."""
    r_t: int = 1
    """Frames that are computed at once."""
    r_c: float | None = None
    """Least cosine of a hybrid with the paper's safeguard alone."""
    make: Callable[[Scene, int], CoarseSimulator] | None = None
    """Function of a scene and a number of threads that returns a simulator at frame 0."""
    ingredients: tuple[str, ...] = ()
    """Fitted files of the library that take part; see `harness.provenance.shipped`."""

    @property
    def name(self) -> str:
        """Method and label, unique in a table."""
        return f"{self.method} {self.label}"

    def simulator(self, scene: Scene, threads: int) -> CoarseSimulator:
        """Return a simulator at frame 0; raises as its class does."""
        if self.make is None:
            raise ConfigError(f"{self.name} is no simulator of the library")
        return self.make(scene, threads)


def planned(scenario: str) -> dict[str, Method]:
    """Return all methods that a plan chooses among, by name."""
    return {name: of_candidate(one) for name, one in candidates(scenario).items()}


def of_candidate(one: Candidate) -> Method:
    """Return a candidate of the planner as a method."""
    return Method(
        method=one.method,
        label=one.label,
        variant=one.variant,
        r_p=one.r_p,
        r_t=one.r_t,
        make=one.make,
        ingredients=((one.model,) if one.model else ()) + (("levels",) if "coarse" in one.settings else ()),
    )


def truth() -> Method:
    """Return MPM with all particles at the ground truth's substeps."""
    settings = {"substeps": "reference"}
    return of_candidate(Candidate(method="mpm", label="truth", variant="plain", r_p=1.0, settings=settings))


def cosine_hybrid(model: str, r_c: float) -> Method:
    """Return a hybrid that the cosine alone guards, besides checks that the state is sound."""
    entry = models()[model]
    settings = {"r_c": r_c, "guards": _SOUND}
    return Method(
        method="hybrid",
        label=f"{model} r_c {r_c}",
        variant="cosine",
        r_p=entry.r_p,
        r_t=entry.r_t,
        r_c=r_c,
        make=partial(_make_learned, HybridSimulator, partial(_shipped, model), settings),
        ingredients=(model,),
    )


def network(name: str) -> Method:
    """Return a network alone, without the particles that it does not simulate.

    Parameters
    ----------
    name : str
        Name of a network of the library, or an ONNX file; raises as `NeuralModel.load` does.
    """
    model = loaded(name, 1)
    return Method(
        method="neural",
        label=Path(name).stem,
        variant="alone",
        r_p=model.r_p,
        r_t=model.r_t,
        make=partial(_make_learned, NeuralPhysics, partial(_shipped, name), {"show_all": False}),
        ingredients=(name,) if name in models() else (),
    )


def free_fall(r_p: float, r_t: int, *, is_guarded: bool = False) -> Method:
    """Return free fall in the place of a network, alone or in a hybrid that shows all particles."""
    kind = HybridSimulator if is_guarded else NeuralPhysics
    return Method(
        method="hybrid" if is_guarded else "free fall",
        label="free fall" if is_guarded else f"r_p {ratio_label(r_p)}, r_t {r_t}",
        r_p=r_p,
        r_t=r_t,
        make=partial(_make_learned, kind, partial(_falling, r_p, r_t), {"show_all": is_guarded}),
    )


def serving(scenario: str) -> list[str]:
    """Return the names of the networks of the library that serve a scenario, those to be preferred first."""
    return [name for name, entry in models().items() if scenario in entry.scenarios]


def warm_up(scenario: str) -> int:
    """Return the frames that MPM computes before the last of a scenario's networks can begin."""
    return max((warmup_frames(models()[name].r_t) for name in serving(scenario)), default=0)


def ratio_label(r_p: float) -> str:
    """Return the label of an r_p: that of the ladder where it is one of its levels."""
    return next((label for label, level in RATIOS.items() if abs(level - r_p) < 1e-6), f"{r_p:.3g}")


def matching(methods: Iterable[Method], patterns: Sequence[str]) -> dict[str, Method]:
    """Return the methods by name, those that match one of the shell patterns, or all without patterns.

    Raises
    ------
    ConfigError
        No name matches; the message lists the names.
    """
    known = {one.name: one for one in methods}
    chosen = {
        name: one
        for name, one in known.items()
        if not patterns or any(fnmatch.fnmatchcase(name, pattern) for pattern in patterns)
    }
    if not chosen:
        raise ConfigError(f"no method matches {', '.join(patterns)}; there are {', '.join(known)}")
    return chosen


def other_mpm(name: str, r_p: float) -> Method:
    """Return MPM with fewer particles that shows all, of the scene with other jitter."""
    return Method(method="coarse", label=name, r_p=r_p, make=partial(_jittered, r_p))


def _make_learned(
    kind: Callable[..., CoarseSimulator],
    stepper: Callable[[Scene, int], Stepper],
    settings: dict[str, object],
    scene: Scene,
    threads: int,
) -> CoarseSimulator:
    return kind(scene, stepper(scene, threads), threads=threads, **settings)


def _shipped(model: str, _scene: Scene, threads: int) -> Stepper:
    return loaded(model, threads)


def _falling(r_p: float, r_t: int, scene: Scene, _threads: int) -> Stepper:
    return FreeFall(scene.frame_dt, r_p=r_p, r_t=r_t)


def _jittered(r_p: float, scene: Scene, threads: int) -> CoarseSimulator:
    return MpmSolver(metrics.other_jitter(scene), r_p=r_p, show_all=True, threads=threads)
