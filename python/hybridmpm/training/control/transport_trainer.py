"""`TransportTrainer`: a transport network with its optimizer and random generator."""

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Self

import numpy as np
import numpy.typing as npt
import torch
from torch import Tensor
from torch.nn import functional

from hybridmpm._support.arguments import whole
from hybridmpm.control.methods.learned.features import SCALE
from hybridmpm.control.methods.learned.spec import TransportSpec
from hybridmpm.errors import ConfigError, DataError
from hybridmpm.training import checkpoint
from hybridmpm.training.control.pasts import Past
from hybridmpm.training.control.transport_network import TransportNetwork
from hybridmpm.training.control.windows import Batch, Sample, batch_of, drawn

_WARM_UP = 100
"""Steps in which the learning rate rises to its largest."""
_AVERAGE = 0.998
"""Share of the averaged weights that a step keeps."""
_AT_NOISE = 0.3
"""Share of the samples at time 0 of the flow. One evaluation of the network answers from there."""
_CHUNK = 64
"""Validation samples that are evaluated at once."""


@dataclass(frozen=True, kw_only=True)
class TransportSettings:
    """Settings of a training.

    Raises
    ------
    ConfigError
        A number is out of range.
    """

    steps: int
    """Number of training steps."""
    batch: int = 16
    """Number of samples in a training step."""
    particles: int = 256
    """Number of particles of a sample whose end is asked for."""
    learning_rate: float = 1.5e-3
    """Largest learning rate."""
    final_rate: float = 3e-5
    """Learning rate at the end, to which it falls by a cosine."""
    seed: int = 0
    """Seed of the initial weights and of all draws."""

    def __post_init__(self) -> None:
        whole("steps", self.steps, 1, 100_000_000)
        whole("batch", self.batch, 1, 4096)
        whole("particles", self.particles, 1, 4096)
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


