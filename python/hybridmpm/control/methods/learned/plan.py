"""`Learned`: a network proposes where each particle is to be, guidance leads it there."""

import dataclasses

import numpy as np
import numpy.typing as npt

from hybridmpm import _core
from hybridmpm.coarse.merging import balanced_clusters
from hybridmpm.control.goal.goal import Goal
from hybridmpm.control.goal.moments import fitted_in_view
from hybridmpm.control.goal.paths import Paths
from hybridmpm.control.laws import Tracked
from hybridmpm.control.methods.analytic import arrival
from hybridmpm.control.methods.learned.features import Aim, State, distances
from hybridmpm.control.methods.learned.guard import objection
from hybridmpm.control.methods.learned.network import TransportNetwork
from hybridmpm.control.methods.learned.serving import serving
from hybridmpm.control.methods.method import FallBack, Task
from hybridmpm.scene.particle_types import SAND
from hybridmpm.simulator import Simulator

_GROUPS = 208
"""Groups that go the same way."""
_FINER = 2
"""Cells for the smoothing of the force over those of the other methods: learned plans part particles that are
near to each other."""
_EARLY = 0.67
"""Share of the frames for ways around obstacles. Of the fluid of 15 scenes with ovals behind obstacles 0.91,
0.93 and 0.94 arrive in time with 0.85, 0.75 and 0.67, and 0.91 by analytic control."""
EVALUATIONS = 1
"""Evaluations of the network, by default. One gives the mean of the ends that the network takes for possible,
which is nearer to the truth than any of them: with 2 and 4 the error of 88 validation cases was 4 and 9 %
larger."""


class Learned:
    """Leads each particle to where, by what a network has learned, it may have come from.

    For an oval the places get the mean and the covariance that it stands for, which in 3D is that in the
    front view, for an arrow the mean. Among obstacles an oval that is not much larger than the fluid is
    filled evenly, and the network decides who goes where: fluid that was to lie in obstacles finds room.

    Where the plan cannot be trusted, analytic control takes over: in scenes of another kind than the network
    was trained on, and where the plan leaves the room, ends in obstacles or crosses them, misses the goal, is
    too dense, or takes more force than is allowed.

    Parameters
    ----------
    network : str
        Name of a transport network of the library, or an .onnx file.
    evaluations : int in [1, 20]
        Evaluations of the network. With two or more, the seed of the task decides which of the possible ends
        is drawn; with one it hardly matters.
    """

    name = "learned"

    def __init__(self, network: str | None = None, evaluations: int = EVALUATIONS) -> None:
        self._network = network
        self._evaluations = evaluations

    def plan(self, simulator: Simulator, task: Task) -> Tracked:
        """Return the law that leads to the places.

        Raises
        ------
        FallBack
            The plan cannot be trusted, or there is none.
        """
        if task.goal.cloud.partial:
            raise FallBack("the network has seen whole fluids only")
        goal = task.goal
        if goal.is_shaped:
            raise FallBack("the network follows arrows and ovals only")
        network = serving(TransportNetwork, self._network, simulator.scene)
        aim = Aim(*goal.end(), network.spec.clipped(task.frames * goal.cloud.frame_dt))
        try:
            found = network.ends(_state(simulator, goal), aim, seed=task.seed, evaluations=self._evaluations)
        except Exception as error:
            raise FallBack(f"the network failed: {error}") from error
        if not np.isfinite(found).all():
            raise FallBack("the network's answer is not finite")
        covariance = None if aim.root is None else aim.root @ aim.root
        ends = fitted_in_view(found, goal.cloud.weight, aim.mean, covariance)
        group = _groups(goal)
        room = goal.room
        places = room.freed(ends)
        if goal.drawn is not None and goal.region is not None and room.scene.obstacles and not goal.is_torn:
            places = room.freed(_core.match_to_region(places, goal.region.cells).places)
        paths = Paths.straight(goal.cloud, places, group)
        if goal.drawn is None:
            along = Paths.along(
                goal.path, goal.cloud, paths.places, group, lower=room.lower, upper=room.upper
            )
            paths = paths.around(room) if along.blocked(room).any() else along
        else:
            paths = paths.around(room)
        if (reason := objection(ends, paths, task)) is not None:
            raise FallBack(reason)
        finer = dataclasses.replace(task, resolution=_FINER * task.resolution)
        return finer.tracked(paths, share=arrival(task, paths, _EARLY))


def _groups(goal: Goal) -> npt.NDArray[np.uint32]:
    """Return groups of particles that are near to each other: those of the goal, where it has such."""
    if goal.region is not None:
        return goal.paths.group
    x = goal.cloud.x
    return balanced_clusters(x, min(_GROUPS, len(x)), seed=0).astype(np.uint32)


def _state(simulator: Simulator, goal: Goal) -> State:
    walls, cloud = simulator.scene.walls, goal.cloud
    return State(
        x=cloud.x,
        v=cloud.v,
        sand=cloud.types == SAND,
        weight=cloud.weight,
        particle_volume=cloud.volume / len(cloud.x),
        lower=np.array(walls.lower),
        upper=np.array(walls.upper),
        gravity=cloud.gravity,
        distance=distances(goal.room),
    )
