"""Closed surfaces of triangles: faults, volume, and which points are inside."""

from collections.abc import Iterator

import numpy as np
import numpy.typing as npt

from hybridmpm import _core
from hybridmpm.scene.fields import Fault, Points

Triangles = npt.NDArray[np.int64]
"""Indices (T, 3) of vertices."""

MAX_TRIANGLES = 200_000
_NAMED = 3
"""Number of open edges that a message names."""
_MOST_CELLS = 1024
"""Most cells along an axis of the grid in which points are sorted."""
_PAIRS_AT_ONCE = 2_000_000
"""Number of pairs of a triangle and a point that are tested at once, which bounds the memory."""
_TRIED, _MOST_TRIED = 24, 4000
"""Triangles of a part, and of all parts, whose two sides are looked at."""
_RAYS = 256
"""Rays along an axis across a surface that crosses itself."""


def _edges(triangles: Triangles) -> tuple[Triangles, Triangles, npt.NDArray[np.bool_]]:
    """Return edges (E, 2) of triangles (T, 3); for each side (3 T,) its edge, and whether it runs upwards."""
    sides = np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]])
    # One number for both ends, since rows are sorted ten times as slowly.
    count = int(triangles.max()) + 1
    number, edge = np.unique(np.sort(sides, axis=1) @ [count, 1], return_inverse=True)
    ends = np.stack([number // count, number % count], axis=-1)
    return ends, edge, sides[:, 0] < sides[:, 1]


def open_edges(triangles: Triangles) -> int:
    """Return the number of edges at which an odd number of triangles (T, 3) meet."""
    ends, edge, _ = _edges(triangles)
    return int((np.bincount(edge, minlength=len(ends)) % 2).sum())


def faults(vertices: Points, triangles: Triangles) -> list[Fault]:
    """List why triangles (T, 3) of vertices (V, 3) enclose nothing: open edges come first."""
    ends, side, upwards = _edges(triangles)
    forward = np.bincount(side, upwards, len(ends))
    uses = np.bincount(side, minlength=len(ends))
    bad = np.flatnonzero(uses % 2 == 1)
    if len(bad):
        named = "; ".join(_edge(vertices, ends[edge]) for edge in bad[:_NAMED])
        more = f" and {len(bad) - _NAMED} more" if len(bad) > _NAMED else ""
        text = f"must be closed, but have {len(bad)} open edges: {named}{more}; close the holes"
        return [(("triangles",), text)]
    bad = np.flatnonzero(2 * forward != uses)
    if len(bad):
        text = f"must turn the same way round, but not those at {_edge(vertices, ends[bad[0]])}"
        return [(("triangles",), text)]
    if not abs(volume(vertices, triangles)) > 0:
        return [(("triangles",), "must enclose a volume")]
    part, _ = _parts(triangles)
    ways = _outwards(vertices, triangles, part)[part]
    if ways.min() == -1 and ways.max() == 1:
        # The outermost part has the lowest place.
        lowest = vertices[triangles].min(axis=(1, 2)).argmin()
        place = _place(vertices, triangles[ways == -ways[lowest]][0, 0])
        text = "must turn outwards, in holes into the hole, but those of the part at "
        return [(("triangles",), f"{text}{place} turn against the others; reverse their corners")]
    return []


def _edge(vertices: Points, ends: npt.NDArray[np.int64]) -> str:
    places = " to ".join(_place(vertices, end) for end in ends)
    return f"vertices {ends[0]} and {ends[1]}, {places} m"


def _place(vertices: Points, vertex: np.int64) -> str:
    return "({:.4g}, {:.4g}, {:.4g})".format(*vertices[vertex])


def volume(vertices: Points, triangles: Triangles) -> float:
    """Return the volume inside [m^3] by the divergence theorem; below 0 where the surface is inside out."""
    a, b, c = (vertices[triangles[:, corner]] - vertices[0] for corner in range(3))
    return float(np.einsum("ij,ij->", a, np.cross(b, c))) / 6


def inside(vertices: Points, triangles: Triangles) -> float:
    """Return the volume inside [m^3] by the even-odd rule; to 0.1 % where the surface crosses itself."""
    if crossing(vertices, triangles) is None:
        return abs(volume(vertices, triangles))
    low, high = vertices.min(axis=0), vertices.max(axis=0)
    axes = [low[axis] + (high - low)[axis] * (np.arange(_RAYS) + 0.5) / _RAYS for axis in range(2)]
    rays = np.stack([*np.meshgrid(*axes, indexing="ij"), np.zeros((_RAYS, _RAYS))], axis=-1).reshape(-1, 3)
    found = [
        (ray, _height(corners, normal, rays[ray]))
        for corners, normal, ray in _crossed(vertices, triangles, rays)
    ]
    ray, height = (np.concatenate(part) for part in zip(*found, strict=True))
    order = np.lexsort((height, ray))
    # What closes crosses each ray an even number of times.
    length = np.diff(height[order].reshape(-1, 2), axis=1).sum()
    return float(length * np.prod((high - low)[:2]) / len(rays))


def _height(corners: Points, normal: Points, rays: Points) -> Points:
    """Return where planes of triangles are crossed by rays along z (K,) [m]."""
    offset = rays[:, :2] - corners[:, 0, :2]
    return np.asarray(corners[:, 0, 2] - (normal[:, :2] * offset).sum(axis=1) / normal[:, 2])


def turned_out(vertices: Points, triangles: Triangles) -> Triangles:
    """Return triangles (T, 3) of a closed surface, those turned that are seen clockwise from outside.

    What is outside follows the even-odd rule, so that a part within another one bounds a hole. Parts that
    have no two sides stay as they are.
    """
    part, turned = _parts(triangles)
    found = np.where(turned[:, None], triangles[:, ::-1], triangles)
    inwards = _outwards(vertices, found, part)[part] < 0
    return np.where(inwards[:, None], found[:, ::-1], found)


def _outwards(vertices: Points, triangles: Triangles, part: npt.NDArray[np.int64]) -> Points:
    """Return for parts of a surface how much of them turns outwards (T,): from -1, all inwards, to 1."""
    a, b, c = (vertices[triangles[:, corner]] for corner in range(3))
    normal = np.cross(b - a, c - a)
    size = np.linalg.norm(normal, axis=1)
    # The largest triangles of each part tell.
    order = np.lexsort((-size, part))
    first = np.searchsorted(part[order], part[order])
    tried = np.clip(_MOST_TRIED // np.count_nonzero(np.bincount(part)), 1, _TRIED)
    some = order[(np.arange(len(order)) - first < tried) & (size[order] > 0)]
    step = normal[some] / size[some, None] * (1e-6 * np.ptp(vertices, axis=0).max())
    middle = (a + b + c)[some] / 3
    outer, inner = np.split(contains(vertices, triangles, np.concatenate([middle + step, middle - step])), 2)
    counted = [np.bincount(part[some], size[some] * one, len(triangles)) for one in (1.0, outer, inner)]
    return np.asarray((counted[2] - counted[1]) / np.maximum(counted[0], 1e-300))


def _parts(triangles: Triangles) -> tuple[npt.NDArray[np.int64], npt.NDArray[np.bool_]]:
    """Return for each triangle the first one of its part, and whether it is turned against that one (T,).

    Triangles are of one part where edges join them that only two triangles have.
    """
    count = len(triangles)
    _, edge, upwards = _edges(triangles)
    order = np.argsort(edge, kind="stable")
    start = np.flatnonzero(np.bincount(edge)[edge[order]] == 2)[::2]
    one, other = order[start], order[start + 1]
    # Node t is triangle t as it is, node t + count the same turned round.
    against = np.where(upwards[one] == upwards[other], count, 0)
    one, other = one % count, other % count
    ends = np.stack(
        [np.concatenate([one, one + count]), np.concatenate([other + against, other + count - against])]
    )
    label = np.arange(2 * count)
    while True:
        low, high = np.sort(label[ends], axis=0)
        if (low == high).all():
            break
        np.minimum.at(label, high, low)
        while not (label[label] == label).all():
            label = label[label]
    as_it_is, turned = label[:count], label[count:]
    return np.minimum(as_it_is, turned) % count, turned < as_it_is


def centroid(vertices: Points, triangles: Triangles) -> Points:
    """Return the centre (3,) of the volume inside [m]."""
    a, b, c = (vertices[triangles[:, corner]] - vertices[0] for corner in range(3))
    parts = np.einsum("ij,ij->i", a, np.cross(b, c))
    return np.asarray(vertices[0] + parts @ (a + b + c) / (4 * parts.sum()))


def crossing(vertices: Points, triangles: Triangles) -> list[float] | None:
    """Return a point (3,) where triangles without a common corner cross [m]; None where none do."""
    return _core.Obstacle.mesh(vertices.astype(np.float32), triangles.astype(np.uint32)).crossing()


def outlines(vertices: Points, triangles: Triangles) -> list[Points]:
    """Return the closed lines (K, 2) [m] seen along z where the surface turns away."""
    a, b, c = (vertices[triangles[:, corner], :2] for corner in range(3))
    ab, ac = b - a, c - a
    front = triangles[ab[:, 0] * ac[:, 1] > ab[:, 1] * ac[:, 0]]
    edges = np.sort(np.concatenate([front[:, [0, 1]], front[:, [1, 2]], front[:, [2, 0]]]), axis=1)
    ends, uses = np.unique(edges, axis=0, return_counts=True)
    # An odd number of edges of the front ends nowhere: an even number of them meets at each vertex.
    ways: dict[int, list[int]] = {}
    for one, other in ends[uses % 2 == 1].tolist():
        ways.setdefault(one, []).append(other)
        ways.setdefault(other, []).append(one)
    lines = []
    for start in list(ways):
        while ways[start]:
            line = [start]
            while True:
                after = ways[line[-1]].pop()
                ways[after].remove(line[-1])
                if after == start:
                    break
                line.append(after)
            lines.append(vertices[line, :2])
    return lines


def coarser(vertices: Points, triangles: Triangles, most: int) -> tuple[Points, Triangles]:
    """Return a surface of at most so many triangles that looks alike: vertices in one cell become one.

    It may cross itself, and is for pictures alone. One of few triangles is returned as it is.
    """
    lower, cells = vertices.min(axis=0), 64
    kept, corners = vertices, triangles
    while len(corners) > most:
        side = np.ptp(vertices, axis=0).max() / cells
        number = ((vertices - lower) / side).astype(np.int64) @ (cells + 1) ** np.arange(3)
        _, cell = np.unique(number, return_inverse=True)
        kept = np.stack([np.bincount(cell, x) for x in vertices.T], axis=-1) / np.bincount(cell)[:, None]
        corners = cell[triangles]
        corners = corners[(corners != np.roll(corners, 1, axis=1)).all(axis=1)]
        number = np.sort(corners, axis=1) @ len(kept) ** np.arange(3)
        corners, cells = corners[np.sort(np.unique(number, return_index=True)[1])], cells * 3 // 4
    return kept, corners


def area(vertices: Points, triangles: Triangles) -> float:
    """Return the area of the surface [m^2]."""
    a, b, c = (vertices[triangles[:, corner]] for corner in range(3))
    return float(np.linalg.norm(np.cross(b - a, c - a), axis=1).sum()) / 2


def thickness(vertices: Points, triangles: Triangles) -> float:
    """Return the height [m] of the square plate, at most a cube, with this volume and area of the surface."""
    inside, outside = abs(volume(vertices, triangles)), area(vertices, triangles)
    low, high = 0.0, inside ** (1 / 3)
    for _ in range(60):
        middle = (low + high) / 2
        # A plate of this height; the thinner it is, the larger is its surface.
        if 2 * inside / middle + 4 * np.sqrt(inside * middle) > outside:
            low = middle
        else:
            high = middle
    return float(high)


def tests_of_a_point(vertices: Points, triangles: Triangles) -> float:
    """Return the mean number of triangles that `contains` tests a point against."""
    flat = vertices[triangles][:, :, :2]
    rectangles = np.prod(flat.max(axis=1) - flat.min(axis=1), axis=1).sum()
    return 1.0 + float(rectangles / np.prod(np.ptp(flat.reshape(-1, 2), axis=0)))


def contains(vertices: Points, triangles: Triangles, x: Points) -> npt.NDArray[np.bool_]:
    """Return whether points (N, 3) are inside: where a ray along z crosses an odd number of triangles."""
    odd = np.zeros(len(x), dtype=bool)
    for corners, normal, crossed in _crossed(vertices, triangles, x):
        offset = x[crossed] - corners[:, 0]
        with np.errstate(divide="ignore", invalid="ignore"):
            above = (normal * offset).sum(axis=1) / normal[:, 2] < 0
        odd ^= np.bincount(crossed[above], minlength=len(x)) % 2 == 1
    return odd


def raster(
    vertices: Points, triangles: Triangles, lower: Points, side: float, counts: npt.NDArray[np.int64]
) -> npt.NDArray[np.bool_]:
    """Return which of cubes of a side [m] from `lower` (3,) on have their centre inside; (X, Y, Z)."""
    x, y = (lower[axis] + side * (np.arange(counts[axis]) + 0.5) for axis in range(2))
    rays = np.stack([*np.meshgrid(x, y, indexing="ij"), np.zeros((len(x), len(y)))], axis=-1).reshape(-1, 3)
    ends = np.zeros((len(rays), int(counts[2]) + 1), dtype=np.int64)
    for corners, normal, ray in _crossed(vertices, triangles, rays):
        height = _height(corners, normal, rays[ray])
        # From the first centre above it on, everything changes sides.
        above = np.clip(np.ceil((height - lower[2]) / side - 0.5), 0, counts[2]).astype(np.int64)
        np.add.at(ends, (ray, above), 1)
    inside = np.cumsum(ends[:, :-1], axis=1) % 2 == 1
    return np.asarray(inside.reshape(counts))


def _crossed(
    vertices: Points, triangles: Triangles, x: Points
) -> Iterator[tuple[Points, Points, npt.NDArray[np.int64]]]:
    """Yield triangles that rays along z through points (N, 3) cross: corners, normals, indices of points."""
    for triangle, point in _near(vertices, triangles, x):
        corners = vertices[triangles[triangle]]
        px, py = x[point, 0], x[point, 1]
        within = np.zeros(len(point), dtype=bool)
        for one, other in ((0, 1), (1, 2), (2, 0)):
            # An edge has the same rounding in both of its triangles, so that no ray passes between them.
            swap = triangles[triangle, one] > triangles[triangle, other]
            a = np.where(swap[:, None], corners[:, other], corners[:, one])
            b = np.where(swap[:, None], corners[:, one], corners[:, other])
            with np.errstate(divide="ignore", invalid="ignore"):
                across = a[:, 0] + (py - a[:, 1]) * (b[:, 0] - a[:, 0]) / (b[:, 1] - a[:, 1])
            within ^= ((a[:, 1] <= py) != (b[:, 1] <= py)) & (px < across)
        corners, crossed = corners[within], point[within]
        yield corners, np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), crossed


def _near(
    vertices: Points, triangles: Triangles, x: Points
) -> Iterator[tuple[npt.NDArray[np.int64], npt.NDArray[np.int64]]]:
    """Yield pairs of triangles and points whose places along x and y may agree, as two arrays of indices."""
    if not len(x):
        return
    lower, upper = x[:, :2].min(axis=0), x[:, :2].max(axis=0)
    count = int(np.clip(np.sqrt(len(x)), 1, _MOST_CELLS))
    size = np.maximum(upper - lower, 1e-12) / count
    cells = np.minimum(((x[:, :2] - lower) / size).astype(np.int64), count - 1)
    cell = cells[:, 0] * count + cells[:, 1]
    order = np.argsort(cell, kind="stable")
    first = np.searchsorted(cell[order], np.arange(count * count + 1))
    flat = vertices[triangles][:, :, :2]
    least, most = flat.min(axis=1), flat.max(axis=1)
    # Rounding keeps the order of places, so that the cells of a triangle have all points within its bounds.
    start = np.clip(np.floor((least - lower) / size), 0, count - 1).astype(np.int64)
    stop = np.clip(np.floor((most - lower) / size), 0, count - 1).astype(np.int64) + 1
    apart = (most < lower).any(axis=1) | (least > upper).any(axis=1)
    rows = np.where(apart, 0, stop[:, 0] - start[:, 0])
    owner = np.repeat(np.arange(len(triangles)), rows)
    row = start[owner, 0] + _counted(rows)
    # The cells of a row follow each other, and so do their points.
    begin = first[row * count + start[owner, 1]]
    points = first[row * count + stop[owner, 1]] - begin
    ends = np.cumsum(points)
    if not len(ends) or not ends[-1]:
        return
    cuts = np.searchsorted(ends, np.arange(0, int(ends[-1]), _PAIRS_AT_ONCE), side="right")
    for low, high in zip(cuts, [*cuts[1:], len(points)], strict=True):
        some = points[low:high]
        triangle = np.repeat(owner[low:high], some)
        point = order[np.repeat(begin[low:high], some) + _counted(some)]
        px, py = x[point, 0], x[point, 1]
        near = (px >= least[triangle, 0]) & (px <= most[triangle, 0])
        near &= (py >= least[triangle, 1]) & (py <= most[triangle, 1])
        yield triangle[near], point[near]


def _counted(lengths: npt.NDArray[np.int64]) -> npt.NDArray[np.int64]:
    """Return 0, 1, ... for each of some runs of these lengths, one after another."""
    ends = np.cumsum(lengths)
    return np.arange(int(ends[-1]) if len(ends) else 0) - np.repeat(ends - lengths, lengths)
