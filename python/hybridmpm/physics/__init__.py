"""Learned simulators: what they are and how they run. Nothing here needs torch; `hybridmpm.training` does."""

from hybridmpm.physics.manifest import default_model, models
from hybridmpm.physics.model import NeuralModel
from hybridmpm.physics.model_info import ModelInfo
from hybridmpm.physics.simulator import NeuralPhysics
from hybridmpm.physics.spec import NetworkSpec, Normalization
from hybridmpm.physics.stepper import Stepper

__all__ = [
    "ModelInfo",
    "NetworkSpec",
    "NeuralModel",
    "NeuralPhysics",
    "Normalization",
    "Stepper",
    "default_model",
    "models",
]