class TransportTrainer:
    """Training by flow matching, as a sequence of steps which do not depend on interruptions.

    A sample of the flow at time s in [0, 1] is (1 - s) noise + s data. The network predicts the data; the
    velocity of the flow follows from that.

    Parameters
    ----------
    spec : TransportSpec
    settings : TransportSettings
    device : torch.device

    References
    ----------
    Lipman et al.: Flow Matching for Generative Modeling, arXiv:2210.02747, Eq. 22 with sigma_min = 0.
    """

    def __init__(self, spec: TransportSpec, settings: TransportSettings, device: torch.device) -> None:
        torch.manual_seed(settings.seed)
        self.spec, self.settings, self.device = spec, settings, device
        self.network = _new(spec, device)
        self.average = _new(spec, device)
        """The network with weights averaged over the latest steps; this one is exported."""
        self.average.load_state_dict(self.network.state_dict())
        self.optimizer = torch.optim.AdamW(
            self.network.parameters(), lr=settings.learning_rate, weight_decay=1e-4
        )
        self.step_count = 0
        self.seconds = 0.0
        """Time of training so far, over all runs [s]."""
        self._rng = np.random.default_rng(settings.seed)

    @property
    def last_step(self) -> int:
        """Number of training steps of the whole training."""
        return self.settings.steps

    def pace(self) -> Mapping[str, float]:
        """Return the learning rate."""
        return {"learning_rate": self.settings.rate_at(self.step_count)}

    def step(self, pasts: Sequence[Past]) -> float:
        """Take one training step on samples of some pasts, and return the loss before it.

        Raises
        ------
        FloatingPointError
            The loss is not finite; the weights have not changed.
        """
        spec, settings = self.spec, self.settings
        samples = [
            drawn(self._rng, pasts, shortest=spec.shortest, longest=spec.longest)
            for _ in range(settings.batch)
        ]
        batch = batch_of(self._rng, samples, settings.particles).to(self.device)
        time = self._rng.random(settings.batch) * (self._rng.random(settings.batch) >= _AT_NOISE)
        loss = self.loss(batch, torch.from_numpy(time.astype(np.float32)).to(self.device))
        value = float(loss.detach())
        if not np.isfinite(value):
            raise FloatingPointError(
                f"the loss is {value} at step {self.step_count}; lower learning_rate (now "
                f"{settings.learning_rate:g}) and go on from the last checkpoint"
            )
        for group in self.optimizer.param_groups:
            group["lr"] = settings.rate_at(self.step_count)
        self.optimizer.zero_grad()
        loss.backward()  # type: ignore[no-untyped-call]
        torch.nn.utils.clip_grad_norm_(self.network.parameters(), 1.0)
        self.optimizer.step()
        self.step_count += 1
        self._follow()
        return value

    def loss(self, batch: Batch, time: Tensor) -> Tensor:
        """Return the mean Huber loss of the distances between predicted and true ends, over `SCALE`."""
        at = time[:, None, None]
        noisy = (1 - at) * batch.noise + at * batch.target
        found = self.network(*batch.told, noisy, time)
        away = torch.einsum("bij,bpj->bpi", batch.frame, found - batch.target) / SCALE
        return functional.huber_loss(away, torch.zeros_like(away), delta=0.6)

    def _follow(self) -> None:
        kept = min(_AVERAGE, self.step_count / (self.step_count + 20))
        with torch.no_grad():
            pairs = zip(self.average.parameters(), self.network.parameters(), strict=True)
            for average, latest in pairs:
                average.lerp_(latest, 1 - kept)

    def unexplained(self, samples: Sequence[Sample]) -> npt.NDArray[np.float32]:
        """Return for each sample the share of the ends' variance that one evaluation leaves unexplained.

        The variance is that about the aim's mean. 256 particles of each sample are asked for, always the
        same ones.
        """
        rng = np.random.default_rng(0)
        found = []
        for first in range(0, len(samples), _CHUNK):
            batch = batch_of(rng, samples[first : first + _CHUNK], 256).to(self.device)
            time = torch.zeros(len(batch.grid), device=self.device)
            with torch.no_grad():
                answer = self.average(*batch.told, batch.noise, time)
            miss, spread = (
                torch.einsum("bij,bpj->bpi", batch.frame, one).square().sum(dim=-1).mean(dim=1)
                for one in (answer - batch.target, batch.target)
            )
            found.append((miss / spread).cpu().numpy())
        return np.concatenate(found)

    def state(self) -> dict[str, Any]:
        """Return the state that `restore` needs, as tensors and plain data."""
        return {
            "kind": "transport",
            "spec": json.dumps(self.spec.to_dict()),
            "settings": json.dumps(asdict(self.settings)),
            "weights": self.network.state_dict(),
            "average": self.average.state_dict(),
            "optimizer": self.optimizer.state_dict(),
            "step": self.step_count,
            "seconds": self.seconds,
            "rng": json.dumps(self._rng.bit_generator.state),
        }

    @classmethod
    def load(cls, path: Path, device: torch.device) -> Self:
        """Return the trainer of a checkpoint, to go on with the training.

        Raises
        ------
        DataError
            `checkpoint.read` refuses the file, or it is the checkpoint of another network.
        ConfigError
            The network has other features than those of this library; the message names both versions.
        """
        state = checkpoint.read(path)
        if state.get("kind") != "transport":
            raise DataError(f"{path} is the checkpoint of another kind of network: choose another folder")
        spec = TransportSpec.from_dict(json.loads(state["spec"]), where=str(path))
        trainer = cls(spec, TransportSettings(**json.loads(state["settings"])), device)
        try:
            trainer.network.load_state_dict(state["weights"])
            trainer.average.load_state_dict(state["average"])
            trainer.optimizer.load_state_dict(state["optimizer"])
        except (KeyError, RuntimeError, ValueError) as error:
            raise DataError(f"{path} does not fit this library: {error}") from None
        trainer.step_count, trainer.seconds = state["step"], state["seconds"]
        trainer._rng.bit_generator.state = json.loads(state["rng"])
        return trainer


def _new(spec: TransportSpec, device: torch.device) -> TransportNetwork:
    # Convolutions are a quarter faster on the CPU with channels last.
    return TransportNetwork(spec).to(device).to(memory_format=torch.channels_last)
