"""Training samples of the transport network: reversed pasts with sketches, drawn and turned at random."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt
import torch
from torch import Tensor

from hybridmpm.control.goal.cloud import Floats
from hybridmpm.control.goal.moments import moments, root_of
from hybridmpm.control.methods.learned.features import Aim, State, inputs
from hybridmpm.control.methods.learned.noise import smooth_noise
from hybridmpm.errors import ConfigError, DataError
from hybridmpm.training.control.pasts import STATES, STRIDE, Past

_USUAL = 0.25
"""Time between start and end of half of the samples [s]: the 100 frames of the paper."""
_NEAREST = 0.03
"""Distance that the centre of mass goes at least [m]; with less a sketch would ask for nothing."""
_TRIES = 1000


@dataclass(frozen=True, kw_only=True)
class Batch:
    """B samples of P particles."""

    grid: Tensor
    numbers: Tensor
    particles: Tensor
    places: Tensor
    noise: Tensor
    """Smooth noise (B, P, D) at the places."""
    target: Tensor
    """Places at the end (B, P, D), in the aim's own coordinates."""
    frame: Tensor
    """Matrices (B, D, D) from these to metres."""

    def to(self, device: torch.device) -> "Batch":
        """Return the batch on a device."""
        return Batch(**{name: tensor.to(device) for name, tensor in vars(self).items()})

    @property
    def inputs(self) -> tuple[Tensor, Tensor, Tensor, Tensor]:
        """The network's inputs, but for noise and time."""
        return self.grid, self.numbers, self.particles, self.places


@dataclass(frozen=True, eq=False)
class Sample:
    """One reversed past: where fluid is, where it came from, and what a sketch says of that."""

    state: State
    aim: Aim
    end: Floats
    """Places (N, D) at the end [m]."""

    @property
    def is_arrow(self) -> bool:
        """Whether the sketch is an arrow, which says the centre of mass alone."""
        return self.aim.root is None


def drawn(rng: np.random.Generator, pasts: Sequence[Past], *, shortest: float, longest: float) -> Sample:
    """Draw a sample: half with the paper's horizon, the others evenly between two times [s].

    Raises
    ------
    DataError
        The centre of mass hardly moves in any past.
    """
    for _ in range(_TRIES):
        past = pasts[int(rng.integers(len(pasts)))]
        low, usual, high = _strides(past, shortest, longest)
        strides = usual if rng.random() < 0.5 else int(rng.integers(low, high, endpoint=True))
        start = int(rng.integers(strides, len(past.x)))
        state, end = past.state(start), past.positions(start - strides)
        state, end = _turned(rng, state, end)
        mean, covariance = moments(end, state.weight)
        arrow = rng.random() < 0.5
        if np.linalg.norm(mean - state.weight @ state.x) >= _NEAREST:
            aim = Aim(mean, None if arrow else root_of(covariance[:2, :2]), strides * past.seconds)
            return Sample(state, aim, end)
    raise DataError(_HARDLY_MOVES.format(most=_farthest(pasts, shortest, longest)))


def check_frame(frame_dt: float, *, shortest: float, longest: float) -> None:
    """Refuse a length of frames [s] at which no two states of a past are a sketch's time apart [s].

    Raises
    ------
    ConfigError
        The message has the allowed range.
    """
    low, high = shortest / STRIDE / (STATES - 1), longest / STRIDE
    if not low <= frame_dt <= high:
        raise ConfigError(
            f"frame_dt must be in [{low:g}, {high:g}] s for sketches of {shortest:g} to {longest:g} s, got "
            f"{frame_dt:g}"
        )


def check_pasts(pasts: Sequence[Past], *, shortest: float, longest: float) -> None:
    """Refuse pasts in none of which the centre of mass moves far enough for a sketch; raises `DataError`."""
    if (most := _farthest(pasts, shortest, longest)) < _NEAREST:
        raise DataError(_HARDLY_MOVES.format(most=most))


_HARDLY_MOVES = (
    "the fluid's centre of mass moves by {most:.2g} m at most in the time of a sketch in these scenes, and "
    f"must move by {_NEAREST:g} m: let bodies fall from higher up, or give them a velocity"
)


def _farthest(pasts: Sequence[Past], shortest: float, longest: float) -> float:
    """Return how far the centre of mass moves between the states of a sample, at most [m]."""
    most = 0.0
    for past in pasts:
        low, usual, high = _strides(past, shortest, longest)
        ways = past.ways()
        most = max(most, *(float(np.diag(ways, k).max()) for k in {usual, *range(low, high + 1)}))
    return most


def _strides(past: Past, shortest: float, longest: float) -> tuple[int, int, int]:
    """Return the smallest, the usual and the largest number of states from the start to the end."""
    found = (
        min(max(round(seconds / past.seconds), 1), len(past.x) - 1) for seconds in (shortest, _USUAL, longest)
    )
    low, usual, high = found
    return low, usual, high


def batch_of(
    rng: np.random.Generator, samples: Sequence[Sample], particles: int, *, obstacles: bool
) -> Batch:
    """Return samples as a batch, each with as many of its particles, drawn at random.

    `obstacles` as in `hybridmpm.control.methods.learned.features.inputs`.
    """
    chosen = [_some(rng, len(sample.end), particles) for sample in samples]
    states, aims = [sample.state for sample in samples], [sample.aim for sample in samples]
    seen = inputs(states, aims, chosen, obstacles=obstacles)
    noise = np.stack([smooth_noise(rng, places) for places in seen.places.astype(np.float64)])
    pairs = list(zip(samples, chosen, strict=True))
    target = np.stack([sample.aim.to_own(sample.end[rows]) for sample, rows in pairs])
    frame = np.stack([sample.aim.frame for sample in samples])
    arrays = {**vars(seen), "noise": noise, "target": target, "frame": frame}
    return Batch(**{name: torch.from_numpy(array.astype(np.float32)) for name, array in arrays.items()})


def _some(rng: np.random.Generator, count: int, particles: int) -> npt.NDArray[np.int64]:
    return rng.choice(count, particles, replace=count < particles)


def _turned(rng: np.random.Generator, state: State, end: Floats) -> tuple[State, Floats]:
    """Mirror the horizontal axes, and exchange two of them between equal walls: physics is the same."""
    order, level = np.arange(state.dim), np.flatnonzero(state.gravity == 0)
    walls = np.stack([state.lower, state.upper])[:, level]
    if (walls == walls[:, ::-1]).all():
        order[level] = rng.permutation(level)
    sign = np.ones(state.dim)
    sign[level] = rng.choice([-1.0, 1.0], len(level))
    shift = np.where(sign < 0, state.lower + state.upper, 0.0)
    x, v, distance = state.x[:, order], state.v[:, order], state.distance
    if distance is not None:
        distance = np.flip(distance.transpose(order), tuple(np.flatnonzero(sign < 0)))
    turned = replace(state, x=shift + sign * x, v=sign * v, distance=distance)
    return turned, shift + sign * end[:, order]
