"""`pull`: a hand that holds a rigid body at a point."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from hybridmpm._support.arguments import whole
from hybridmpm.control.checks import positive, vector
from hybridmpm.control.goal.cloud import Floats
from hybridmpm.scene.rigid import MOST_BODIES
from hybridmpm.simulator import Simulator


@dataclass(frozen=True, eq=False)
class Pull:
    """A force that draws a point of a rigid body to a target; use it with `Simulator.advance`."""

    body: int
    """Index into `Scene.rigid`."""
    grip: Floats
    """Point (D,) that is held, from the centre of mass, in the body's own frame [m]."""
    target: Floats
    """Point (D,) that it is drawn to [m]."""
    reach: float
    """Distance from the target at which a spring at rest gives `strength` [m]."""
    strength: float
    """Largest force [N], in 2D per metre of depth."""

    def __call__(self, simulator: Simulator) -> None:
        """Let a simulator's next frame have the force; particles get none of it.

        Raises
        ------
        ConfigError
            The simulator has no such rigid body, or `grip` or `target` have not as many numbers as the scene
            has dimensions.
        """
        simulator.pull(
            self.body,
            vector("grip", self.grip, simulator.dim),
            vector("target", self.target, simulator.dim),
            reach=self.reach,
            strength=self.strength,
        )


def pull(
    body: int,
    target: npt.ArrayLike,
    *,
    strength: float,
    grip: npt.ArrayLike | None = None,
    reach: float = 0.08,
) -> Pull:
    """Return a force that draws a point of a rigid body to a target, as a hand that holds it.

    A spring of the stiffness k = strength / reach pulls, and a damper acts with c =
    max(2 sqrt(k m), k s / 60) on the velocity of the point, where m is the mass of the body. So it does not
    swing. It follows at up to 60 reach / s, and the force is at most `strength`, so that a heavy body is
    heavy. The force acts in each frame that is computed with it:
    `simulator.advance(40, control.pull(0, (0.5, 0.6), strength=200.0))`.

    Parameters
    ----------
    body : int
        Index into `Scene.rigid`.
    target : (D,)
        Point that it is drawn to [m].
    strength : float > 0
        Largest force [N], in 2D per metre of depth. The weight of a body is 9.81 times its `mass`.
    grip : (D,), optional
        Point that is held, from the centre of mass, in the body's own frame [m], as `RigidBodies.grip`
        returns it; the centre of mass if absent.
    reach : float > 0
        Distance from the target at which a spring at rest gives `strength` [m].

    Raises
    ------
    ConfigError
        A number is not finite or out of range, or the vectors have not 2 or 3 numbers each.
    """
    where = vector("target", target)
    held = np.zeros(len(where)) if grip is None else vector("grip", grip, len(where))
    return Pull(
        whole("body", body, 0, MOST_BODIES - 1),
        held,
        where,
        positive("reach", reach),
        positive("strength", strength),
    )
