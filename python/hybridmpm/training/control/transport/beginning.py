"""`Beginning`: weights that a training begins with, of a checkpoint or of a network that is served."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Self

import torch
from torch import Tensor

from hybridmpm._support.networks import metadata, read_network
from hybridmpm.control.methods.learned.features import channels
from hybridmpm.control.methods.learned.network import FORMAT
from hybridmpm.control.methods.learned.network import TransportNetwork as ServedNetwork
from hybridmpm.control.methods.learned.spec import TransportSpec
from hybridmpm.errors import ConfigError
from hybridmpm.training import checkpoint
from hybridmpm.training.control.transport.network import TransportNetwork
from hybridmpm.training.control.transport.trainer import TransportTrainer
from hybridmpm.training.onnx_program import origin_of, read_back, weights_of

_FIRST = "first.weight"
"""Name of the only weights whose size depends on the channels of a plane."""
_PLANE = "plane"
"""Name of the embedding of the planes. The exporter leaves it out where it does not change the answer."""


@dataclass(frozen=True, kw_only=True)
class Beginning:
    """A trained transport network, and what is known of its training."""

    spec: TransportSpec
    weights: Mapping[str, Tensor]
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
            return cls._of_network(*read_network(place, ServedNetwork.FOLDER))
        trainer = TransportTrainer.load(place, torch.device("cpu"))
        return cls(
            spec=trainer.spec,
            weights=trainer.average.state_dict(),
            origin=checkpoint.origin_of(checkpoint.read(place)),
        )

    @classmethod
    def _of_network(cls, data: bytes, where: str) -> Self:
        properties, held = read_back(data, where)
        plain = metadata(properties, FORMAT, where=where)
        spec = TransportSpec.from_dict(plain["spec"], where=where)
        wanted = TransportNetwork(spec).state_dict()
        held.setdefault(_PLANE, torch.zeros_like(wanted[_PLANE]))
        return cls(spec=spec, weights=weights_of(held, wanted, where), origin=origin_of(plain["training"]))

    def weights_for(self, spec: TransportSpec, name: str) -> Mapping[str, Tensor]:
        """Return the weights for a training on other scenes.

        Where these have obstacles and those did not, the channels of obstacles begin with weights of zero, so
        that answers in open space stay as they are.

        Raises
        ------
        ConfigError
            The scenes have another dimension, or no obstacles where the network sees some; the message names
            the network.
        """
        if spec.dim != self.spec.dim:
            raise ConfigError(
                f"{name} is for {self.spec.dim}D, and the scenes are in {spec.dim}D: leave out --finetune"
            )
        if self.spec.obstacles == spec.obstacles:
            return self.weights
        if self.spec.obstacles:
            raise ConfigError(f"{name} sees obstacles: add a scenario that has some, or leave out --finetune")
        first, seen = self.weights[_FIRST], channels(spec.dim, obstacles=False)
        more = channels(spec.dim, obstacles=True) - seen
        none = first.new_zeros(len(first), more, *first.shape[2:])
        return {**self.weights, _FIRST: torch.cat([first[:, :seen], none, first[:, seen:]], dim=1)}
