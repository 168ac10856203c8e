"""`ControlNet`: the paper's controller, which generates force fields by diffusion."""

import numpy as np

from hybridmpm._support.arguments import whole
from hybridmpm.control.diffusion.law import Diffused
from hybridmpm.control.diffusion.network import ControlNetwork, picture_of
from hybridmpm.control.diffusion.nodes import Nodes
from hybridmpm.control.diffusion.samplers import SOLVERS, Solver
from hybridmpm.control.diffusion.schedule import MAX_STEPS
from hybridmpm.control.methods.learned.serving import serving
from hybridmpm.control.methods.method import FallBack, Task
from hybridmpm.errors import ConfigError
from hybridmpm.simulator import Simulator

STEPS = 1
"""Evaluations of the network for each frame, by default."""
_OTHER_HORIZON = 1.25
"""Largest ratio of the number of frames to that of the training."""


class ControlNet:
    """Follows a sketch by the forces that a Fluid ControlNet generates frame by frame.

    It is the paper's method on coarse control nodes, so that it runs on a CPU. There is no plan, and no
    guidance that would make up for the network's errors. In each frame the ends to which its field leads are
    fitted to the sketch: they are means of what is possible, in which a fluid has less room than it takes.
    Analytic control takes over in scenes of another kind and for horizons of other lengths than the network
    was trained on, and where there is no network or it fails at the start.

    Parameters
    ----------
    network : str, optional
        Name of a network of the library, or an .onnx file; the first that serves the scene if absent.
    steps : int in [1, 20]
        Evaluations of the network for each frame.
    solver : "ddim" or "dpm"
        Sampler.

    Raises
    ------
    ConfigError
        `steps` or `solver` is out of range.

    References
    ----------
    The paper, section 3.2.3 and appendix "Design of Fluid ControlNet".
    """

    def __init__(self, network: str | None = None, *, steps: int = STEPS, solver: Solver = "dpm") -> None:
        self._network = network
        self._steps = whole("steps", steps, 1, MAX_STEPS)
        if solver not in SOLVERS:
            raise ConfigError(f"solver must be {' or '.join(SOLVERS)}, got {solver!r}")
        self._solver = solver

    @property
    def name(self) -> str:
        """The method's name: "controlnet", and the number of evaluations where it is not the default."""
        return "controlnet" if self._steps == STEPS else f"controlnet-{self._steps}"

    def plan(self, simulator: Simulator, task: Task) -> Diffused:
        """Return the law.

        Raises
        ------
        FallBack
            There is no network for the scene or for the horizon, or it fails.
        """
        if task.goal.cloud.partial:
            raise FallBack("the network has seen whole fluids only")
        if task.goal.is_shaped:
            raise FallBack("the network follows arrows and ovals only")
        network = serving(ControlNetwork, self._network, simulator.scene)
        name = str(network.name)
        ratio = task.frames / network.frames
        if max(ratio, 1 / ratio) > _OTHER_HORIZON:
            raise FallBack(f"{name} is trained for {network.frames} frames, not for {task.frames}")
        cloud = task.goal.cloud
        nodes = Nodes.of(cloud.x, cloud.weight, simulator.materials)
        mean, root = task.goal.end()
        rng = np.random.default_rng(task.seed)
        law = Diffused(
            network=name,
            nodes=vars(nodes),
            picture=picture_of(task.goal.sketch),
            noise=rng.standard_normal((len(nodes.types), cloud.dim), dtype=np.float32),
            frames=task.frames,
            steps=self._steps,
            solver=self._solver,
            cap=task.cap_si,
            mean=mean,
            covariance=None if root is None else root @ root,
        )
        try:
            force = law.force(simulator, 0)
        except Exception as error:
            raise FallBack(f"the network failed: {error}") from error
        if not np.isfinite(force).all():
            raise FallBack("the network's answer is not finite")
        return law
