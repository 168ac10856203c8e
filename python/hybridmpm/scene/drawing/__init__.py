"""A scene as a drawing: its walls, bodies, obstacles and openings as SVG, 3D scenes seen from the front."""

import math
from collections.abc import Iterable, Sequence

from hybridmpm.scene.bodies import Body
from hybridmpm.scene.facets import MeshShape, PolygonShape
from hybridmpm.scene.obstacles import Obstacle
from hybridmpm.scene.openings import Emitter, Sink
from hybridmpm.scene.rigid import Rigid, RigidBody
from hybridmpm.scene.shapes import BallShape, BoxShape, CylinderShape
from hybridmpm.scene.walls import Walls

_MARGIN = 0.024
"""Distance of the walls from the edge of the drawing [m]."""
_MOST_TRIANGLES = 4000
"""Largest number of triangles that a drawing shows one by one."""
_COLORS = {"water": "#1b7fe0", "sand": "#d1a15a", "elastic": "#3aa05a", "liquid": "#c9822a"}
_RIGID = "#b8763d"
_OUTSIDE, _INSIDE, _WALL, _SOLID, _OPENING = "#060912", "#0f1b30", "#4d6185", "#78859c", "#d9e4f5"


def svg(
    walls: Walls,
    bodies: Iterable[Body],
    solids: Iterable[Obstacle | RigidBody],
    openings: Iterable[Emitter | Sink],
    width: int,
) -> str:
    """Return a drawing of the front view, x to the right and y up.

    Moving obstacles are drawn where they are at the start, and emitters and sinks as dashed boxes.

    Parameters
    ----------
    walls : Walls
    bodies, solids, openings
        What is drawn.
    width : int
        Width of the drawing [pixels].
    """
    (left, bottom), (right, top) = walls.lower[:2], walls.upper[:2]
    wide, high = right - left + 2 * _MARGIN, top - bottom + 2 * _MARGIN
    far = math.ceil(max(right, top)) + 1
    room = f"M{left:.4g} {bottom:.4g}H{right:.4g}V{top:.4g}H{left:.4g}Z"
    parts = [
        _rectangle(walls.lower, walls.upper, f'fill="{_INSIDE}"'),
        *(_shape(body, f'fill="{_COLORS[body.material.kind]}"') for body in bodies),
        *(_rigid(solid) if isinstance(solid, Rigid) else _obstacle(solid) for solid in solids),
        # Obstacles may reach through the walls, where nothing of them matters.
        f'<path d="M-1 -1H{far}V{far}H-1Z{room}" fill="{_OUTSIDE}" fill-rule="evenodd"/>',
        f'<path d="{room}" fill="none" stroke="{_WALL}" stroke-width="0.004"/>',
        *(_opening(opening) for opening in openings),
    ]
    box = f"{left - _MARGIN:.4g} {-top - _MARGIN:.4g} {wide:.4g} {high:.4g}"
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{width}" height="{round(width * high / wide)}" '
        f'viewBox="{box}"><g transform="scale(1 -1)">{"".join(parts)}</g></svg>'
    )


def _shape(shape: BoxShape | BallShape | CylinderShape | PolygonShape | MeshShape, style: str) -> str:
    match shape:
        case PolygonShape():
            return _polygon(shape, style)
        case BallShape():
            return _circle(shape.center, shape.radius, style)
        case CylinderShape():
            return _cylinder(shape.start, shape.end, shape.radius, style)
        case MeshShape():
            return _mesh(shape, style)
    return _rectangle(shape.lower, shape.upper, style)


def _obstacle(obstacle: Obstacle) -> str:
    style = f'fill="{_SOLID}"'
    if obstacle.shape == "segment":
        (ax, ay), (bx, by) = obstacle.start[:2], obstacle.end[:2]
        ends = f'x1="{ax:.4g}" y1="{ay:.4g}" x2="{bx:.4g}" y2="{by:.4g}"'
        width = f'stroke-width="{obstacle.thickness:.4g}"'
        return f'<line {ends} {width} stroke="{_SOLID}" stroke-linecap="round"/>'
    if obstacle.shape == "half_space":
        return _half_space(obstacle.point, obstacle.normal, style)
    return _shape(obstacle, style)


