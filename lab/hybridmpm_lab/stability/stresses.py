"""The stresses of the map: scenes that grow worse in three levels, and what is done to them on the way."""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np
import numpy.typing as npt

from hybridmpm.mpm import Sleep
from hybridmpm.physics.stepper import Stepper
from hybridmpm.scene import (
    BallObstacle,
    Box,
    BoxObstacle,
    HalfSpaceObstacle,
    Motion,
    Obstacle,
    Sand,
    Scene,
    Walls,
    Water,
)
from hybridmpm.scene.particle_types import KINEMATIC
from hybridmpm.simulator import Simulator

Method = Literal["mpm", "coarse", "neural", "hybrid"]
METHODS: tuple[Method, ...] = ("mpm", "coarse", "neural", "hybrid")
"""MPM with all particles, the coarse mode at 1/16 with all shown, the shipped network, the hybrid."""
PLANE = (("water", 2), ("sand", 2))
"""Material and dimension that a stress is applied to."""
EVERYWHERE = (*PLANE, ("water", 3), ("sand", 3))

_FLOOR, _CEILING = 0.1, 0.9  # places of the walls along each axis [m]
_SHAFT = (0.4, 0.6)
"""Places of the walls along x and z in 3D [m]: on a wide floor the block would be less than a cell deep."""
_GRAVITY = 9.81
_FRAMES = 800  # frames after which most motion has settled
_REST = 400  # frames after which the block lies still
_SIDE = {2: 0.2, 3: 0.12}  # sides of the block of most stresses [m]: 2600 particles in 2D, 3600 in 3D

_Floats = npt.NDArray[np.float32]
_NOISE = 30.0  # standard deviation of a random acceleration, on each axis [m/s^2]


Corruption = Callable[[_Floats, _Floats, _Floats, float], _Floats]
"""Positions (N, D) [m] from sound ones, the last two positions (2, N, D), the way that the known acceleration
makes in a step (N, D), and the squared time of a step [s^2]."""


def _random(_sound: _Floats, x: _Floats, way: _Floats, square: float) -> _Floats:
    # Equal states get equal noise.
    rng = np.random.default_rng(x[1].view(np.uint32).astype(np.uint64).sum())
    noise = rng.standard_normal(x[1].shape).astype(np.float32)
    return np.asarray(_fallen(x, way) + np.float32(_NOISE * square) * noise)


def _fallen(x: _Floats, way: _Floats) -> _Floats:
    """Return positions after a step of free fall (N, D) [m]."""
    return np.asarray(x[1] + (x[1] - x[0]) + way)


CORRUPTIONS: dict[str, Corruption] = {
    "nan": lambda sound, *_: np.full_like(sound, np.nan),
    "constant": lambda sound, *_: np.full_like(sound, 0.5),
    "still": lambda _sound, x, *_: x[1],
    "random": _random,
    "times-5": lambda sound, x, way, _: _fallen(x, way) + np.float32(5) * (sound - _fallen(x, way)),
    "without-gravity": lambda sound, _x, way, _: sound - way,
}
"""Predictions that are not sound, by name."""


def pushed(size: float) -> Corruption:
    """Return a corruption that adds an acceleration [m/s^2] along x to all predictions."""
    return lambda sound, _x, _way, square: sound + np.float32(size * square) * np.eye(sound.shape[1])[0]


class Corrupted:
    """A network with corrupted predictions on a scene; a `Stepper`."""

    def __init__(self, network: Stepper, corruption: Corruption, scene: Scene) -> None:
        self.r_p, self.r_t, self.check = network.r_p, network.r_t, network.check
        self._network, self._corruption = network, corruption
        self._square = (network.r_t * scene.frame_dt) ** 2

    def step(
        self, history: _Floats, types: npt.NDArray[np.int64], acceleration: _Floats, walls: _Floats
    ) -> _Floats:
        """Return positions (N, D) [m] one step later; arguments as in `Stepper`."""
        sound = self._network.step(history, types, acceleration, walls)
        way = acceleration * np.float32(self._square)
        changed = self._corruption(sound, history[-2:], way, self._square)
        return np.asarray(np.where((types == KINEMATIC)[:, None], sound, changed), dtype=np.float32)


