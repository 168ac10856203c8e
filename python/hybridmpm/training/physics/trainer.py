"""`Trainer`: a learned simulator with its optimizer and random generator, which takes training steps."""

import json
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Self

import numpy as np
import torch
from torch import Tensor

from hybridmpm._support.arguments import whole
from hybridmpm.errors import ConfigError, DataError
from hybridmpm.physics.spec import NetworkSpec, Normalization
from hybridmpm.training import checkpoint
from hybridmpm.training.physics.losses import huber_loss
from hybridmpm.training.physics.network.simulator import LearnedSimulator
from hybridmpm.training.physics.windows import Batch, Windows, edges_of

_LONGEST = 100_000_000


@dataclass(frozen=True, kw_only=True)
class TrainingSettings:
    """Settings of a training.

    Raises
    ------
    ConfigError
        A number is out of range.
    """

    steps: int
    """Number of training steps."""
    batch: int = 4
    """Number of windows in a training step."""
    unroll: int = 3
    """Number of successive network steps in the loss at the end of training; it grows evenly from 1."""
    noise: float = 0.1
    """Standard deviation of the noise on the inputs over that of the velocity."""
    learning_rate: float = 1e-3
    """Learning rate at the start."""
    final_rate: float = 1e-5
    """Learning rate at the end; the learning rate decays exponentially."""
    seed: int = 0
    """Seed of the initial weights and of all draws."""

    def __post_init__(self) -> None:
        whole("steps", self.steps, 1, _LONGEST)
        whole("batch", self.batch, 1, 4096)
        whole("unroll", self.unroll, 1, 32)
        whole("seed", self.seed, 0, 2**32 - 1)
        if not 0.0 <= self.noise <= 1.0:
            raise ConfigError(f"noise must be in [0, 1], got {self.noise}")
        if not 0.0 < self.final_rate <= self.learning_rate <= 1.0:
            raise ConfigError(
                "final_rate must be above 0 and at most learning_rate, which must be at most 1, got "
                f"{self.final_rate} and {self.learning_rate}"
            )

    def unroll_at(self, step: int) -> int:
        """Return the number of network steps in the loss at a training step."""
        return min(self.unroll, 1 + self.unroll * step // self.steps)

    def rate_at(self, step: int) -> float:
        """Return the learning rate at a training step."""
        return float(self.learning_rate * (self.final_rate / self.learning_rate) ** (step / self.steps))


class Trainer:
    """Training as a sequence of steps, which on one kind of device do not depend on interruptions.

    Parameters
    ----------
    spec : NetworkSpec
    scales : Normalization
    settings : TrainingSettings
    device : torch.device
        Device of the network. On CUDA the network runs in bfloat16 where torch considers this safe; its sums
        and the integrator run in float32.
    """

    def __init__(
        self, spec: NetworkSpec, scales: Normalization, settings: TrainingSettings, device: torch.device
    ) -> None:
        torch.manual_seed(settings.seed)
        self.spec, self.settings, self.device = spec, settings, device
        self.simulator = LearnedSimulator(spec, scales).to(device)
        self.optimizer = torch.optim.Adam(self.simulator.parameters(), lr=settings.learning_rate)
        self.step_count = 0
        self.seconds = 0.0
        """Time of training so far, over all runs [s]."""
        self._rng = np.random.default_rng(settings.seed)

    @property
    def last_step(self) -> int:
        """Number of training steps of the whole training."""
        return self.settings.steps

    def pace(self) -> Mapping[str, float]:
        """Return the learning rate, and the number of network steps in the latest loss."""
        unroll = self.settings.unroll_at(self.step_count - 1)
        return {"learning_rate": self.settings.rate_at(self.step_count), "unroll": unroll}

    def step(self, windows: Windows) -> float:
        """Take one training step, and return the loss before it.

        Raises
        ------
        FloatingPointError
            The loss is not finite; the weights have not changed.
        """
        with _flushed_denormals():
            return self._step(windows)

    def _step(self, windows: Windows) -> float:
        unroll = self.settings.unroll_at(self.step_count)
        batch = windows.draw(
            self._rng,
            size=self.settings.batch,
            unroll=unroll,
            noise_std=self.simulator.scales.noise_std,
        ).to(self.device)
        loss = self.loss(batch)
        value = float(loss.detach())
        if not np.isfinite(value):
            raise FloatingPointError(
                f"the loss is {value} at step {self.step_count}; lower learning_rate (now "
                f"{self.settings.learning_rate:g}) and go on from the last checkpoint"
            )
        for group in self.optimizer.param_groups:
            group["lr"] = self.settings.rate_at(self.step_count)
        self.optimizer.zero_grad()
        loss.backward()  # type: ignore[no-untyped-call]
        torch.nn.utils.clip_grad_norm_(self.simulator.parameters(), 1.0)
        self.optimizer.step()
        self.step_count += 1
        return value

    def loss(self, batch: Batch) -> Tensor:
        """Return the mean of `huber_loss` over successive network steps; gradients pass through all steps."""
        history, moving = batch.history, batch.moving
        losses = []
        for k, (target, known) in enumerate(zip(batch.targets, batch.acceleration, strict=True), start=1):
            graph = edges_of(history[-1], batch.types, batch.counts, self.spec.radius)
            with torch.autocast(self.device.type, torch.bfloat16, enabled=self.device.type == "cuda"):
                answer = self.simulator.answer(history, batch.types, batch.walls, graph)
            inputs = (history, batch.types, known, batch.walls, graph)
            x = self.simulator.integrate(*inputs, answer=answer.float())
            scale = self.simulator.acceleration_std
            losses.append(huber_loss(x[moving], target[moving], scale, k))
            history = torch.cat([history[1:], x.unsqueeze(0)])
        return torch.stack(losses).mean()

    def state(self) -> dict[str, Any]:
        """Return the state that `restore` needs, as tensors and plain data."""
        return {
            "spec": json.dumps(self.spec.to_dict()),
            "scales": json.dumps(self.simulator.scales.to_dict()),
            "settings": json.dumps(asdict(self.settings)),
            "weights": self.simulator.network.state_dict(),
            "optimizer": self.optimizer.state_dict(),
            "step": self.step_count,
            "seconds": self.seconds,
            "rng": json.dumps(self._rng.bit_generator.state),
        }

    @classmethod
    def restore(cls, state: dict[str, Any], device: torch.device, *, where: str) -> Self:
        """Return a trainer in a state that `state()` returned.

        Raises
        ------
        ConfigError
            The network has other features than those of this library; the message begins with `where`.
        """
        spec = NetworkSpec.from_dict(json.loads(state["spec"]), where=where)
        scales = Normalization(**json.loads(state["scales"]))
        trainer = cls(spec, scales, TrainingSettings(**json.loads(state["settings"])), device)
        trainer.simulator.network.load_state_dict(state["weights"])
        trainer.optimizer.load_state_dict(state["optimizer"])
        trainer.step_count, trainer.seconds = state["step"], state["seconds"]
        trainer._rng.bit_generator.state = json.loads(state["rng"])
        return trainer

    @classmethod
    def load(cls, path: Path, device: torch.device) -> Self:
        """Return the trainer of a checkpoint, to go on with the training.

        Raises
        ------
        DataError
            `checkpoint.read` refuses the file, or its contents do not fit together.
        ConfigError
            The network has other features than those of this library; the message names both versions.
        """
        state = checkpoint.read(path)
        try:
            return cls.restore(state, device, where=str(path))
        except (KeyError, RuntimeError, ValueError) as error:
            if isinstance(error, ConfigError):
                raise
            raise DataError(f"{path} does not fit this library: {error}") from None


@contextmanager
def _flushed_denormals() -> Iterator[None]:
    """Within the block, round denormal numbers to zero; computing with them takes a hundred times as long."""
    torch.set_flush_denormal(True)
    try:
        yield
    finally:
        torch.set_flush_denormal(False)
