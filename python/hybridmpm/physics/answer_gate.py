"""Where the answer of a network counts; with gradients it is `hybridmpm.training.physics.answer_gate`."""

import numpy as np
import numpy.typing as npt

from hybridmpm._native import RadiusGraph, disturbance
from hybridmpm.physics.spec import NetworkSpec, Normalization
from hybridmpm.scene.particle_types import KINEMATIC

QUIET = 0.01
"""Square of a disturbance, in units of the acceleration's deviation, that lets 63 % of the answer count."""
UNNOTICED = 1e-4
"""In the same unit: a hundredth of the deviation. Rounding is far below it and does not pile up over hops."""
MOST = 100.0
"""Beyond it the answer counts in full; the bound keeps sums of sums finite."""


def shares(
    history: npt.NDArray[np.float32],
    types: npt.NDArray[np.int64],
    acceleration: npt.NDArray[np.float32],
    walls: npt.NDArray[np.float32],
    graph: RadiusGraph,
    *,
    spec: NetworkSpec,
    scales: Normalization,
) -> npt.NDArray[np.float32]:
    """Return the share (N,) in [0, 1] of a network's answer that counts; 0 for kinematic particles.

    Arguments are those of `Stepper.step`, `graph` is that of the latest positions.
    """
    found = disturbance(
        history,
        acceleration * np.float32(spec.step_dt**2),
        graph.starts,
        graph.senders,
        radius=spec.radius,
        scale=scales.acceleration_std,
        # All that its answer depends on, so nothing that it could know is lost.
        hops=spec.layers,
        quiet=QUIET,
        unnoticed=UNNOTICED,
        most=MOST,
        lower=walls[0],
        upper=walls[1],
    )
    found[types == KINEMATIC] = 0.0
    return found
