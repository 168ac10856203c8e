"""Learned simulators. Running them needs no torch; `hybridmpm.training` does.

The models that come with the library are attributes, for completion: `physics.fluids_2d` is "fluids_2d".
"""

from typing import TYPE_CHECKING as _TYPE_CHECKING

from hybridmpm.physics.manifest import WEIGHTS, Entry, default_model, models, read_model
from hybridmpm.physics.model import NeuralModel
from hybridmpm.physics.model_info import ModelInfo
from hybridmpm.physics.simulator import NeuralPhysics
from hybridmpm.physics.spec import NetworkSpec, Normalization
from hybridmpm.physics.stepper import Stepper

__all__ = [
    "WEIGHTS",
    "Entry",
    "ModelInfo",
    "NetworkSpec",
    "NeuralModel",
    "NeuralPhysics",
    "Normalization",
    "Stepper",
    "default_model",
    "models",
    "read_model",
]

if not _TYPE_CHECKING:  # a type checker would take any name to be there

    def __getattr__(name: str) -> str:
        if not name.startswith("_") and name in models():
            return name
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}", name=name)


def __dir__() -> list[str]:
    return sorted([*__all__, *models()])
