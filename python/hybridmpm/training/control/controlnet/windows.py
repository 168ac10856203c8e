"""Training samples of the Fluid ControlNet: frames of reversed cases, pushed off their way and mirrored."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt
import torch
from torch import Tensor

from hybridmpm.training.control.controlnet.cases import NodeCase
from hybridmpm.training.physics.graph_network import EdgeList
from hybridmpm.training.physics.windows import edges_of

_PUSHED = 0.8
"""Share of the samples that are pushed off their way. In open loop even the true field of a frame ends little
better than a constant force; led back, half of it does."""
_OFF = 0.03
"""Standard deviation of how far a sample is pushed off its way [m]."""
_TURNED = 0.1
"""Standard deviation of how much it is turned, stretched and sheared [-]."""
_CLEAR = 0.02
"""Distance from a wall from which on the wall matters [m]."""
_SHORTEST = 0.06
"""Shortest time in which what was pushed off its way is led back to its end [s]."""

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
    pictures: Tensor
    """Sketches (B, 3, 64, 64)."""
    of_graph: Tensor
    """Graph of each node, int64 (N,)."""
    edges: EdgeList


def drawn(rng: np.random.Generator, cases: Sequence[NodeCase], size: int, radius: float) -> Batch:
    """Draw a batch of `size` frames, each of another case, with edges within a radius [m].

    Most of the samples are pushed off the way: places and velocities change by a random affine map. To the
    force is added what leads a free body back to the same end in the time that is left, with the least
    acceleration: -6 dx / t^2 - 4 dv / t. So the network learns to make up for errors, which no case shows.
    """
    return batch_of([_sample(rng, cases[int(rng.integers(len(cases)))]) for _ in range(size)], radius)


def plain(cases: Sequence[NodeCase], step: int, radius: float) -> Batch:
    """Return the frame `step` of each case as it is."""
    return batch_of([_frame(case, step) for case in cases], radius)


@dataclass(frozen=True)
class _Sample:
    x: Floats32
    v: Floats32
    force: Floats32
    types: npt.NDArray[np.int64]
    walls: Floats32
    step: float
    picture: npt.NDArray[np.uint8]


def batch_of(samples: Sequence[_Sample], radius: float) -> Batch:
    """Return samples as a batch."""
    counts = [len(sample.types) for sample in samples]
    joined = {
        name: torch.from_numpy(np.concatenate([getattr(sample, name) for sample in samples]))
        for name in ("x", "v", "force", "types")
    }
    walls = np.concatenate([np.repeat(one.walls[:, None], len(one.types), axis=1) for one in samples], axis=1)
    steps = np.repeat(np.array([sample.step for sample in samples], dtype=np.float32), counts)
    pictures = np.stack([sample.picture for sample in samples]).astype(np.float32) / 255.0
    return Batch(
        **joined,
        walls=torch.from_numpy(walls),
        step=torch.from_numpy(steps)[:, None],
        pictures=torch.from_numpy(pictures),
        of_graph=torch.from_numpy(np.repeat(np.arange(len(samples)), counts)),
        edges=edges_of(joined["x"], joined["types"], counts, radius),
    )


def _frame(case: NodeCase, step: int) -> _Sample:
    walls = np.array([case.scene.walls.lower, case.scene.walls.upper], dtype=np.float32)
    share = step / len(case.x)
    return _Sample(case.x[step], case.v[step], case.force[step], case.types, walls, share, case.picture)


def _sample(rng: np.random.Generator, case: NodeCase) -> _Sample:
    step = int(rng.integers(len(case.x)))
    sample = _frame(case, step)
    left = max((len(case.x) - step) * case.scene.frame_dt, _SHORTEST)
    if rng.random() < _PUSHED:
        sample = _pushed(rng, sample, left)
    sample = _shifted(rng, sample, case)
    return _mirrored(sample) if rng.random() < 0.5 else sample


def _shifted(rng: np.random.Generator, sample: _Sample, case: NodeCase) -> _Sample:
    """Shift fluid and sketch to the side by whole pixels, as far as the case stays clear of the walls."""
    pixel = 1.0 / sample.picture.shape[2]
    low, high = case.x[..., 0].min(), case.x[..., 0].max()
    inked = np.flatnonzero(sample.picture.any(axis=(0, 1)))
    left = min((low - sample.walls[0, 0] - _CLEAR) / pixel, inked[0])
    right = min((sample.walls[1, 0] - _CLEAR - high) / pixel, sample.picture.shape[2] - 1 - inked[-1])
    if min(left, right) < 0:
        return sample
    pixels = int(rng.integers(-int(left), int(right), endpoint=True))
    x = sample.x.copy()
    x[:, 0] += np.float32(pixels * pixel)
    return replace(sample, x=x, picture=np.roll(sample.picture, pixels, axis=2))


def _pushed(rng: np.random.Generator, sample: _Sample, left: float) -> _Sample:
    dim = sample.x.shape[1]
    around = sample.x - sample.x.mean(axis=0)
    # Early in the time there was none in which to leave the way.
    size = rng.random() * min(1.0, 0.2 + sample.step)
    moved = size * (rng.normal(0, _OFF, dim) + around @ rng.normal(0, _TURNED, (dim, dim)))
    sped = size * (rng.normal(0, _OFF, dim) + around @ rng.normal(0, _TURNED, (dim, dim))) / left
    x = np.clip(sample.x + moved, *sample.walls)
    moved = x - sample.x
    back = -6 * moved / left**2 - 4 * sped / left
    return replace(
        sample,
        x=x.astype(np.float32),
        v=(sample.v + sped).astype(np.float32),
        force=(sample.force + back).astype(np.float32),
    )


def _mirrored(sample: _Sample) -> _Sample:
    """Mirror left and right, which physics does not tell apart."""
    x, v, force = sample.x.copy(), sample.v.copy(), sample.force.copy()
    x[:, 0] = sample.walls[:, 0].sum() - x[:, 0]
    v[:, 0] *= -1
    force[:, 0] *= -1
    return replace(sample, x=x, v=v, force=force, picture=np.ascontiguousarray(sample.picture[..., ::-1]))
