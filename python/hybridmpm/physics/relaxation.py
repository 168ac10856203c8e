"""Relaxation of density, which ends a step of a network; `training.physics.network` has it with gradients."""

import itertools

import numpy as np
import numpy.typing as npt

from hybridmpm._core import RadiusGraph, relaxed
from hybridmpm.physics.spec import NetworkSpec

STRENGTH = 0.15
"""Displacement over the radius that one neighbour at distance 0 gives at twice the density of rest."""


class Relaxation:
    """Relaxation of density that belongs to a network.

    Parameters
    ----------
    spec : NetworkSpec
    """

    def __init__(self, spec: NetworkSpec) -> None:
        self._rounds, self._rest_density = spec.relaxations, rest_density(spec)

    def __call__(
        self,
        positions: npt.NDArray[np.float32],
        weight: npt.NDArray[np.float32],
        graph: RadiusGraph,
        walls: npt.NDArray[np.float32],
    ) -> npt.NDArray[np.float32]:
        """Push particles apart where they are denser than at rest.

        Parameters
        ----------
        positions : (N, D)
            Positions after the step [m].
        weight : (N,)
            Part in [0, 1] of its displacement that each particle makes.
        graph : RadiusGraph
            Neighbours before the step.
        walls : (2, D)
            Lower and upper corner [m].

        Returns
        -------
        float32 (N, D)
            Positions [m] within the walls.
        """
        if not self._rounds:
            return positions
        return relaxed(
            positions,
            weight,
            graph.starts,
            graph.senders,
            radius=graph.radius,
            rest_density=self._rest_density,
            strength=STRENGTH,
            rounds=self._rounds,
            lower=walls[0],
            upper=walls[1],
        )


def rest_density(spec: NetworkSpec) -> float:
    """Sum of the kernel over the neighbours of a particle in a lattice of the spec's spacing."""
    reach = int(spec.radius / spec.spacing) + 1
    total = 0.0
    for site in itertools.product(range(-reach, reach + 1), repeat=spec.dim):
        distance = spec.spacing * sum(number**2 for number in site) ** 0.5
        if 0 < distance < spec.radius:
            total += (1 - distance / spec.radius) ** 2
    return total
