"""`chosen`: the particles that a sketch is to move."""

from collections.abc import Mapping
from typing import Any, TypeAlias

import numpy as np
import numpy.typing as npt

from hybridmpm._support.arguments import whole
from hybridmpm._support.suggestions import did_you_mean
from hybridmpm.coarse.merging import merge
from hybridmpm.control.sketch.polyline import arc_lengths, evenly_spaced
from hybridmpm.control.sketch.sketch import Arrow, Ellipse, Shape, Sketch
from hybridmpm.control.sketch.solid import Solid
from hybridmpm.control.sketch.strokes import parse_strokes
from hybridmpm.errors import ConfigError
from hybridmpm.scene.particle_types import GOOP, LIQUID, SAND, WATER
from hybridmpm.scene.sampling import sample
from hybridmpm.simulator import Simulator

Who: TypeAlias = int | str | Sketch | Mapping[str, Any]
"""Particles by their body, their material, or a stroke over them; `prepare` documents the forms."""

MATERIALS = {"water": WATER, "sand": SAND, "elastic": GOOP, "liquid": LIQUID}
"""Particle types by the names of the materials."""
_SAME = 1 + 1e-6
"""Largest ratio of two spacings that are the same but for rounding."""
_REACH = 0.02
"""Distance within which a line chooses particles, over the longest side of the world."""
_FORMS = 'must be the index of a body, "water", "sand", "elastic", "liquid", a stroke or {"particle": number}'


def chosen(simulator: Simulator, who: Who | npt.NDArray[np.uint64]) -> npt.NDArray[np.bool_]:
    """Return which of the present particles of a simulator are chosen, (N,); an array contains their numbers.

    Raises
    ------
    ConfigError
        `who` has none of the forms, or no particle is chosen.
    SketchError
        A stroke is out of range.
    """
    if isinstance(who, np.ndarray):
        return np.isin(simulator.ids, who)
    if isinstance(who, str):
        if who not in MATERIALS:
            raise ConfigError(f"who {_FORMS}, got {who!r}{did_you_mean(who, tuple(MATERIALS))}")
        found = simulator.materials == MATERIALS[who]
    elif isinstance(who, Arrow | Ellipse | Shape | Solid):
        found = _under(who, simulator)
    elif isinstance(who, Mapping):
        found = (
            _of_body(simulator, _body_of(simulator, who["particle"]))
            if set(who) == {"particle"}
            else _under(parse_strokes([who], simulator.scene.size), simulator)
        )
    elif isinstance(who, int | np.integer) and not isinstance(who, bool):
        found = _of_body(simulator, whole("who", who, 0, max(0, len(simulator.scene.bodies) - 1)))
    else:
        raise ConfigError(f"who {_FORMS}, got {who!r}")
    if not found.any():
        name = "the stroke" if isinstance(who, Arrow | Ellipse | Shape | Solid) else repr(who)
        raise ConfigError(f"who: {name} chooses none of the {simulator.particle_count} particles")
    return np.asarray(found)


def _bodies(simulator: Simulator) -> npt.NDArray[np.int32]:
    """Return the body of each particle of the start, by its number."""
    particles = sample(simulator.scene)
    # Merged particles are fewer only where they are shown themselves.
    shows_all = simulator.particle_spacing < _SAME * simulator.scene.spacing
    return (particles if shows_all else merge(particles, simulator.r_p)).body


def _body_of(simulator: Simulator, particle: Any) -> int:
    """Return the body that a particle belongs to; -1 where an emitter made it."""
    bodies = _bodies(simulator)
    number = whole("particle", particle, 0, 2**63 - 1)
    return int(bodies[number]) if number < len(bodies) else -1


def _of_body(simulator: Simulator, body: int) -> npt.NDArray[np.bool_]:
    """Return which particles belong to a body (N,); those of emitters belong to -1."""
    bodies = np.append(_bodies(simulator), np.int32(-1))
    return np.asarray(bodies[np.minimum(simulator.ids, len(bodies) - 1)] == body)


def _under(stroke: Sketch, simulator: Simulator) -> npt.NDArray[np.bool_]:
    """Return which particles lie in an oval, a shape or a solid, or near to a line, (N,)."""
    if isinstance(stroke, Solid):
        return stroke.covers(simulator.positions.astype(np.float64))
    x, reach = simulator.positions.astype(np.float64)[:, :2], _REACH * max(simulator.scene.size)
    if isinstance(stroke, Arrow):
        count = 2 + int(2 * arc_lengths(stroke.points)[-1] / reach)
        line = evenly_spaced(stroke.points, count)
        found = np.zeros(len(x), dtype=bool)
        for point in line:
            found |= ((x - point) ** 2).sum(axis=1) <= reach**2
        return found
    if isinstance(stroke, Shape):
        return stroke.covers(x)
    cos, sin = np.cos(stroke.angle), np.sin(stroke.angle)
    local = (x - stroke.center) @ np.array([[cos, -sin], [sin, cos]]) / stroke.axes
    return np.asarray((local**2).sum(axis=1) <= 1)