def _polygon(polygon: PolygonShape, style: str) -> str:
    corners = " ".join(f"{x:.4g},{y:.4g}" for x, y in polygon.vertices)
    return f'<polygon points="{corners}" fill-rule="evenodd" {style}/>'


def _mesh(mesh: MeshShape, style: str) -> str:
    """Return the triangles that face the viewer."""
    vertices, triangles = mesh.coarser(_MOST_TRIANGLES)
    corners = vertices[triangles]
    one, other = (corners[:, k, :2] - corners[:, 0, :2] for k in (1, 2))
    facing = corners[one[:, 0] * other[:, 1] - one[:, 1] * other[:, 0] > 0, :, :2]
    lines = "".join(f"M{'L'.join(f'{x:.4g} {y:.4g}' for x, y in corner)}Z" for corner in facing.tolist())
    return f'<path d="{lines}" {style}/>'


def _rigid(body: RigidBody) -> str:
    """Return the outline from the front: the hull of its corners, or a circle."""
    style = f'fill="{_RIGID}"'
    if body.shape == "ball":
        return _circle(body.center, body.radius, style)
    corners = " ".join(f"{x:.4g},{y:.4g}" for x, y in body.outline())
    return f'<polygon points="{corners}" {style}/>'


def _cylinder(start: Sequence[float], end: Sequence[float], radius: float, style: str) -> str:
    """Return the outline from the front: a rectangle between two ellipses, which are the ends."""
    across = math.hypot(end[0] - start[0], end[1] - start[1])
    angle = math.degrees(math.atan2(end[1] - start[1], end[0] - start[0]))
    flat = radius * abs(end[2] - start[2]) / math.dist(start, end)
    turn = f'transform="translate({start[0]:.4g} {start[1]:.4g}) rotate({angle:.4g})"'
    ends = "".join(f'<ellipse cx="{x:.4g}" cy="0" rx="{flat:.4g}" ry="{radius:.4g}"/>' for x in (0.0, across))
    side = f'<rect x="0" y="{-radius:.4g}" width="{across:.4g}" height="{2 * radius:.4g}"/>'
    return f"<g {turn} {style}>{side}{ends}</g>"


def _half_space(point: Sequence[float], normal: Sequence[float], style: str) -> str:
    """Return a rectangle, larger than the world, on the solid side; nothing where it faces the viewer."""
    size = math.hypot(*normal[:2])
    if size < 1e-6:
        return ""
    angle = math.degrees(math.atan2(normal[1], normal[0]))
    turn = f'transform="translate({point[0]:.4g} {point[1]:.4g}) rotate({angle:.4g})"'
    return f'<rect x="-9999" y="-9999" width="9999" height="19998" {turn} {style}/>'


def _opening(opening: Emitter | Sink) -> str:
    style = f'fill="none" stroke="{_OPENING}" stroke-width="0.004" stroke-dasharray="0.012 0.008"'
    if opening.shape == "ball":
        return _circle(opening.center, opening.radius, style)
    if opening.shape == "box":
        return _rectangle(opening.lower, opening.upper, style)
    lower, upper = opening.bounds
    return _rectangle(lower, upper, style)


def _rectangle(lower: Iterable[float], upper: Iterable[float], style: str) -> str:
    (left, bottom, *_), (right, top, *_) = lower, upper
    size = f'width="{right - left:.4g}" height="{top - bottom:.4g}"'
    return f'<rect x="{left:.4g}" y="{bottom:.4g}" {size} {style}/>'


def _circle(center: Sequence[float], radius: float, style: str) -> str:
    return f'<circle cx="{center[0]:.4g}" cy="{center[1]:.4g}" r="{radius:.4g}" {style}/>'
