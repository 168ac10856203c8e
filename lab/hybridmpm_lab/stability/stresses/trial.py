"""`Trial`: one scene under one stress, and `Stress`, three of them that grow worse."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np
import numpy.typing as npt

from hybridmpm.physics.stepper import Stepper
from hybridmpm.scene import Box, Elastic, Sand, Scene, Walls, Water
from hybridmpm.simulator import Simulator

Method = Literal["mpm", "coarse", "neural", "hybrid"]
METHODS: tuple[Method, ...] = ("mpm", "coarse", "neural", "hybrid")
"""MPM with all particles, MPM at coarse level 1/16 with all others carried along, the shipped network, the hybrid."""
MODELS = {2: "fluids_2d", 3: "fluids_3d"}
"""Networks of the map by dimension; both move an eighth of the particles and carry the others."""

FLOOR, CEILING = 0.1, 0.9
"""Places of the walls along each axis, unless a stress is about walls [m]; see `scene` for 3D."""
_SHAFT = (0.4, 0.6)
"""Places of the walls along x and z in 3D [m]: on a wide floor the block would be less than a cell deep."""
GRAVITY = 9.81
FRAMES = 800
"""Frames after which most of what was stirred has settled."""
_SIDE = {2: 0.2, 3: 0.12}
"""Sides of the block that most stresses are about [m]: 2600 particles in 2D, 3600 in 3D."""

Setting = tuple[str, int]
"""Material and dimension."""
PLANE: tuple[Setting, ...] = (("water", 2), ("sand", 2))
EVERYWHERE: tuple[Setting, ...] = (*PLANE, ("water", 3), ("sand", 3))
"""Settings that a stress is tried in."""

_Floats = npt.NDArray[np.float32]


@dataclass(frozen=True, kw_only=True)
class Trial:
    """One scene under one stress, and what the methods are told beside the scene."""

    level: str
    """What makes this level, with its unit."""
    scene: Scene
    frames: int
    force: Callable[[Simulator], npt.ArrayLike | None] | None = None
    """External acceleration [m/s^2] of the frame to come, as in `Simulator.advance`."""
    mpm: Mapping[str, Any] = field(default_factory=dict)
    """Settings of MPM; they take the place of the coarse level where few particles carry all."""
    safe: Scene | None = None
    """Scene of the truth where it is not this one: the same at a stiffness that is safe."""
    passed: Callable[[_Floats], npt.NDArray[np.bool_]] | None = None
    """Tells which positions (N, D) no particle can reach without going through a solid."""
    resume_at: int | None = None
    """Frame whose snapshot a new simulator goes on from; both have to agree to the bit."""
    spoil: Callable[[Stepper, Scene], Stepper] | None = None
    """What is done to the network of a hybrid."""
    hand_over_every: int | None = None
    """Steps of the network after which a hybrid is made to change hands, whatever its guards say."""


@dataclass(frozen=True, kw_only=True)
class Stress:
    """Three trials of one kind, the mildest first."""

    name: str
    text: str
    """What is done, in one sentence for people."""
    trials: Callable[[str, int], tuple[Trial, ...]]
    """Makes the trials of a material in a dimension."""
    settings: tuple[Setting, ...] = PLANE
    methods: tuple[Method, ...] = METHODS
    """Methods that it can be done to."""


def material(name: str, **constants: float) -> Water | Sand | Elastic:
    """Return a material by name, with some of its constants changed."""
    made: dict[str, type[Water | Sand | Elastic]] = {"water": Water, "sand": Sand, "elastic": Elastic}
    return made[name](**constants)


def block(of: str, dim: int, *, height: float = 0.1, side: float | None = None, **fields: Any) -> Box:
    """Return the block that most stresses are about, so high above the floor [m], in the middle."""
    long = _SIDE[dim] if side is None else side
    lower = np.full(dim, 0.5 - long / 2)
    lower[1] = FLOOR + height
    fields = {"material": of} | fields
    return Box(lower=tuple(lower), upper=tuple(lower + long), **fields)


def scene(dim: int, *bodies: Box, **fields: Any) -> Scene:
    """Return a scene with these bodies, at the resolution that the networks were trained at."""
    if dim == 3:
        (low, high), floor = _SHAFT, FLOOR
        fields = {"walls": Walls(lower=(low, floor, low), upper=(high, CEILING, high))} | fields
    return Scene(dim=dim, bodies=bodies, **fields)


def vector(dim: int, x: float, y: float = 0.0) -> tuple[float, ...]:
    """Return a vector of the plane as one of this dimension."""
    return (x, y, 0.0)[:dim]
