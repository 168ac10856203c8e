"""Networks by name, by file or as they are, and how a snapshot file names them."""

from pathlib import Path
from typing import Any, TypeAlias

from hybridmpm.errors import ConfigError, DataError, SnapshotError
from hybridmpm.physics.free_fall import FreeFall
from hybridmpm.physics.manifest import default_model
from hybridmpm.physics.model import NeuralModel
from hybridmpm.physics.stepper import Stepper
from hybridmpm.scene import Scene

Model: TypeAlias = str | Path | Stepper
"""Name of a model of the library, an .onnx file, or a network of one's own."""

ZERO = "zero"
"""Name of the network that predicts nothing but free fall."""
_ZERO_R_P, _ZERO_R_T = 1 / 1.75, 2


def as_stepper(model: Model, scene: Scene, *, threads: int = 1) -> Stepper:
    """Return the network that `model` names, or `model` itself where it is one.

    Parameters
    ----------
    model : str, Path or Stepper
        Name of a model of the library or an .onnx file; "zero" is free fall at the paper's r_p = 1 / 1.75 and
        r_t = 2.
    scene : Scene
        The scene that the network is for.
    threads : int in [1, 1024]
        Threads of onnxruntime, for a network that is loaded here.

    Raises
    ------
    ConfigError, DataError
        There is no such model, or its file is damaged.
    """
    if model == ZERO:
        return FreeFall(scene.frame_dt, r_p=_ZERO_R_P, r_t=_ZERO_R_T)
    if isinstance(model, str | Path):
        return NeuralModel.load(model, threads=threads)
    if isinstance(model, type) or not hasattr(model, "step"):
        raise ConfigError(
            f"model must be a name, a path of an .onnx file or a Stepper, got {type(model).__name__}"
        )
    return model


def model_for(name: str | None, scenario: str | None) -> str:
    """Return a model's name: the one given, or the first model that serves a scenario.

    Raises
    ------
    ConfigError
        Neither is given, there is no such scenario, or no model serves it.
    """
    if name is None and scenario is None:
        raise ConfigError("a scene of your own needs a network chosen by name: give a model")
    return name if name is not None else default_model(scenario or "")


def model_to_dict(stepper: Stepper) -> dict[str, Any] | None:
    """Describe a network for a snapshot file; None for one that cannot be loaded again by name."""
    if isinstance(stepper, NeuralModel) and stepper.name is not None:
        return {"name": stepper.name, "sha256": stepper.sha256}
    if type(stepper) is FreeFall:
        return {"name": ZERO, "r_p": stepper.r_p, "r_t": stepper.r_t}
    return None


def name_of(stepper: Stepper) -> str:
    """Return the name of a network; that of its class where it has none of its own."""
    description = model_to_dict(stepper)
    return type(stepper).__name__ if description is None else str(description["name"])


def model_from_dict(
    description: dict[str, Any] | None, model: Model | None, scene: Scene, *, threads: int
) -> Stepper:
    """Return the network of a snapshot file, or the one that the caller gives in its place.

    Raises
    ------
    SnapshotError
        The file names no network, or one that is not here or has changed, and the caller gave none.
    """
    if model is not None:
        return as_stepper(model, scene, threads=threads)
    if description is None:
        raise SnapshotError("the file was saved with a network of your own: give it as `model`")
    if description["name"] == ZERO:
        return FreeFall(scene.frame_dt, r_p=description["r_p"], r_t=description["r_t"])
    try:
        found = NeuralModel.load(description["name"], threads=threads)
    except (ConfigError, DataError) as error:
        raise SnapshotError(f"{error}; the file needs this network, or another given as `model`") from error
    if found.sha256 != description["sha256"]:
        raise SnapshotError(
            f"model {description['name']} has changed: its SHA-256 is {found.sha256}, the file was saved "
            f"with {description['sha256']}; give the network as `model`"
        )
    return found
