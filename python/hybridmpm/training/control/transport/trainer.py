"""`TransportTrainer`: a transport network with its optimizer and random generator."""

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, ClassVar, Self

import numpy as np
import numpy.typing as npt
import torch
from torch import Tensor
from torch.nn import functional

from hybridmpm.control.methods.learned.features import SCALE
from hybridmpm.control.methods.learned.spec import TransportSpec
from hybridmpm.training.control.pasts import Past
from hybridmpm.training.control.transport.network import TransportNetwork
from hybridmpm.training.control.transport.windows import Batch, Sample, batch_of, drawn
from hybridmpm.training.run import VALIDATION, log_row
from hybridmpm.training.settings import TransportSettings
from hybridmpm.training.trainable import Trainable, adam_w

_CHUNK = 64
"""Validation samples that are evaluated at once."""
_EACH = 2
"""Validation samples of each scene."""


class TransportTrainer(Trainable[TransportNetwork]):
    """Training by flow matching.

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

    kind: ClassVar[str] = "transport"

    def __init__(self, spec: TransportSpec, settings: TransportSettings, device: torch.device) -> None:
        torch.manual_seed(settings.seed)
        self.spec, self.settings, self.device = spec, settings, device
        network = _new(spec, device)
        super().__init__(network, settings, adam_w(network, settings), _new(spec, device))

    def step(self, batch: Batch, time: Tensor) -> float:
        """Take one training step on samples at times (B,) of the flow, and return the loss before it.

        Raises
        ------
        FloatingPointError
            The loss is not finite; the weights have not changed.
        """
        return self._descend(self.loss(batch.to(self.device), time.to(self.device)))

    def loss(self, batch: Batch, time: Tensor) -> Tensor:
        """Return the mean Huber loss of the distances between predicted and true ends, over `SCALE`.

        To it comes the relative error of the covariance of the ends, with the weight `spread`.
        """
        at = time[:, None, None]
        noisy = (1 - at) * batch.noise + at * batch.target
        with torch.autocast(self.device.type, torch.bfloat16, enabled=self.settings.bfloat16):
            found = self.network(*batch.inputs, noisy, time).float()
        ends, true = (torch.einsum("bij,bpj->bpi", batch.frame, one) / SCALE for one in (found, batch.target))
        loss = functional.huber_loss(ends, true, delta=0.6)
        if self.settings.spread == 0.0:
            return loss
        wide, wanted = _covariance(ends), _covariance(true)
        error = (wide - wanted).square().sum(dim=(1, 2)) / (wanted.square().sum(dim=(1, 2)) + 1e-8)
        return loss + self.settings.spread * (error + 1e-8).sqrt().mean()

    def unexplained(self, samples: Sequence[Sample]) -> npt.NDArray[np.float32]:
        """Return for each sample the share of the ends' variance that one evaluation leaves unexplained.

        The variance is that about the aim's mean. It is that of 256 particles of each sample, always the same
        ones.
        """
        rng = np.random.default_rng(0)
        found = []
        for first in range(0, len(samples), _CHUNK):
            batch = batch_of(rng, samples[first : first + _CHUNK], 256, obstacles=self.spec.obstacles).to(
                self.device
            )
            time = torch.zeros(len(batch.grid), device=self.device)
            with torch.no_grad():
                answer = self.average(*batch.inputs, batch.noise, time)
            miss, spread = (
                torch.einsum("bij,bpj->bpi", batch.frame, one).square().sum(dim=-1).mean(dim=1)
                for one in (answer - batch.target, batch.target)
            )
            found.append((miss / spread).cpu().numpy())
        return np.concatenate(found)

    def state(self) -> dict[str, Any]:
        """Return the state that `load` needs, as tensors and plain data."""
        return self._state(self.spec.to_dict())

    @classmethod
    def load(cls, path: Path, device: torch.device) -> Self:
        """Return the trainer of a checkpoint, to continue the training.

        Raises
        ------
        DataError
            `checkpoint.read` refuses the file, or it is the checkpoint of another network.
        ConfigError
            The network has other features than those of this library; the message names both versions.
        """
        state = cls.checked(path)
        spec = TransportSpec.from_dict(json.loads(state["spec"]), where=str(path))
        return cls(spec, TransportSettings(**json.loads(state["settings"])), device).restored(state, path)


def _covariance(places: Tensor) -> Tensor:
    """Return the covariances (B, D, D) of places (B, P, D)."""
    away = places - places.mean(dim=1, keepdim=True)
    return away.transpose(1, 2) @ away / places.shape[1]


def _new(spec: TransportSpec, device: torch.device) -> TransportNetwork:
    # Convolutions are a quarter faster on the CPU with channels last.
    return TransportNetwork(spec).to(device).to(memory_format=torch.channels_last)


def held_out(groups: Mapping[str, Sequence[Past]], spec: TransportSpec) -> dict[str, list[Sample]]:
    """Return samples of held-out pasts, the same in each call, by scenario and kind of sketch.

    Parameters
    ----------
    groups : mapping
        Pasts by scenario.
    spec : TransportSpec
        For the range of times.
    """
    found: dict[str, list[Sample]] = {}
    for scenario, pasts in groups.items():
        rng = np.random.default_rng(0)
        for _ in range(_EACH * len(pasts)):
            sample = drawn(rng, pasts, shortest=spec.shortest, longest=spec.longest)
            kind = "arrow" if sample.is_arrow else "oval"
            found.setdefault(f"{scenario}_{kind}", []).append(sample)
    return found


def log_unexplained(trainer: TransportTrainer, folder: Path, groups: Mapping[str, Sequence[Sample]]) -> None:
    """Add to `validation.jsonl` the mean of `TransportTrainer.unexplained` for each group of samples.

    Raises
    ------
    OSError
        The file cannot be written.
    """
    row = {name: float(trainer.unexplained(samples).mean()) for name, samples in groups.items()}
    log_row(folder / VALIDATION, {"step": trainer.step_count, "seconds": trainer.seconds, **row})