@dataclass(frozen=True)
class Trial:
    """One scene under one stress."""

    scene: Scene
    frames: int = _FRAMES
    force: Callable[[Simulator], npt.ArrayLike | None] | None = None
    """External acceleration [m/s^2] of the next frame, as in `Simulator.advance`."""
    mpm: Mapping[str, Any] = field(default_factory=dict)
    """Settings of MPM; a fixed step takes the place of the coarse level's."""
    safe: Scene | None = None
    """Scene of the truth where it is another one: the same at a stiffness that is safe."""
    behind: Callable[[_Floats], npt.NDArray[np.bool_]] | None = None
    """Whether each position (N, D) can be reached only through a solid."""
    resume_at: int | None = None
    """Frame from whose snapshot a new simulator continues; both have to agree to the bit."""
    corruption: Corruption | None = None
    """Change of the predictions of a hybrid's network."""


@dataclass(frozen=True)
class Stress:
    """Three trials of one kind, the mildest first."""

    trial: Callable[[str, int, Any], Trial]
    """Trial of a material and a dimension at a level."""
    levels: Sequence[Any]
    unit: str = "{}"
    """Format of a level."""
    settings: tuple[tuple[str, int], ...] = PLANE
    methods: tuple[Method, ...] = METHODS


def _material(name: str, **constants: float) -> Water | Sand:
    return Water(**constants) if name == "water" else Sand(**constants)


def block(of: str, dim: int, *, height: float = 0.1, side: float | None = None, **fields: Any) -> Box:
    """Return the block of most stresses, so high above the floor [m], in the middle."""
    long = _SIDE[dim] if side is None else side
    lower = np.full(dim, 0.5 - long / 2)
    lower[1] = _FLOOR + height
    return Box(lower=tuple(lower), upper=tuple(lower + long), **({"material": of} | fields))


def scene(dim: int, *bodies: Box, **fields: Any) -> Scene:
    """Return a scene with these bodies, at the resolution that the networks were trained at."""
    if dim == 3:
        (low, high), floor = _SHAFT, _FLOOR
        fields = {"walls": Walls(lower=(low, floor, low), upper=(high, _CEILING, high))} | fields
    return Scene(dim=dim, bodies=bodies, **fields)


def _vector(dim: int, x: float, y: float = 0.0) -> tuple[float, ...]:
    return (x, y, 0.0)[:dim]


def _impact(of: str, dim: int, speed: float) -> Trial:
    return Trial(scene(dim, block(of, dim, velocity=_vector(dim, 0.0, -speed))))


def _corner(of: str, dim: int, speed: float) -> Trial:
    return Trial(scene(dim, block(of, dim, velocity=(-speed,) * dim)))


def _gravity(of: str, dim: int, times: float) -> Trial:
    return Trial(scene(dim, block(of, dim), gravity=_vector(dim, 0.0, -times * _GRAVITY)))


def _jets(of: str, dim: int, speed: float) -> Trial:

    def stream(x: float, speed: float) -> Box:
        lower, upper = (x, _FLOOR + 0.25, 0.47)[:dim], (x + 0.3, _FLOOR + 0.31, 0.53)[:dim]
        return Box(lower=lower, upper=upper, material=of, velocity=_vector(dim, speed))

    return Trial(scene(dim, stream(0.18, speed), stream(0.52, -speed)))


def _one_particle(of: str, dim: int, level: str) -> Trial:
    height, speed = {"on the floor": (0.0, 0.0), "falls by 0.5 m": (0.5, 0.0)}.get(level, (0.3, 5.0))
    start = (0.5, _FLOOR + height, 0.5)[:dim]
    end = tuple(c + scene(dim, block(of, dim)).spacing for c in start)
    return Trial(
        scene(dim, Box(lower=start, upper=end, material=of, velocity=_vector(dim, speed))), _FRAMES // 2
    )


def _long(of: str, dim: int, frames: int) -> Trial:
    return Trial(scene(dim, block(of, dim)), frames)


def _pool(of: str, dim: int, depth: float) -> Trial:
    upper = (_CEILING, _FLOOR + depth, _CEILING)[:dim]
    return Trial(scene(dim, Box(lower=(_FLOOR,) * dim, upper=upper, material=of)), 4000)


