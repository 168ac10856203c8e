"""Training samples of the Fluid ControlNet: states on the way to a true end, and the least force to it."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt
import torch
from torch import Tensor

from hybridmpm.control.goal.cloud import EARTH
from hybridmpm.control.goal.paths import SHORTEST_FRAMES
from hybridmpm.training.control.controlnet.cases import FRAMES, NodeCase
from hybridmpm.training.physics.network.edges import EdgeList
from hybridmpm.training.physics.windows import edges_of

_PUSHED = 0.8
"""Share of the samples that are pushed off their way, as pressure and the network's errors push a fluid."""
_OFF = 0.03
"""Standard deviation of how far a sample is pushed off its way [m]."""
_TURNED = 0.1
"""Standard deviation of how much it is turned, stretched and sheared [-]."""
_LOOSE = 0.003
"""Standard deviation of how far each node is pushed by itself [m]."""
_LOOSE_SPEED = 0.1
"""The same for its velocity [m/s]."""
_CLEAR = 0.02
"""Distance from a wall from which on the wall matters [m]."""
_CAP = 15.0
"""Largest force on a node [g]."""

Floats32 = npt.NDArray[np.float32]


@dataclass(frozen=True, kw_only=True)
class Batch:
    """B graphs of control nodes, N nodes in all."""

    x: Tensor
    """Positions (N, D) [m]."""
    v: Tensor
    """Velocities (N, D) [m/s]."""
    force: Tensor
    """Accelerations that are to be generated (N, D) [m/s^2]."""
    types: Tensor
    """Particle types, int64 (N,)."""
    walls: Tensor
    """Lower and upper corner of the walls (2, N, D) [m]."""
    step: Tensor
    """Control step over the number of steps (N, 1)."""
    seconds: Tensor
    """Time of control (N, 1) [s]."""
    gravity: Tensor
    """(N, D) [m/s^2]."""
    pictures: Tensor
    """Sketches (B, 3, 64, 64)."""
    of_graph: Tensor
    """Graph of each node, int64 (N,)."""
    edges: EdgeList


def drawn(rng: np.random.Generator, cases: Sequence[NodeCase], size: int, radius: float) -> Batch:
    """Draw a batch of `size` frames, each of another case, with edges within a radius [m].

    Most of the samples are pushed off the way: places and velocities change by a random affine map, and a
    little by themselves. So the network learns to make up for errors.
    """
    return batch_of([_sample(rng, cases[int(rng.integers(len(cases)))]) for _ in range(size)], radius)


def plain(cases: Sequence[NodeCase], step: int, radius: float) -> Batch:
    """Return the frame `step` of each case as it is."""
    return batch_of([_frame(case, step) for case in cases], radius)


