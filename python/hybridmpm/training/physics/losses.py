"""Losses of predicted positions, in units of the acceleration that would mend them."""

import torch
from torch import Tensor


def huber_loss(predicted: Tensor, true: Tensor, scale: Tensor, steps: int) -> Tensor:
    """Mean over particles of the Huber function of a position error, summed over axes.

    The error of a position after k unrolled steps of one wrong acceleration grows as k (k + 1) / 2 times that
    acceleration, and is divided by it; for k = 1 it is the error of the acceleration. Quadratic below one
    standard deviation, linear beyond: a collision that cannot be predicted does not outweigh everything
    else, and particles at rest, whose errors are small, do not blow up.

    Parameters
    ----------
    predicted, true : (N, D)
        Positions [m].
    scale : (D,)
        Standard deviation of the acceleration [m per step^2].
    steps : int
        k.
    """
    error = (predicted - true) / (scale * (steps * (steps + 1) / 2))
    return torch.nn.functional.huber_loss(error, torch.zeros_like(error), reduction="none").sum(-1).mean()


def relative_loss(predicted: Tensor, true: Tensor, floor: float = 0.0) -> Tensor:
    """Mean over particles of |a - b| / |b|: the loss of the paper (arXiv:2505.18926), for comparison.

    It grows without bound as a true acceleration b vanishes, as at rest; `floor`, added to |b|, bounds it.

    Parameters
    ----------
    predicted, true : (N, D)
        Accelerations a, b in any unit.
    floor : float >= 0
        In the same unit.
    """
    length = torch.linalg.vector_norm(true, dim=-1)
    error = torch.linalg.vector_norm(predicted - true, dim=-1) / (length + floor)
    return torch.as_tensor(error.mean())
