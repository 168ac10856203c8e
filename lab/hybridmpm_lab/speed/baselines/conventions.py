"""What the solvers of others have in common: the scenes that they take, and the constants of sand."""

import math

from hybridmpm.errors import ConfigError
from hybridmpm.scene import Sand, Scene, Water


def checked_material(scene: Scene, peer: str) -> Water | Sand:
    """Return the material of a scene that the plain solvers can simulate.

    Raises
    ------
    ConfigError
        The scene has several materials, another one than water or sand, obstacles, walls that differ, or
        walls less than three cells inside the world box.
    """
    material = scene.materials[0]
    if len(scene.materials) > 1 or not isinstance(material, Water | Sand) or scene.obstacles:
        raise ConfigError(
            f"the {peer} solver takes scenes of one material, water or sand, and without obstacles; "
            f"got {', '.join(m.kind for m in scene.materials)} and {len(scene.obstacles)} obstacles"
        )
    if scene.walls.faces is not None:
        raise ConfigError(f"the {peer} solver takes walls that are all alike; got walls.faces")
    lowest = min(math.floor(s * scene.resolution + 1e-6) for s in scene.walls.lower)
    highest = max(math.ceil(s * scene.resolution - 1e-6) for s in scene.walls.upper)
    if lowest < 2 or highest + 3 > scene.resolution:
        raise ConfigError(f"the {peer} solver takes walls three cells or more inside the world box")
    return material


def sand_constants(sand: Sand) -> tuple[float, float, float]:
    """Return the Lame parameters mu and lambda [Pa], and alpha of the yield surface of Drucker-Prager [-]."""
    e, nu = sand.youngs_modulus, sand.poisson_ratio
    sin = math.sin(math.radians(sand.friction_angle))
    return e / (2 * (1 + nu)), e * nu / ((1 + nu) * (1 - 2 * nu)), math.sqrt(2 / 3) * 2 * sin / (3 - sin)
