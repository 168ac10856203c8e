"""Methods: ways to simulate a scene, by name."""

import fnmatch
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from hybridmpm import metrics
from hybridmpm.coarse import CoarseSimulator
from hybridmpm.errors import ConfigError
from hybridmpm.hybrid import HybridSimulator
from hybridmpm.physics.free_fall import FreeFall
from hybridmpm.physics.manifest import models
from hybridmpm.physics.simulator import NeuralPhysics
from hybridmpm.physics.track import warmup_frames
from hybridmpm.planner.candidates import RATIOS, Candidate, candidates, loaded
from hybridmpm.scene import Scene

_SOUND = ("non-finite", "outside", "cosine")


@dataclass(frozen=True, kw_only=True)
class Method(Candidate):
    """A candidate of the planner, or a way to simulate a scene that no plan chooses.

    `method` then is "free fall", in the place of a network, or "peer", a solver of others.
    """

    method: str  # type: ignore[assignment]
    variant: str = ""
    r_p: float = 1.0
    falls: bool = False
    """Whether free fall takes the place of the network."""
    other_jitter: bool = False
    """Whether the particles have another jitter."""

    @property
    def ingredients(self) -> tuple[str, ...]:
        """Fitted files of the library that take part; see `harness.provenance.shipped`."""
        network = (self.model,) if self.model in models() else ()
        return (*network, "levels") if "coarse" in self.settings else network

    def make(self, scene: Scene, threads: int = 1) -> CoarseSimulator:
        """Return a simulator of a scene at frame 0; raises as its class does."""
        if self.falls:
            kind: Callable[..., CoarseSimulator] = (
                HybridSimulator if self.method == "hybrid" else NeuralPhysics
            )
            network = FreeFall(scene.frame_dt, r_p=self.r_p, r_t=self.r_t)
            return kind(scene, network, threads=threads, **self.settings)
        return super().make(metrics.other_jitter(scene) if self.other_jitter else scene, threads)


def planned(scenario: str) -> dict[str, Method]:
    """Return all methods that a plan chooses among, by name."""
    return {name: Method(**vars(one)) for name, one in candidates(scenario).items()}


def truth() -> Method:
    """Return MPM with all particles at the ground truth's substeps."""
    return Method(method="mpm", label="truth", variant="plain", settings={"substeps": "reference"})


def cosine_hybrid(model: str, r_c: float) -> Method:
    """Return a hybrid that the cosine alone guards, besides checks that the state is sound."""
    settings = {"r_c": r_c, "guards": _SOUND}
    return replace(
        network(model), method="hybrid", label=f"{model} r_c {r_c}", variant="cosine", settings=settings
    )


def network(name: str) -> Method:
    """Return a network of the library or of an ONNX file alone, without the particles that it leaves out.

    Raises as `NeuralModel.load` does.
    """
    model = loaded(name, 1)
    settings = {"show_all": False}
    return Method(
        method="neural",
        label=Path(name).stem,
        variant="alone",
        r_p=model.r_p,
        r_t=model.r_t,
        model=name,
        settings=settings,
    )


def free_fall(r_p: float, r_t: int, *, is_guarded: bool = False) -> Method:
    """Return free fall in the place of a network, alone or in a hybrid that shows all particles."""
    return Method(
        method="hybrid" if is_guarded else "free fall",
        label="free fall" if is_guarded else f"r_p {ratio_label(r_p)}, r_t {r_t}",
        r_p=r_p,
        r_t=r_t,
        falls=True,
        settings={"show_all": is_guarded},
    )


def other_mpm(name: str, r_p: float) -> Method:
    """Return MPM with fewer particles that shows all, of the scene with other jitter."""
    settings = {"r_p": r_p, "show_all": True}
    return Method(method="coarse", label=name, r_p=r_p, other_jitter=True, settings=settings)


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
