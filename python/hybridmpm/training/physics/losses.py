"""The loss of predicted positions, in units of the acceleration that would correct them."""

import torch
from torch import Tensor


def huber_loss(predicted: Tensor, true: Tensor, scale: Tensor, steps: int) -> Tensor:
    """Return the mean over particles of the Huber function of a position error, summed over axes.

    A constant error of the acceleration gives, after k steps, k (k + 1) / 2 times this error in the position;
    so the position error is divided by k (k + 1) / 2 and by the scale. The Huber function is quadratic below
    one and linear above. So collisions that cannot be predicted do not outweigh everything else, and the
    small errors of particles at rest do not count too much, as relative errors would.

    Parameters
    ----------
    predicted, true : (N, D)
        Positions [m].
    scale : (D,)
        Standard deviation of the acceleration [m per step^2].
    steps : int
        Number k of network steps from the last given position to these.
    """
    error = (predicted - true) / (scale * (steps * (steps + 1) / 2))
    return torch.nn.functional.huber_loss(error, torch.zeros_like(error), reduction="none").sum(-1).mean()
