"""Networks that answer what a test wants."""

from collections.abc import Callable
from typing import ClassVar

import numpy as np
import numpy.typing as npt
import pytest

from hybridmpm import Ball, Box, ConfigError, MpmSolver, Scene

Floats = npt.NDArray[np.float32]
Answer = Callable[[Floats, Floats], Floats]
"""Takes history (6, N, D) and known acceleration (N, D), returns positions (N, D)."""


class Fake:
    """A network that is one function."""

    HISTORY: ClassVar[int] = 6

    def __init__(self, answer: Answer, r_p: float, r_t: int) -> None:
        self.r_p, self.r_t, self._answer = r_p, r_t, answer
        self.path: Floats | None = None
        self.calls: list[tuple[Floats, npt.NDArray[np.int64], Floats, Floats]] = []

    def check(self, scene: Scene) -> None:
        if scene.name == "of another kind":
            raise ConfigError("the network was trained on scenes of kind 'water', got 'of another kind'")

    def step(
        self, history: Floats, types: npt.NDArray[np.int64], acceleration: Floats, walls: Floats
    ) -> Floats:
        self.calls.append((history, types, acceleration, walls))
        return self._answer(history, acceleration)


FRAME_DT = 0.0025


def answers(kind: str, r_t: int) -> Answer:
    """Return one of the ways in which a network can fail, or free fall."""
    dt = r_t * FRAME_DT

    def moved(history: Floats, acceleration: Floats | float) -> Floats:
        return np.asarray(2 * history[-1] - history[-2] + dt**2 * acceleration, dtype=np.float32)

    def noise(history: Floats) -> Floats:
        # The same for the same question.
        random = np.random.default_rng(history[-1].view(np.uint32).astype(np.uint64).sum())
        return random.standard_normal(history[-1].shape).astype(np.float32)

    kinds: dict[str, Answer] = {
        "nan": lambda history, _: np.full_like(history[-1], np.nan),
        "held": lambda history, _: history[-1],
        "constant": lambda history, _: moved(history, 0.0),
        "constant up": lambda history, _: moved(history, 20.0),
        "thrown": lambda history, _: moved(history, 2000.0),
        "random": lambda history, known: moved(history, known + 100 * noise(history)),
        "random weak": lambda history, known: moved(history, known + 5 * noise(history)),
        "fall": moved,
    }
    return kinds[kind]


@pytest.fixture
def fake() -> Callable[..., Fake]:
    """Return a function that makes a network: `fake("nan", r_p=1.0, r_t=1)`."""

    def make(kind: str | Answer, r_p: float = 1.0, r_t: int = 1) -> Fake:
        return Fake(answers(kind, r_t) if isinstance(kind, str) else kind, r_p, r_t)

    return make


@pytest.fixture
def recorded() -> Callable[..., Fake]:
    """Return a function that makes a network which answers what MPM did, with its `path` (F, N, D).

    From a state that MPM was not in it moves on as MPM did from the nearest one.
    """

    def make(scene: Scene, frames: int, r_p: float = 1.0, r_t: int = 1, force: Floats | None = None) -> Fake:
        path = MpmSolver(scene, r_p=r_p).rollout(frames, force)
        fluid = path.shape[1]

        def answer(history: Floats, _: Floats) -> Floats:
            now = int(np.argmin(((path - history[-1][:fluid]) ** 2).sum(axis=(1, 2))))
            later = path[min(now + r_t, frames)]
            x = history[-1].copy()
            x[:fluid] = later if (x[:fluid] == path[now]).all() else x[:fluid] + (later - path[now])
            return x

        network = Fake(answer, r_p, r_t)
        network.path = path
        return network

    return make


@pytest.fixture
def fall() -> Scene:
    """Return a block of water that hits the floor after some 75 frames: 256 particles."""
    block = Box(material="water", lower=(0.4, 0.3), upper=(0.525, 0.425))
    return Scene(name="fall", dim=2, resolution=64, bodies=(block,))


@pytest.fixture
def pool() -> Scene:
    """Return a pool of water as wide as the walls: 832 particles."""
    water = Box(material="water", lower=(0.1, 0.1), upper=(0.9, 0.16))
    return Scene(name="pool", dim=2, resolution=64, bodies=(water,))


@pytest.fixture
def drop_on_pool() -> Scene:
    """Return the pool and a drop of 4 particles 0.14 m above it."""
    water = Box(material="water", lower=(0.1, 0.1), upper=(0.9, 0.16))
    drop = Ball(material="water", center=(0.5, 0.3), radius=0.009, seed=2)
    return Scene(name="drop on a pool", dim=2, resolution=64, bodies=(water, drop))
