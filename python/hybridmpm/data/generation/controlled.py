"""Controlled trajectories: a reversed case of control with its sketch, as a ruler and as a hand draw it."""

from collections.abc import Callable

import numpy as np

from hybridmpm.control import Stroke, StrokeSketch, render_png, reversed_from_seed
from hybridmpm.control.sketch.synthetic_sketches import distort, random_hand
from hybridmpm.data.control import Control, rounded
from hybridmpm.data.generation.solids import Solids
from hybridmpm.data.recipe import Recipe
from hybridmpm.data.trajectory import Trajectory

_HAND_SALT = 2**23
"""Number that the generator of the hand gets besides the seed."""


def controlled(recipe: Recipe, seed: int, on_frame: Callable[[], object]) -> Trajectory:
    """Make the controlled trajectory of a seed.

    `on_frame()` is called before each frame; what it raises ends the work.

    Raises
    ------
    ConfigError
        The scene has emitters, sinks or moving obstacles.
    SimulationError
        The scene cannot be filled, or a frame failed.
    """
    case = reversed_from_seed(
        recipe.scene(seed),
        seed,
        frames=recipe.states - 1,
        substeps=recipe.substeps,
        r_p=recipe.r_p,
        on_frame=on_frame,
    )
    stroke, picture = _by_hand(case.sketch, seed)
    solids = Solids.of(case.scene, recipe.r_p)
    control = Control(
        sketch=case.sketch,
        stroke=stroke,
        picture=picture,
        control_frame=case.control_frame,
        start=case.start,
        cap=case.cap,
        velocity=solids.still(case.velocities),
        target=solids.placed(case.target),
        smoothed_force=solids.still(case.smoothed_forces),
    )
    return solids.trajectory(case.simulator(), case.positions, force=case.forces, seed=seed, control=control)


def _by_hand(sketch: StrokeSketch, seed: int) -> tuple[Stroke, bytes]:
    rng = np.random.default_rng([_HAND_SALT, seed])
    line, drawing = distort(sketch, random_hand(rng, sketch.kind), rng)
    stroke = Stroke(
        points=rounded(line.points),
        widths=rounded(line.widths),
        times=None if line.times is None else rounded(line.times),
        kind=sketch.kind,
    )
    return stroke, render_png(drawing)
