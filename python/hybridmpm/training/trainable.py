"""`Trainable`: a network with its schedule, optimizer and random generator, and the state of them."""

import json
from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any, ClassVar, Generic, Self, TypeVar

import numpy as np
import torch
from torch import Tensor, nn

from hybridmpm.errors import DataError
from hybridmpm.training import checkpoint
from hybridmpm.training.settings import Settings

_AVERAGE = 0.998
"""Share of the averaged weights that a step keeps."""

N = TypeVar("N", bound=nn.Module)


class Trainable(Generic[N]):
    """A network in training, as a sequence of steps which do not depend on interruptions.

    Parameters
    ----------
    network : nn.Module
    settings : Settings
    optimizer : torch.optim.Optimizer
        Of the network's parameters.
    average : nn.Module, optional
        Another network of the same kind, for the averaged weights.

    Attributes
    ----------
    average : nn.Module
        The network with weights averaged over the latest steps, or `network` itself; this one is exported.
    step_count : int
        Number of training steps so far.
    seconds : float
        Time of training so far, over all runs [s].
    """

    kind: ClassVar[str | None] = None
    """Kind of the network in checkpoints; None for a learned simulator."""

    def __init__(
        self, network: N, settings: Settings, optimizer: torch.optim.Optimizer, average: N | None = None
    ) -> None:
        self.network, self.average = network, network if average is None else average
        self.average.load_state_dict(network.state_dict())
        self.optimizer = optimizer
        self.step_count = 0
        self.seconds = 0.0
        self._schedule = settings
        self._rng = np.random.default_rng(settings.seed)

    @property
    def last_step(self) -> int:
        """Number of training steps of the whole training."""
        return self._schedule.steps

    @property
    def parameters(self) -> int:
        """Number of weights."""
        return sum(weight.numel() for weight in self.network.parameters())

    def pace(self) -> Mapping[str, float]:
        """Return the present values of the schedule, by the columns of the log."""
        return {"learning_rate": self._schedule.rate_at(self.step_count)}

    def begin_with(self, weights: Mapping[str, Any]) -> None:
        """Take the weights of another training."""
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
        if self.average is not self.network:
            kept = min(_AVERAGE, self.step_count / (self.step_count + 20))
            with torch.no_grad():
                for average, latest in zip(self.average.parameters(), self.network.parameters(), strict=True):
                    average.lerp_(latest, 1 - kept)
        return value

    def _state(self, spec: Mapping[str, Any]) -> dict[str, Any]:
        """Return the state that `restored` needs, as tensors and plain data."""
        own = {} if self.kind is None else {"kind": self.kind, "average": self.average.state_dict()}
        return {
            **own,
            "spec": json.dumps(spec),
            "settings": json.dumps(asdict(self._schedule)),
            "weights": self.network.state_dict(),
            "optimizer": self.optimizer.state_dict(),
            "step": self.step_count,
            "seconds": self.seconds,
            "rng": json.dumps(self._rng.bit_generator.state),
        }

    def state(self) -> dict[str, Any]:
        """Return the state for a checkpoint, as tensors and plain data."""
        raise NotImplementedError

    @classmethod
    def checked(cls, path: Path) -> dict[str, Any]:
        """Return the content of a checkpoint of such a network.

        Raises
        ------
        DataError
            `checkpoint.read` refuses the file, or it is the checkpoint of another kind of network.
        """
        state = checkpoint.read(path)
        if state.get("kind") != cls.kind:
            raise DataError(f"{path} is the checkpoint of another kind of network: choose another folder")
        return state

    def restored(self, state: Mapping[str, Any], path: Path) -> Self:
        """Take a state; raises `DataError` where it does not fit the network."""
        try:
            self.network.load_state_dict(state["weights"])
            self.average.load_state_dict(state["weights" if self.kind is None else "average"])
            self.optimizer.load_state_dict(state["optimizer"])
            self.step_count, self.seconds = state["step"], state["seconds"]
            self._rng.bit_generator.state = json.loads(state["rng"])
        except (KeyError, RuntimeError, ValueError) as error:
            raise DataError(f"{path} does not fit this library: {error}") from None
        return self


def adam_w(network: nn.Module, settings: Settings) -> torch.optim.Optimizer:
    """Return the optimizer of networks of control."""
    return torch.optim.AdamW(network.parameters(), lr=settings.learning_rate, weight_decay=1e-4)
