"""Gate of a network's answer; `training.physics.network.answer_gate` is the same with gradients."""

import numpy as np
import numpy.typing as npt

from hybridmpm import _core
from hybridmpm._core import RadiusGraph
from hybridmpm.physics.spec import NetworkSpec, Normalization
from hybridmpm.scene.particle_types import KINEMATIC

QUIET = 0.01
"""Square of a disturbance that lets 63 % of the answer count, in units of the acceleration's deviation
squared."""
UNNOTICED = 1e-4
"""Square of a disturbance that counts as none, in the same unit: a hundredth of the deviation. Rounding is
far below it, so it does not add up over hops."""
MOST = 100.0
"""Square of a disturbance beyond which the answer counts in full, in the same unit. It keeps sums of sums
finite."""


def answer_weights(
    history: npt.NDArray[np.float32],
    types: npt.NDArray[np.int64],
    acceleration: npt.NDArray[np.float32],
    walls: npt.NDArray[np.float32],
    graph: RadiusGraph,
    *,
    spec: NetworkSpec,
    scales: Normalization,
) -> npt.NDArray[np.float32]:
    """Return the weight (N,) in [0, 1] with which a network's answer counts beside free fall.

    It is 0 for kinematic particles, and where a body falls freely and nothing is near: there free fall is
    exact.

    Parameters
    ----------
    history, types, acceleration, walls
        Arguments of `Stepper.step`.
    graph : RadiusGraph
        Neighbours at the latest positions.
    spec, scales
        The network and the scales of its outputs.
    """
    found = _core.answer_weights(
        history,
        acceleration * np.float32(spec.step_dt**2),
        graph.starts,
        graph.senders,
        radius=spec.radius,
        scale=scales.acceleration_std,
        # The radius of the network, so that no input of it is lost.
        hops=spec.layers,
        quiet=QUIET,
        unnoticed=UNNOTICED,
        most=MOST,
        lower=walls[0],
        upper=walls[1],
    )
    found[types == KINEMATIC] = 0.0
    return found
