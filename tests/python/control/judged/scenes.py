"""Scenes on which following a sketch is judged, and what is measured on them; nothing was tuned on them.

`tables` prints the tables of docs/guide/control.md, `contact_sheet` draws its picture, test_aims.py holds the aims.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np
import numpy.typing as npt

from hybridmpm import Box, MpmSolver, Scene, metrics, scenarios
from hybridmpm.control import Ellipse, Following, follow

Floats = npt.NDArray[np.float64]
Maker = Callable[[int, np.random.Generator], MpmSolver]
LATE = 8
"""Frames that have passed, without force, when a late sketch begins to act."""
LATER = 20
"""Frames after the end at which the share inside is taken again."""
PAST = 100
"""Frames that reversed cases are led back."""


def oval(rng: np.random.Generator, solver: MpmSolver) -> Ellipse:
    """Draw an oval of 0.7 to 1.6 times the fluid's area, somewhere above the floor."""
    area = solver.particle_count * solver.scene.spacing**2
    aspect, size = rng.uniform(1, 2.2), area * rng.uniform(0.7, 1.6) / np.pi
    axes = np.sqrt([size * aspect, size / aspect])
    return Ellipse(rng.uniform([0.35, 0.4], [0.65, 0.65]), axes, rng.uniform(0, np.pi))


def pool(seed: int, rng: np.random.Generator) -> MpmSolver:
    """Return a shallow pool of water, at rest."""
    body = Box(lower=(0.1, 0.1), upper=(0.9, 0.1 + rng.uniform(0.06, 0.08)), material="water")
    return _after(100, Scene(dim=2, bodies=[body]))


def sand(seed: int, rng: np.random.Generator) -> MpmSolver:
    """Return a heap of sand that has settled."""
    left = rng.uniform(0.1, 0.6)
    body = Box(lower=(left, 0.1), upper=(left + 0.3, 0.3), material="sand")
    return _after(250, Scene(dim=2, bodies=[body]))


def puddles(seed: int, rng: np.random.Generator) -> MpmSolver:
    """Return two columns of water in the corners that have begun to collapse."""
    width = rng.uniform(0.15, 0.22)
    height = 0.1 + 0.03 / width
    bodies = [
        Box(lower=(0.1, 0.1), upper=(0.1 + width, height), material="water"),
        Box(lower=(0.9 - width, 0.1), upper=(0.9, height), material="water"),
    ]
    return _after(60, Scene(dim=2, bodies=bodies))


def ramps(material: str, seed: int, rng: np.random.Generator) -> MpmSolver:
    """Return a fluid that has run down some ramps."""
    return _after(250, scenarios.get(f"{material}_ramps_2d", seed))


def deep(material: str, seed: int, rng: np.random.Generator) -> MpmSolver:
    """Return a fluid in 3D in flight or in its first splash."""
    return _after(30, scenarios.get(f"{material}_3d", seed))


FREE: dict[str, Maker] = {"a pool lifted": pool, "settled sand": sand, "two puddles": puddles}
OVER_RAMPS: dict[str, Maker] = {
    "over ramps, water": partial(ramps, "water"),
    "over ramps, sand": partial(ramps, "sand"),
}
IN_DEPTH: dict[str, Maker] = {"in 3D, water": partial(deep, "water"), "in 3D, sand": partial(deep, "sand")}


@dataclass(frozen=True)
class Shares:
    """Shares of the mass inside the goal, and the force of the frames until the end."""

    end: float
    later: float
    """`LATER` frames after the end, held."""
    loose: float
    """The same without force after the end."""
    drawn: float
    """At the end, in the oval as it was drawn."""
    over_least: float
    """Root mean square of the force over its lower bound."""


def shares(make: Maker, seed: int) -> Shares:
    """Follow an oval for the suggested number of frames, once with and once without a hold."""
    rng = np.random.default_rng(seed)
    solver = make(seed, rng)
    drawn = oval(rng, solver) if solver.dim == 2 else _deep_oval(rng, solver)
    twin = solver.copy()
    following = follow(solver, drawn, hold=LATER)
    result = following.run()
    frames = following.guidance.frames
    released = follow(twin, drawn)
    released.run()
    twin.advance(LATER)
    return Shares(
        end=share(following, result.positions[frames]),
        later=share(following, result.positions[-1]),
        loose=share(released, twin.positions),
        drawn=result.reached.inside_drawn or 0.0,
        over_least=result.reached.rms / following.guidance.needs().rms,
    )


def share(following: Following, x: npt.NDArray[np.float32]) -> float:
    """Return the share of the mass that is in the goal if the particles are at x (N, D)."""
    inside = following.guidance.goal.inside(x.astype(np.float64))
    assert inside is not None
    return float(following.guidance.goal.cloud.weight @ inside)


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
    return prompt - share(late, twin.positions)


def reversed_error(scenario: str, method: str, seed: int) -> tuple[int, float]:
    """Lead a fluid to the oval of its state `PAST` frames before.

    Returns the number of its bodies and the final grid RMSE.
    """
    rng = np.random.default_rng(seed)
    solver = _after(int(rng.integers(PAST, endpoint=True)), scenarios.get(scenario, seed))
    x = solver.positions.astype(np.float64)
    solver.advance(PAST)
    weight = solver.mass / solver.mass.sum(dtype=np.float64)
    mean = weight @ x
    values, vectors = np.linalg.eigh((weight[:, None] * (x - mean)).T @ (x - mean))
    axes, major = 2 * np.sqrt(values[::-1]), vectors[:, 1]
    drawn = Ellipse(mean, np.clip(axes, 2 / 512, 1), float(np.arctan2(major[1], major[0])))
    follow(solver, drawn, method, frames=PAST).run()
    resolution = solver.scene.resolution
    found, true = (metrics.grid_mass(state, solver.mass, resolution) for state in (solver.positions, x))
    return len(solver.scene.bodies), metrics.grid_rmse(found, true)


def _after(frames: int, scene: Scene) -> MpmSolver:
    solver = MpmSolver(scene)
    solver.advance(frames)
    return solver


def _deep_oval(rng: np.random.Generator, solver: MpmSolver) -> Ellipse:
    """Draw an oval whose ellipsoid has 0.7 to 1.6 times the fluid's volume, in the middle of the depth."""
    volume = solver.particle_count * solver.scene.spacing**3 * rng.uniform(0.7, 1.6)
    aspect = rng.uniform(1, 1.8)
    # Semi-axes a and a / aspect, and their geometric mean in depth.
    a = (volume / (4 / 3 * np.pi)) ** (1 / 3) * np.sqrt(aspect)
    return Ellipse(
        rng.uniform([0.4, 0.4], [0.6, 0.6]), np.array([a, a / aspect]), rng.uniform(0, np.pi), 11.0
    )
