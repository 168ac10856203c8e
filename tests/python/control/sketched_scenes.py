"""Scenes on which nothing was tuned, ovals to draw on them, and shares of the mass that follow."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np

from hybridmpm import Box, MpmSolver, Scene, scenarios
from hybridmpm.control import Ellipse, follow

Maker = Callable[[int, np.random.Generator], MpmSolver]
LATE = 8
"""Frames without force before a late sketch acts."""
LATER = 20
"""Frames after the end at which the share inside is taken again."""


def oval(rng: np.random.Generator, solver: MpmSolver) -> Ellipse:
    """Draw an oval of 0.7 to 1.6 times the fluid's area, above the floor."""
    area = solver.particle_count * solver.scene.spacing**2
    aspect, size = rng.uniform(1, 2.2), area * rng.uniform(0.7, 1.6) / np.pi
    axes = np.sqrt([size * aspect, size / aspect])
    return Ellipse(rng.uniform([0.35, 0.4], [0.65, 0.65]), axes, rng.uniform(0, np.pi))


def pool(seed: int, rng: np.random.Generator) -> MpmSolver:
    """Return a shallow pool of water, at rest."""
    body = Box(lower=(0.1, 0.1), upper=(0.9, 0.1 + rng.uniform(0.06, 0.08)), material="water")
    return _after(100, Scene(dim=2, bodies=[body]))


def sand(seed: int, rng: np.random.Generator) -> MpmSolver:
    """Return a settled heap of sand."""
    left = rng.uniform(0.1, 0.6)
    body = Box(lower=(left, 0.1), upper=(left + 0.3, 0.3), material="sand")
    return _after(250, Scene(dim=2, bodies=[body]))


def puddles(seed: int, rng: np.random.Generator) -> MpmSolver:
    """Return two columns of water in the corners, in collapse."""
    width = rng.uniform(0.15, 0.22)
    height = 0.1 + 0.03 / width
    bodies = [
        Box(lower=(0.1, 0.1), upper=(0.1 + width, height), material="water"),
        Box(lower=(0.9 - width, 0.1), upper=(0.9, height), material="water"),
    ]
    return _after(60, Scene(dim=2, bodies=bodies))


def ramps(material: str, seed: int, rng: np.random.Generator) -> MpmSolver:
    """Return a fluid that has run down ramps."""
    return _after(250, scenarios.get(f"{material}_ramps_2d", seed))


FREE: dict[str, Maker] = {"a pool lifted": pool, "settled sand": sand, "two puddles": puddles}
OVER_RAMPS: dict[str, Maker] = {
    "over ramps, water": partial(ramps, "water"),
    "over ramps, sand": partial(ramps, "sand"),
}


@dataclass(frozen=True)
class Shares:
    """Shares of the mass inside the goal."""

    end: float
    later: float
    """`LATER` frames after the end, held."""


def shares(make: Maker, seed: int) -> Shares:
    """Follow an oval for the suggested number of frames, with a hold."""
    rng = np.random.default_rng(seed)
    solver = make(seed, rng)
    following = follow(solver, oval(rng, solver), hold=LATER)
    result = following.run()
    goal, frames = following.guidance.goal, following.guidance.frames
    inside = [goal.inside(result.positions[frame].astype(np.float64)) for frame in (frames, -1)]
    return Shares(*(float(goal.cloud.weight @ one) for one in inside))


def lateness(make: Maker, seed: int) -> float:
    """Return how much less mass is inside at the end if the first `LATE` frames pass without force."""
    rng = np.random.default_rng(seed)
    solver = make(seed, rng)
    drawn = oval(rng, solver)
    twin = solver.copy()
    prompt = follow(solver, drawn).run().reached.inside or 0.0
    late = follow(twin, drawn)
    twin.advance(LATE)
    # The plan is that of the state that the sketch was drawn on, and the end stays where it was.
    twin.advance(late.guidance.frames - LATE, late.guidance)
    goal = late.guidance.goal
    return prompt - float(goal.cloud.weight @ goal.inside(twin.positions.astype(np.float64)))


def _after(frames: int, scene: Scene) -> MpmSolver:
    solver = MpmSolver(scene)
    solver.advance(frames)
    return solver
