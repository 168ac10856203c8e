"""What bounds the use of a level: how deep matter settles, and how fast it lands."""

import math

import numpy as np

from hybridmpm.scene import Emitter, Scene


def settled_potential(scene: Scene) -> float:
    """Return the product g h [m^2/s^2], where h is the depth of all matter, settled between the walls.

    Matter of emitters counts as far as it comes within the scene's suggested length. Obstacles count as room.
    """
    gravity = np.array(scene.gravity)
    sides = np.subtract(scene.walls.upper, scene.walls.lower)
    height = np.abs(gravity) @ sides  # times g
    volume = sum(body.measure for body in scene.bodies)
    volume += sum(_emitted(scene, emitter) for emitter in scene.emitters)
    largest = scene.max_particles * scene.spacing**scene.dim
    return float(height * min(volume, largest) / sides.prod())


def fastest_impact(scene: Scene) -> float:
    """Return a bound of the speed [m/s] with which matter that falls freely reaches the floor."""
    gravity = np.array(scene.gravity)
    floor = np.maximum(gravity * scene.walls.lower, gravity * scene.walls.upper).sum()
    squares = [0.0]
    for part in (*scene.bodies, *scene.emitters):
        lower, upper = part.bounds
        top = np.minimum(gravity * lower, gravity * upper).sum()
        velocity = part.velocity or ()
        squares.append(sum(v**2 for v in velocity) + 2 * (floor - top))
    return math.sqrt(max(squares))


def _emitted(scene: Scene, emitter: Emitter) -> float:
    """Return the volume [m^D] that an emitter lets out within the scene's suggested length."""
    end = scene.frames * scene.frame_dt
    seconds = max(0.0, min(end, emitter.stop if emitter.stop is not None else end) - emitter.start)
    area = len(emitter.sites(scene.spacing)) * scene.spacing ** (scene.dim - 1)
    return float(area * emitter.speed * seconds)
