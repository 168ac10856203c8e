"""Finding about matter that is fast for its own sound speed, so that impacts compress it."""

import math
from collections.abc import Iterator

import numpy as np

from hybridmpm.checking.report import Finding
from hybridmpm.scene import Material, Sand, Scene
from hybridmpm.scene.fields import Points

FAST = 0.5
"""Warn from this impact speed on [sound speeds]: water then loses half of its volume."""
FAILS = 4.0
"""Warn that frames may fail from this impact speed of an elastic body on [sound speeds]."""
_CLOSE = 1e-6
"""Distance below which a body lies on the floor [m]."""


def of_speed(scene: Scene) -> Iterator[Finding]:
    """Yield a finding for each material that may be hit at half of its sound speed or more."""
    for material in scene.materials:
        sound = material.to_native(scene.potential_drop or 1.0).sound_speed
        speed = impact_speed(scene, material)
        if speed < FAST * sound:
            continue
        loss = expected_compression(material, speed / sound)
        failed = " or end in an error" if speed >= FAILS * sound else ""
        torn = f", and may tear it{failed}" if material.kind == "elastic" and speed > sound else ""
        yield Finding(
            severity="warning",
            field=scene.made_of(material),
            problem=f"{material.kind} may hit something at {speed:.2g} m/s, {speed / sound:.2g} of its sound "
            f"speed: that compresses it by {loss:.0%} where it hits{torn}",
            advice=f"make it {(speed / sound / FAST) ** 2:.2g} times as stiff, or lower the speeds",
        )


def expected_compression(material: Material, speed: float) -> float:
    """Return the relative loss of volume [-] behind the shock of an impact at `speed` [sound speeds].

    Behind a shock of speed U a material of modulus K has lost v / U of its volume, by mass, and bears
    rho U v = K v / U, by momentum. So U is the sound speed. The grid allows nine tenths at most. Sand is
    linear in the logarithm of its volume.
    """
    return 1 - math.exp(-speed) if isinstance(material, Sand) else min(speed, 0.9)


def impact_speed(scene: Scene, material: Material) -> float:
    """Return the largest speed [m/s] at which a material may be hit or hit a wall.

    It has the speed at which a body starts or leaves an emitter, with what it gains in falling to the floor,
    or that of an obstacle or of another body, which moves it by its share of both impedances.
    """
    mine = material.to_native(scene.potential_drop or 1.0)
    impedance = mine.density * mine.sound_speed
    room = scene.walls.lower, scene.walls.upper
    fastest = max((obstacle.largest_speed(room) for obstacle in scene.obstacles), default=0.0)
    for part in (*scene.bodies, *scene.emitters):
        speed = _speed_at_floor(scene, part.velocity or (0.0,) * scene.dim, part.bounds)
        if part.material != material:
            other = part.material.to_native(scene.potential_drop or 1.0)
            speed /= 1 + impedance / (other.density * other.sound_speed)
        fastest = max(fastest, speed)
    return fastest


def _speed_at_floor(scene: Scene, velocity: tuple[float, ...], bounds: tuple[Points, Points]) -> float:
    """Return the speed [m/s] of a body at the end of its fall to the wall that gravity points to."""
    gravity = np.array(scene.gravity)
    floor = np.maximum(gravity * scene.walls.lower, gravity * scene.walls.upper)
    lowest = np.maximum(gravity * bounds[0], gravity * bounds[1])
    drop = max(float((floor - lowest).sum()), 0.0)
    speed_squared = float(np.square(velocity).sum())
    lies = drop <= _CLOSE * float(np.abs(gravity).max())
    return float(np.sqrt(speed_squared + (0.0 if lies else 2 * drop)))
