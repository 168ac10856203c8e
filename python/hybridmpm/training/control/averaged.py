"""What trainings of control have in common: schedule, optimizer, averaged weights, and the state of them."""

import json
import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, ClassVar, Generic, Self, TypeVar

import numpy as np
import torch
from torch import Tensor, nn

from hybridmpm._support.arguments import whole
from hybridmpm.errors import ConfigError, DataError
from hybridmpm.training import checkpoint

_WARM_UP = 100
"""Steps in which the learning rate rises to its largest."""
_AVERAGE = 0.998
"""Share of the averaged weights that a step keeps."""

N = TypeVar("N", bound=nn.Module)


@dataclass(frozen=True, kw_only=True)
class Schedule:
    """Settings that all trainings have.

    Raises
    ------
    ConfigError
        A number is out of range.
    """

    steps: int
    """Number of training steps."""
    batch: int = 16
    """Number of samples in a training step."""
    learning_rate: float = 1.5e-3
    """Largest learning rate."""
    final_rate: float = 3e-5
    """Learning rate at the end, to which it falls by a cosine."""
    seed: int = 0
    """Seed of the initial weights and of all draws."""

    def __post_init__(self) -> None:
        whole("steps", self.steps, 1, 100_000_000)
        whole("batch", self.batch, 1, 4096)
        whole("seed", self.seed, 0, 2**32 - 1)
        if not 0.0 < self.final_rate <= self.learning_rate <= 1.0:
            raise ConfigError(
                "final_rate must be above 0 and at most learning_rate, which must be at most 1, got "
                f"{self.final_rate} and {self.learning_rate}"
            )

    def rate_at(self, step: int) -> float:
        """Return the learning rate at a training step."""
        fall = 0.5 * (1 + math.cos(math.pi * min(1.0, step / self.steps)))
        rate = self.final_rate + (self.learning_rate - self.final_rate) * fall
        return rate * min(1.0, (step + 1) / _WARM_UP)


class AveragedTrainer(Generic[N]):
    """A network in training by AdamW, as a sequence of steps which do not depend on interruptions.

    Parameters
    ----------
    network, average : nn.Module
        Two of the same kind.
    settings : Schedule

    Attributes
    ----------
    network : nn.Module
    average : nn.Module
        The network with weights averaged over the latest steps; this one is exported.
    step_count : int
        Number of training steps so far.
    seconds : float
        Time of training so far, over all runs [s].
    """

    kind: ClassVar[str]
    """Name under which checkpoints know the network."""

    def __init__(self, network: N, average: N, settings: Schedule) -> None:
        self.network, self.average = network, average
        self.average.load_state_dict(self.network.state_dict())
        self._schedule = settings
        self.optimizer = torch.optim.AdamW(network.parameters(), lr=settings.learning_rate, weight_decay=1e-4)
        self.step_count = 0
        self.seconds = 0.0
        self._rng = np.random.default_rng(settings.seed)

    @property
    def last_step(self) -> int:
        """Number of training steps of the whole training."""
        return self._schedule.steps

    def pace(self) -> Mapping[str, float]:
        """Return the learning rate."""
        return {"learning_rate": self._schedule.rate_at(self.step_count)}

    def begin_with(self, weights: Mapping[str, Any]) -> None:
        """Take over the weights of another training."""
        self.network.load_state_dict(weights)
        self.average.load_state_dict(weights)

    def _descend(self, loss: Tensor) -> float:
        """Take one step down the gradient of a loss, and return the loss.

        Raises
        ------
        FloatingPointError
            The loss is not finite; the weights have not changed.
        """
        value = float(loss.detach())
        if not np.isfinite(value):
            raise FloatingPointError(
                f"the loss is {value} at step {self.step_count}; lower learning_rate (now "
                f"{self._schedule.learning_rate:g}) and go on from the last checkpoint"
            )
        for group in self.optimizer.param_groups:
            group["lr"] = self._schedule.rate_at(self.step_count)
        self.optimizer.zero_grad()
        loss.backward()  # type: ignore[no-untyped-call]
        torch.nn.utils.clip_grad_norm_(self.network.parameters(), 1.0)
        self.optimizer.step()
        self.step_count += 1
        kept = min(_AVERAGE, self.step_count / (self.step_count + 20))
        with torch.no_grad():
            pairs = zip(self.average.parameters(), self.network.parameters(), strict=True)
            for average, latest in pairs:
                average.lerp_(latest, 1 - kept)
        return value

    def _state(self, spec: Mapping[str, Any]) -> dict[str, Any]:
        """Return the state that `restored` needs, as tensors and plain data."""
        return {
            "kind": self.kind,
            "spec": json.dumps(spec),
            "settings": json.dumps(asdict(self._schedule)),
            "weights": self.network.state_dict(),
            "average": self.average.state_dict(),
            "optimizer": self.optimizer.state_dict(),
            "step": self.step_count,
            "seconds": self.seconds,
            "rng": json.dumps(self._rng.bit_generator.state),
        }

    @classmethod
    def checked(cls, path: Path) -> dict[str, Any]:
        """Read the checkpoint of such a network.

        Raises
        ------
        DataError
            `checkpoint.read` refuses the file, or it is the checkpoint of another network.
        """
        state = checkpoint.read(path)
        if state.get("kind") != cls.kind:
            raise DataError(f"{path} is the checkpoint of another kind of network: choose another folder")
        return state

    def restored(self, state: Mapping[str, Any], path: Path) -> Self:
        """Go on from a state.

        Raises
        ------
        DataError
            It does not fit the network.
        """
        try:
            self.network.load_state_dict(state["weights"])
            self.average.load_state_dict(state["average"])
            self.optimizer.load_state_dict(state["optimizer"])
        except (KeyError, RuntimeError, ValueError) as error:
            raise DataError(f"{path} does not fit this library: {error}") from None
        self.step_count, self.seconds = state["step"], state["seconds"]
        self._rng.bit_generator.state = json.loads(state["rng"])
        return self
