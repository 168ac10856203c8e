"""`threaded`: a fluid drawn out along its way, so that it passes a gap that is narrower than the fluid."""

import dataclasses
import itertools

import numpy as np

from hybridmpm import _core
from hybridmpm.control.goal.bends import Bends
from hybridmpm.control.goal.cloud import Cloud, Floats
from hybridmpm.control.goal.paths import Paths
from hybridmpm.control.goal.region import Region
from hybridmpm.control.goal.room import RoomGrid

_WIDTHS = (0.75, 0.55, 0.4, 0.3)
"""Widths over that of the disc at the tip that are tried, the widest first."""
_SMOOTHED = 2.0
"""Length over which corners are rounded, over the half-width of the thread."""
_POINTS = 256
"""Number of points of the way."""
_PIECE = 0.05
"""Distance of the corners of a group's path, at least, over the longest side of the world."""
_GRADUAL = 0.2
"""Length over which a group takes up the speed of the thread, and gives it up again, likewise."""
_MOST = 40
"""Largest number of corners of a group's path."""


def threaded(
    way: Floats, cloud: Cloud, region: Region, body: Bends, grid: RoomGrid
) -> tuple[Paths, Floats] | None:
    """Return paths on which a fluid is drawn out along its way and gathers at the tip, and the way; or None.

    Groups keep their order: those that are in front at the start are in front at the tip. Each goes along the
    way at its distance in front of the middle, stretched, and beside it, narrowed, with the same volume.

    Parameters
    ----------
    way : (M, D)
        Path of the centre of mass [m].
    cloud : Cloud
    region : Region
        Region at the tip.
    body : Bends
        The region's particles about the centre of mass.
    grid : RoomGrid
    """

    def around(width: float) -> Floats | None:
        thin = Bends(body.room, width * body.offset, 0 * body.offset)
        inward = thin.within(way)
        return thin.around(way if inward is None else inward, grid)

    # Most of those that cannot pass at all are found out by the thinnest.
    if (found := around(_WIDTHS[-1])) is None:
        return None
    width = _WIDTHS[-1]
    for wider in _WIDTHS[:-1]:
        if (way_round := around(wider)) is not None:
            width, found = wider, way_round
            break
    half = width * float(np.linalg.norm(body.offset, axis=1).max())
    line = _even(_rounded(_even(found), _SMOOTHED * half))
    frames = _frames(_rounded(line, 4 * half))
    turned = (cloud.x - cloud.centroid) @ frames[0].T @ frames[-1] + way[-1]
    matched = _core.match_to_region(np.ascontiguousarray(turned), region.cells)
    straight = Paths.straight(cloud, matched.places, matched.group)
    start, end = straight.corners.reshape(-1, 2, cloud.dim).swapaxes(0, 1)
    length = float(np.linalg.norm(np.diff(line, axis=0), axis=1).sum())
    before, after = (start - line[0]) @ frames[0].T, (end - line[-1]) @ frames[-1].T
    # Places of the groups along the way at the start and at the end, and in front of the middle between.
    least, most = before[:, 0], np.maximum(before[:, 0], length + after[:, 0])
    ahead = after[:, 0] / width ** (cloud.dim - 1)
    gradual, piece = _GRADUAL * body.room.unit, _PIECE * body.room.unit
    first, last = (least - ahead).min() - gradual, (most - ahead).max() + gradual
    middle = np.linspace(first, last, min(_MOST, max(3, int((last - first) / piece))))
    place = least[:, None] + _ramp(middle + (ahead - least)[:, None], gradual)[:, 1:-1]
    place = most[:, None] - _ramp(most[:, None] - place, gradual)
    radius = half / width
    left = np.clip((place - least[:, None]) / radius, 0, 1)[..., None]
    near = np.clip((most[:, None] - place) / radius, 0, 1)[..., None]
    beside = (1 - left) * before[:, None, 1:] + left * (1 - near * (1 - width)) * after[:, None, 1:]
    index = np.clip(np.round(place / length * (len(line) - 1)), 0, len(line) - 1).astype(int)
    beyond = (place - np.clip(place, 0, length))[..., None] * frames[index][:, :, 0]
    inner = line[index] + beyond + np.einsum("gkm,gkmd->gkd", beside, frames[index][:, :, 1:])
    corners = np.concatenate([start[:, None], inner, end[:, None]], axis=1)
    corners = np.clip(corners, body.room.lower, body.room.upper)
    starts = corners.shape[1] * np.arange(len(start) + 1, dtype=np.uint32)
    paths = Paths.of_groups(
        cloud,
        matched.places,
        matched.group,
        starts,
        corners.reshape(-1, cloud.dim),
        cut_off=straight.cut_off,
        together=True,
    )
    pace = np.zeros((len(middle), cloud.dim))
    pace[:, 0] = middle
    return dataclasses.replace(paths, pace=pace), found


def _ramp(x: Floats, gradual: float) -> Floats:
    """Return `x` where it is well above 0, and 0 where it is well below; it changes over a length."""
    return np.asarray(gradual / 2 * np.logaddexp(0, 2 * x / gradual))


def _even(line: Floats) -> Floats:
    """Return `_POINTS` points at equal distances along a line (M, D)."""
    lengths = np.append(0, np.cumsum(np.linalg.norm(np.diff(line, axis=0), axis=1)))
    places = np.linspace(0, lengths[-1], _POINTS)
    return np.stack([np.interp(places, lengths, along) for along in line.T], axis=1)


def _rounded(line: Floats, length: float) -> Floats:
    """Return a line (M, D) whose points are means over a length [m] of it; its ends stay."""
    reach = max(1, int(length * len(line) / np.linalg.norm(np.diff(line, axis=0), axis=1).sum() / 2))
    padded = np.concatenate([np.repeat(line[:1], reach, 0), line, np.repeat(line[-1:], reach, 0)])
    total = np.cumsum(np.concatenate([np.zeros((1, line.shape[1])), padded]), axis=0)
    mean = (total[2 * reach + 1 :] - total[: -2 * reach - 1]) / (2 * reach + 1)
    mean[[0, -1]] = line[[0, -1]]
    return np.asarray(mean)


def _frames(line: Floats) -> Floats:
    """Return for each point of a line (M, D) its direction and what is beside it, as rows (M, D, D).

    From one point to the next the frame is turned no more than the direction.
    """
    along = np.gradient(line, axis=0)
    along /= np.maximum(np.linalg.norm(along, axis=1, keepdims=True), 1e-12)
    frame = np.linalg.qr(np.column_stack([along[0], np.eye(line.shape[1])]))[0].T
    frame[0] = along[0]
    frames = [frame]
    for before, after in itertools.pairwise(along):
        both = before + after
        turn = 2 * np.outer(after, before) - np.outer(both, both) / max(1 + float(before @ after), 1e-6)
        frames.append(frames[-1] @ (np.eye(len(before)) + turn).T)
        frames[-1][0] = after
    return np.array(frames)
