"""Mean and covariance of clouds of points, and the map that gives a cloud those of another."""

import numpy as np

from hybridmpm.control.goal.cloud import Floats


def moments(x: Floats, weight: Floats) -> tuple[Floats, Floats]:
    """Return the mean (D,) and the covariance (D, D) of points (N, D) with weights (N,) that sum to 1."""
    mean = weight @ x
    away = x - mean
    return mean, np.asarray((weight[:, None] * away).T @ away)


def root_of(covariance: Floats) -> Floats:
    """Return the symmetric root of a covariance (D, D)."""
    values, vectors = np.linalg.eigh(covariance)
    return np.asarray(vectors * np.sqrt(np.maximum(values, 0.0)) @ vectors.T)


def fitted(x: Floats, weight: Floats, mean: Floats, covariance: Floats | None) -> Floats:
    """Move points (N, D) so that they have a mean, and the covariance where one is given.

    The map is linear, the one between two normal distributions that moves them least.

    References
    ----------
    Olkin and Pukelsheim: The distance between two random vectors with given dispersion matrices, 1982.
    """
    own_mean, own_covariance = moments(x, weight)
    if covariance is None:
        return np.asarray(mean + x - own_mean)
    root = root_of(covariance)
    inner = root_of(root @ own_covariance @ root)
    return np.asarray(mean + (x - own_mean) @ (root @ np.linalg.pinv(inner) @ root))


def fitted_in_view(x: Floats, weight: Floats, mean: Floats, covariance: Floats | None) -> Floats:
    """Move points (N, D) so that they have a mean (D,), and in the front view the covariance (2, 2).

    The view is that of the first two axes. No sketch says how far a fluid extends in depth, so along that
    axis the points keep their distances. The covariance is left alone where None is given.
    """
    moved = x + (mean - weight @ x)
    moved[:, :2] = fitted(x[:, :2], weight, mean[:2], covariance)
    return moved
