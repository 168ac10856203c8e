"""`Beginning`: weights that a training begins with, of a checkpoint or of a network that is served."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Self

import numpy as np
import torch

from hybridmpm._support.networks import metadata, read_network
from hybridmpm.physics.model import NeuralModel
from hybridmpm.physics.model_info import FORMAT, ModelInfo
from hybridmpm.physics.spec import Normalization
from hybridmpm.training import checkpoint
from hybridmpm.training.onnx_program import origin_of, read_back, weights_of
from hybridmpm.training.physics.network.simulator import LearnedSimulator
from hybridmpm.training.physics.trainer import Trainer

_PREFIX = "simulator.network."
"""Beginning of the names of weights in an exported file; see `hybridmpm.training.export`."""


@dataclass(frozen=True, kw_only=True)
class Beginning:
    """A trained simulator, and what is known of its training."""

    simulator: LearnedSimulator
    noise: float
    """Standard deviation of the noise that it was trained with, over that of the velocity."""
    origin: Mapping[str, str]
    """`command`, `solver_versions`, `steps_before`, `seconds_before`; see `checkpoint.origin_of`."""

    @classmethod
    def read(cls, place: Path) -> Self:
        """Read a checkpoint, an .onnx file, or the network of the library that has this name.

        Raises
        ------
        DataError
            The file is missing, damaged or neither; or it has other weights than its network.
        ConfigError
            There is no network of this name, or it has other features than those of this library.
        """
        if place.suffix == ".onnx" or not (place.suffix or place.exists()):
            return cls._of_network(*read_network(place, NeuralModel.FOLDER))
        trainer = Trainer.load(place, torch.device("cpu"))
        return cls(
            simulator=trainer.simulator,
            noise=trainer.settings.noise,
            origin=checkpoint.origin_of(checkpoint.read(place)),
        )

    @classmethod
    def _of_network(cls, data: bytes, where: str) -> Self:
        properties, held = read_back(data, where)
        info = ModelInfo.from_metadata(metadata(properties, FORMAT, where=where), where=where)
        simulator = LearnedSimulator(info.spec, info.scales)
        wanted = simulator.network.state_dict()
        simulator.network.load_state_dict(weights_of(held, wanted, where, _PREFIX))
        return cls(simulator=simulator, noise=_noise(info.scales), origin=origin_of(info.training))


def _noise(scales: Normalization) -> float:
    """Return the noise over the deviation of the velocity; see `scales.normalization`."""
    squares = np.square(scales.velocity_std) - scales.noise_std**2
    return scales.noise_std / float(np.sqrt(np.mean(squares)))