def _substeps(of: str, dim: int, level: str) -> Trial:
    falling, native = scene(dim, block(of, dim)), _material(of).to_native(1.0)
    cfl = native.default_cfl if level == "the default" else native.cfl_limit
    substeps = math.ceil(falling.frame_dt * native.signal_speed(dim) / falling.dx / cfl)
    return Trial(falling, mpm={"substeps": substeps - (level == "above the limit")})


def _particles(of: str, dim: int, times: int) -> Trial:
    return Trial(scene(dim, block(of, dim, side=0.247 * times ** (1 / dim))))


def _overlap(of: str, dim: int, share: float) -> Trial:
    side, lower = 0.15, (0.35, _FLOOR, 0.425)[:dim]
    moved = (lower[0] + (1 - share) * side, *lower[1:])
    boxes = [Box(lower=one, upper=tuple(c + side for c in one), material=of) for one in (lower, moved)]
    return Trial(scene(dim, *boxes))


def _coincident(of: str, dim: int, count: int) -> Trial:
    return Trial(scene(dim, *[block(of, dim, side=0.06)] * count))


def _density_ratio(of: str, dim: int, ratio: float) -> Trial:
    light = Box(
        lower=(0.4, _FLOOR, 0.4)[:dim],
        upper=(0.6, _FLOOR + 0.1, 0.6)[:dim],
        material=_material(of, density=_material(of).density / ratio),
    )
    heavy = Box(lower=(0.4, _FLOOR + 0.1, 0.4)[:dim], upper=(0.6, _FLOOR + 0.2, 0.6)[:dim], material=of)
    return Trial(scene(dim, light, heavy), _FRAMES // 2)


def _stiffness(of: str, dim: int, modulus: float) -> Trial:
    stiff = _material(of, **{{"water": "bulk_modulus", "sand": "youngs_modulus"}[of]: modulus})
    return Trial(scene(dim, block(of, dim, material=stiff)), safe=scene(dim, block(of, dim)))


def _full_box(of: str, dim: int, size: float) -> Trial:
    # Walls on grid nodes, or the lattice of the particles would put a layer more or less between them.
    lower, upper = (0.3984375,) * dim, (0.6015625, 0.6015625, 0.5)[:dim]
    body = Box(lower=lower, upper=upper, material=of)

    def force(simulator: Simulator) -> tuple[float, ...]:
        return _vector(dim, size if simulator.frame % 80 < 40 else -size)

    full = Scene(dim=dim, walls=Walls(lower=lower, upper=upper), bodies=(body,))
    return Trial(full, force=force if size else None)


def _unseen(of: str, dim: int, level: str) -> Trial:
    obstacles: tuple[Obstacle, ...]
    if level == "a ball":
        obstacles = (BallObstacle(center=(0.5, _FLOOR + 0.08, 0.5)[:dim], radius=0.08),)
    elif level == "a slope":
        point = (0.5, _FLOOR + 0.02, 0.5)[:dim]
        obstacles = (HalfSpaceObstacle(point=point, normal=_vector(dim, -0.5, 1.0)),)
    else:
        obstacles = tuple(
            BoxObstacle(lower=(x, _FLOOR, _FLOOR)[:dim], upper=(x + 0.03, _FLOOR + 0.2, _CEILING)[:dim])
            for x in (0.42, 0.55)
        )
    return Trial(scene(dim, block(of, dim, height=0.3), obstacles=obstacles))


def _thin(of: str, dim: int, cells: int) -> Trial:
    falling = block(of, dim, height=0.35, velocity=_vector(dim, 0.0, -3.0))
    top = _FLOOR + 0.3
    bottom = top - cells * scene(dim, falling).dx
    shelf = BoxObstacle(lower=(_FLOOR, bottom, _FLOOR)[:dim], upper=(_CEILING, top, _CEILING)[:dim])
    shelved = scene(dim, falling, obstacles=(shelf,))
    return Trial(shelved, _FRAMES // 2, behind=lambda x: np.asarray(x[:, 1] < bottom))


def _paddle(of: str, dim: int, rate: float) -> Trial:
    center = (0.5, _FLOOR + 0.1, 0.5)[:dim]
    paddle = BoxObstacle(
        lower=(0.41, center[1] - 0.015, _FLOOR)[:dim],
        upper=(0.59, center[1] + 0.015, _CEILING)[:dim],
        motion=Motion(angular_velocity=rate if dim == 2 else (0.0, 0.0, rate), center=center),
    )
    return Trial(scene(dim, block(of, dim, height=0.15), obstacles=(paddle,)))


def _spike(of: str, dim: int, size: float) -> Trial:

    def force(simulator: Simulator) -> tuple[float, ...] | None:
        return _vector(dim, size) if simulator.frame == _FRAMES // 4 else None

    return Trial(scene(dim, block(of, dim)), 2 * _FRAMES, force)


def _pulled_apart(of: str, dim: int, size: float) -> Trial:

    def force(simulator: Simulator) -> _Floats | None:
        turn = {0: 1.0, 1: -1.0}.get((simulator.frame - 40) // 60)
        if turn is None:
            return None
        push = np.zeros_like(simulator.positions)
        push[:, 0] = turn * size * np.sign(simulator.positions[:, 0] - 0.5)
        return push

    return Trial(scene(dim, block(of, dim, height=0.0)), force=force)


def _asleep(of: str, dim: int, size: float) -> Trial:

    def force(simulator: Simulator) -> tuple[float, ...] | None:
        return _vector(dim, size) if _REST <= simulator.frame < _REST + 40 else None

    return Trial(scene(dim, block(of, dim, height=0.0)), force=force, mpm={"sleep": Sleep()})


def _resumed(of: str, dim: int, frame: int) -> Trial:
    moving = scene(dim, block(of, dim, velocity=_vector(dim, 2.0)))
    return Trial(moving, _FRAMES // 2, resume_at=frame)


def _biased(of: str, dim: int, size: float) -> Trial:
    return Trial(scene(dim, block(of, dim)), corruption=pushed(size))


def _broken(of: str, dim: int, kind: str) -> Trial:
    return Trial(scene(dim, block(of, dim)), corruption=CORRUPTIONS[kind])


_PUSH = "{:g} m/s^2"
_PLACES = ("on the floor", "falls by 0.5 m", "thrown at 5 m/s")
_STEPS = ("the default", "the limit", "above the limit")
_SHAPES = ("a ball", "a slope", "two posts")
STRESSES: dict[str, Stress] = {
    "impact": Stress(_impact, (2, 5, 12), "{} m/s", EVERYWHERE),
    "gravity": Stress(_gravity, (0.5, 3, 10), "{:g} g", EVERYWHERE),
    "jets": Stress(_jets, (1, 3, 8), "{} m/s each"),
    "corner": Stress(_corner, (2, 5, 10), "{} m/s", EVERYWHERE),
    "one particle": Stress(_one_particle, _PLACES),
    "long run": Stress(_long, (400, 1200, 4000), "{} frames", EVERYWHERE),
    "pool": Stress(_pool, (0.05, 0.1, 0.2), "{} m deep"),
    "substep": Stress(_substeps, _STEPS, methods=("mpm",)),
    "particles": Stress(_particles, (1, 2, 4), "{} x 4000 particles"),
    "overlap": Stress(_overlap, (0.1, 0.5, 1.0), "{:.0%} of a body"),
    "coincident": Stress(_coincident, (2, 4, 16), "{} particles in each place"),
    "density ratio": Stress(_density_ratio, (3, 30, 1000), "{} : 1"),
    "stiffness": Stress(_stiffness, (1e2, 1e5, 1e8), "{:.0e} Pa"),
    "full box": Stress(_full_box, (0, 10, 100), "shaken at {:g} m/s^2"),
    "unseen obstacle": Stress(_unseen, _SHAPES),
    "thin obstacle": Stress(_thin, (4, 2, 1), "{} dx"),
    "moving obstacle": Stress(_paddle, (2, 10, 40), "{:g} rad/s", EVERYWHERE),
    "force spike": Stress(_spike, (100, 1000, 5000), "{} m/s^2 for a frame", EVERYWHERE),
    "pulled apart": Stress(_pulled_apart, (5, 20, 80), _PUSH),
    "asleep": Stress(_asleep, (0.5, 5, 50), _PUSH),
    "resumed": Stress(_resumed, (60, 120, 200), "at frame {}"),
    "biased network": Stress(_biased, (0.5, 5, 50), _PUSH, methods=("hybrid",)),
    "broken network": Stress(_broken, ("random", "constant", "nan"), methods=("hybrid",)),
}
"""Stresses by name, in the order of the map."""
