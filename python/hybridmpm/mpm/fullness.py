"""Matter that fills the box between its walls, told from a scene alone."""

import numpy as np

from hybridmpm.scene import Scene

FULL = 0.95
"""Share of the box from which on it counts as full [-]."""


def filled_share(scene: Scene) -> float:
    """Return the volume of all bodies over that of the box between the walls [-]; obstacles count as room."""
    sides = np.subtract(scene.walls.upper, scene.walls.lower)
    return float(sum(body.measure for body in scene.bodies) / sides.prod())


def full_box(scene: Scene) -> str | None:
    """Return a sentence where matter fills the box, so that none of it has a free surface."""
    share = filled_share(scene)
    if share < FULL:
        return None
    return (
        f"bodies fill {share:.0%} of the box between the walls: without a free surface errors of the density "
        "turn into pressure, and their energy adds up; leave a twentieth of the box free"
    )