def scale_of(cases: Sequence[NodeCase]) -> float:
    """Return the root mean square of the forces along an axis, half way to the ends of cases [m/s^2]."""
    squares = [np.mean(_frame(case, FRAMES // 2).force.astype(np.float64) ** 2) for case in cases]
    return float(np.sqrt(np.mean(squares)))


@dataclass(frozen=True)
class _Sample:
    x: Floats32
    v: Floats32
    force: Floats32
    types: npt.NDArray[np.int64]
    walls: Floats32
    step: float
    seconds: float
    gravity: Floats32
    picture: npt.NDArray[np.uint8]


def batch_of(samples: Sequence[_Sample], radius: float) -> Batch:
    """Return samples as a batch."""
    counts = [len(sample.types) for sample in samples]
    joined = {
        name: torch.from_numpy(np.concatenate([getattr(sample, name) for sample in samples]))
        for name in ("x", "v", "force", "types")
    }
    walls = np.concatenate([np.repeat(one.walls[:, None], len(one.types), axis=1) for one in samples], axis=1)
    numbers = np.array([(sample.step, sample.seconds) for sample in samples], dtype=np.float32)
    numbers = np.repeat(numbers, counts, axis=0)
    gravity = np.repeat(np.stack([sample.gravity for sample in samples]), counts, axis=0)
    pictures = np.stack([sample.picture for sample in samples]).astype(np.float32) / 255.0
    return Batch(
        **joined,
        walls=torch.from_numpy(walls),
        step=torch.from_numpy(numbers[:, :1]),
        seconds=torch.from_numpy(numbers[:, 1:]),
        gravity=torch.from_numpy(gravity),
        pictures=torch.from_numpy(pictures),
        of_graph=torch.from_numpy(np.repeat(np.arange(len(samples)), counts)),
        edges=edges_of(joined["x"], joined["types"], counts, radius),
    )


def _frame(case: NodeCase, step: int) -> _Sample:
    """Return the state after some frames on the way of free bodies, with the least force to their ends."""
    share, seconds = step / FRAMES, case.seconds
    way = case.end - case.x
    x = case.x + case.v * seconds * (share - 2 * share**2 + share**3) + way * (3 * share**2 - 2 * share**3)
    v = case.v * (1 - 4 * share + 3 * share**2) + way / seconds * 6 * (share - share**2)
    walls = np.array([case.scene.walls.lower, case.scene.walls.upper], dtype=np.float32)
    gravity = np.array(case.scene.gravity, dtype=np.float32)
    sample = _Sample(x, v, case.v, case.types, walls, share, case.seconds, gravity, case.picture)
    return _forced(sample, case.end, case)


def _forced(sample: _Sample, end: Floats32, case: NodeCase) -> _Sample:
    """Keep a state between the walls, and add the least force to an end: 6 d / t^2 - 4 v / t - g."""
    x = np.clip(sample.x, *sample.walls)
    # What would have gone through a wall has lost its velocity there.
    v = np.where(x == sample.x, sample.v, 0.0)
    left = max(case.seconds * (1 - sample.step), SHORTEST_FRAMES * case.scene.frame_dt)
    force = 6 * (end - x) / left**2 - 4 * v / left - np.array(case.scene.gravity)
    size = np.linalg.norm(force, axis=1, keepdims=True)
    force *= np.minimum(1.0, _CAP * EARTH / np.maximum(size, 1e-12))
    return replace(sample, x=x.astype(np.float32), v=v.astype(np.float32), force=force.astype(np.float32))


def _sample(rng: np.random.Generator, case: NodeCase) -> _Sample:
    sample = _frame(case, int(rng.integers(FRAMES)))
    if rng.random() < _PUSHED:
        sample = _forced(_pushed(rng, sample, case.seconds), case.end, case)
    sample = _shifted(rng, sample, case)
    return _mirrored(sample) if rng.random() < 0.5 else sample


def _shifted(rng: np.random.Generator, sample: _Sample, case: NodeCase) -> _Sample:
    """Shift fluid and sketch to the side by whole pixels, as far as the case stays clear of the walls."""
    pixel = 1.0 / sample.picture.shape[2]
    places = np.concatenate([case.x[:, 0], case.end[:, 0], sample.x[:, 0]])
    low, high = places.min(), places.max()
    inked = np.flatnonzero(sample.picture.any(axis=(0, 1)))
    left = min((low - sample.walls[0, 0] - _CLEAR) / pixel, inked[0])
    right = min((sample.walls[1, 0] - _CLEAR - high) / pixel, sample.picture.shape[2] - 1 - inked[-1])
    if min(left, right) < 0:
        return sample
    pixels = int(rng.integers(-int(left), int(right), endpoint=True))
    x = sample.x.copy()
    x[:, 0] += np.float32(pixels * pixel)
    return replace(sample, x=x, picture=np.roll(sample.picture, pixels, axis=2))


def _pushed(rng: np.random.Generator, sample: _Sample, seconds: float) -> _Sample:
    dim = sample.x.shape[1]
    around = sample.x - sample.x.mean(axis=0)
    # Early in the time there was none in which to leave the way.
    size = rng.random() * min(1.0, 0.2 + sample.step)
    moved = size * (rng.normal(0, _OFF, dim) + around @ rng.normal(0, _TURNED, (dim, dim)))
    sped = size * (rng.normal(0, _OFF, dim) + around @ rng.normal(0, _TURNED, (dim, dim)))
    loose = rng.normal(0, (_LOOSE, _LOOSE_SPEED), (*sample.x.shape, 2))
    left = max(seconds * (1 - sample.step), 0.2 * seconds)
    return replace(sample, x=sample.x + moved + loose[..., 0], v=sample.v + sped / left + loose[..., 1])


def _mirrored(sample: _Sample) -> _Sample:
    """Mirror left and right, a symmetry of the physics."""
    x, v, force = sample.x.copy(), sample.v.copy(), sample.force.copy()
    x[:, 0] = sample.walls[:, 0].sum() - x[:, 0]
    v[:, 0] *= -1
    force[:, 0] *= -1
    return replace(sample, x=x, v=v, force=force, picture=np.ascontiguousarray(sample.picture[..., ::-1]))
