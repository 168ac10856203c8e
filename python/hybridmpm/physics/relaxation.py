"""What relaxation of density needs to know of a network; see `hybridmpm._native.relaxed`."""

import itertools

from hybridmpm.physics.spec import NetworkSpec

STRENGTH = 0.15
"""Displacement over the radius that one neighbour at distance 0 gives at twice the density of rest."""


def rest_density(spec: NetworkSpec) -> float:
    """Sum of the kernel over the neighbours of a particle in a lattice of the spec's spacing."""
    reach = int(spec.radius / spec.spacing) + 1
    total = 0.0
    for site in itertools.product(range(-reach, reach + 1), repeat=spec.dim):
        distance = spec.spacing * sum(number**2 for number in site) ** 0.5
        if 0 < distance < spec.radius:
            total += (1 - distance / spec.radius) ** 2
    return total
