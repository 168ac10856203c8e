"""Networks by name."""

from hybridmpm.physics.free_fall import ZeroStepper
from hybridmpm.physics.manifest import default_model
from hybridmpm.physics.model import NeuralModel
from hybridmpm.physics.stepper import Stepper
from hybridmpm.scene import Scene

ZERO = "zero"
"""The network that predicts nothing."""
_ZERO_R_P, _ZERO_R_T = 1 / 1.75, 2


def load_network(name: str | None, scene: Scene, *, scenario: str | None = None, threads: int = 1) -> Stepper:
    """Load a network for a scene.

    Parameters
    ----------
    name : str, optional
        Of a model of the library, or an .onnx file; "zero" is free fall at the paper's r_p = 1 / 1.75 and
        r_t = 2. The first model that serves `scenario` if absent.
    scene : Scene
    scenario : str, optional
        That the scene is of.
    threads : int in [1, 1024]

    Raises
    ------
    ConfigError, DataError
        There is no such model, none serves the scenario, or its file is damaged.
    """
    if name == ZERO:
        return ZeroStepper(scene.frame_dt, r_p=_ZERO_R_P, r_t=_ZERO_R_T)
    return NeuralModel.load(default_model(scenario or "") if name is None else name, threads=threads)
