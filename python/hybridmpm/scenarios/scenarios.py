"""The seven seeded scenarios: random scenes of the kinds that the paper trains and tests on.

`water_2d(seed)` and its siblings return a `Scene`. With one version of numpy, the same name and seed always
give the same scene. A scene never has more than `describe(name).max_particles` particles, bodies do not
overlap, and ramps touch no body. `samplers.py` and docs/reference/scenarios.md list the ranges.
"""

import operator
from dataclasses import dataclass

import numpy as np

from hybridmpm._support.suggestions import did_you_mean
from hybridmpm.errors import SceneError, UnknownScenarioError
from hybridmpm.scenarios.placement import CLEARANCE, Block, NoRoomError, draw_blocks, draw_ramps
from hybridmpm.scenarios.samplers import SAMPLERS, Sampler
from hybridmpm.scene import Box, Scene

__all__ = [
    "NAMES",
    "ScenarioInfo",
    "describe",
    "get",
    "sand_2d",
    "sand_3d",
    "sand_ramps_2d",
    "water_2d",
    "water_3d",
    "water_ramps_2d",
    "water_sand_2d",
]

MAX_SEED = 2**53 - 1
_WALL_LOW, _WALL_HIGH = 0.1, 0.9
_REDRAWS = 100


@dataclass(frozen=True, kw_only=True)
class ScenarioInfo:
    """Properties that all scenes of a scenario share."""

    name: str
    dim: int
    frames: int
    """Suggested number of frames, that of the paper's data."""
    max_particles: int
    text: str
    """Summary of the scenario in one sentence."""


NAMES: tuple[str, ...] = tuple(SAMPLERS)


def describe(name: str) -> ScenarioInfo:
    """Return a scenario's dimension, length and limits; raises `UnknownScenarioError`."""
    sampler = _sampler(name)
    return ScenarioInfo(
        name=name,
        dim=sampler.dim,
        frames=sampler.frames,
        max_particles=sampler.max_particles,
        text=sampler.text,
    )


def get(name: str, seed: int = 0) -> Scene:
    """Draw a scene of a scenario.

    Parameters
    ----------
    name : str
        Name of the scenario, one of `NAMES`.
    seed : int in [0, 2**53 - 1]
        Seed of the scene. By convention seeds below 10**6 are for training, those from 10**6 on for
        validation, those from 1.1 * 10**6 on for tests.

    Raises
    ------
    UnknownScenarioError
        No scenario has this name; the message lists the names.
    SceneError
        The seed is out of range.
    """
    sampler = _sampler(name)
    rng = np.random.default_rng([sampler.salt, _checked_seed(seed)])
    for _ in range(_REDRAWS):
        try:
            return _draw(f"{name} seed {seed}", sampler, rng)
        except NoRoomError:
            continue
    # tests/python/scenarios draws hundreds of seeds, which need a few redraws at most.
    raise AssertionError(f"{name} with seed {seed} found no room in {_REDRAWS} redraws")


def water_2d(seed: int = 0) -> Scene:
    """One to three blocks of water; errors as in `get`."""
    return get("water_2d", seed)


def water_ramps_2d(seed: int = 0) -> Scene:
    """Water over ramps; errors as in `get`."""
    return get("water_ramps_2d", seed)


def sand_2d(seed: int = 0) -> Scene:
    """One to three blocks of sand; errors as in `get`."""
    return get("sand_2d", seed)


def sand_ramps_2d(seed: int = 0) -> Scene:
    """Sand over ramps; errors as in `get`."""
    return get("sand_ramps_2d", seed)


def water_3d(seed: int = 0) -> Scene:
    """One to three blocks of water in 3D; errors as in `get`."""
    return get("water_3d", seed)


def sand_3d(seed: int = 0) -> Scene:
    """One to three blocks of sand in 3D; errors as in `get`."""
    return get("sand_3d", seed)


def water_sand_2d(seed: int = 0) -> Scene:
    """Water and sand in one scene; errors as in `get`."""
    return get("water_sand_2d", seed)


def _sampler(name: str) -> Sampler:
    try:
        return SAMPLERS[name]
    except (KeyError, TypeError):
        text = f"must be one of {', '.join(NAMES)}; got {name!r}{did_you_mean(name, NAMES)}"
        raise UnknownScenarioError.of([("scenario", text)]) from None


def _checked_seed(seed: int) -> int:
    try:
        number = operator.index(seed)
    except TypeError:
        number = -1
    if not 0 <= number <= MAX_SEED:
        raise SceneError.of([("seed", f"must be a whole number in [0, {MAX_SEED}], got {seed!r}")])
    return number


def _draw(title: str, sampler: Sampler, rng: np.random.Generator) -> Scene:
    dx = 1.0 / (128 if sampler.dim == 2 else 64)
    spacing = dx / 2  # 2**D particles per cell
    # One spacing from the walls, so that bodies lose no layer of particles at a wall.
    inset = spacing
    room = Block(np.full(sampler.dim, _WALL_LOW + inset), np.full(sampler.dim, _WALL_HIGH - inset))
    below = room.upper.copy()
    below[1] = room.lower[1] + sampler.top * (room.upper[1] - room.lower[1])
    count = int(rng.integers(sampler.blocks[0], sampler.blocks[1], endpoint=True))
    particles = rng.uniform(*sampler.fill) * sampler.max_particles
    blocks = draw_blocks(
        rng,
        room=Block(room.lower, below),
        count=count,
        measure=particles * spacing**sampler.dim,
        aspect=sampler.aspect,
        clearance=CLEARANCE * dx,
    )
    ramps = []
    if sampler.ramps != (0, 0):
        ramps = draw_ramps(
            rng,
            room=room,
            count=int(rng.integers(sampler.ramps[0], sampler.ramps[1], endpoint=True)),
            shape=sampler.ramp_shape,
            blocks=blocks,
            dx=dx,
        )
    return Scene(
        name=title,
        dim=sampler.dim,
        bodies=tuple(_body(sampler, rng, index, block) for index, block in enumerate(blocks)),
        obstacles=tuple(ramps),
        frames=sampler.frames,
        max_particles=sampler.max_particles,
    )


def _body(sampler: Sampler, rng: np.random.Generator, index: int, block: Block) -> Box:
    drawn = int(rng.integers(len(sampler.materials)))
    velocity = rng.uniform(*sampler.velocity.horizontal, sampler.dim)
    velocity[1] = rng.uniform(*sampler.velocity.vertical)
    return Box(
        material=sampler.materials[index if index < len(sampler.materials) else drawn],
        lower=tuple(np.round(block.lower, 6).tolist()),
        upper=tuple(np.round(block.upper, 6).tolist()),
        velocity=tuple(np.round(velocity, 4).tolist()),
        seed=int(rng.integers(2**31)),
    )
