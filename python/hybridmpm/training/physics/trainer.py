"""`Trainer`: a learned simulator with its optimizer and random generator, which takes training steps."""

import json
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Self

import torch
from torch import Tensor

from hybridmpm.errors import DataError
from hybridmpm.physics.spec import NetworkSpec, Normalization
from hybridmpm.training.physics.network.graph_network import GraphNetwork
from hybridmpm.training.physics.network.simulator import LearnedSimulator
from hybridmpm.training.physics.windows import Batch, Windows, edges_of
from hybridmpm.training.settings import TrainingSettings
from hybridmpm.training.trainable import Trainable


class Trainer(Trainable[GraphNetwork]):
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
        network = self.simulator.network
        super().__init__(network, settings, torch.optim.Adam(network.parameters(), lr=settings.learning_rate))

    def pace(self) -> Mapping[str, float]:
        """Return the learning rate, and the number of network steps in the latest loss."""
        unroll = self.settings.unroll_at(self.step_count - 1)
        return {**super().pace(), "unroll": unroll}

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
        return self._descend(self.loss(batch))

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
        """Return the state that `load` needs, as tensors and plain data."""
        return self._state(self.spec.to_dict()) | {"scales": json.dumps(self.simulator.scales.to_dict())}

    @classmethod
    def load(cls, path: Path, device: torch.device) -> Self:
        """Return the trainer of a checkpoint, to continue the training.

        Raises
        ------
        DataError
            `checkpoint.read` refuses the file, or its contents do not fit together.
        ConfigError
            The network has other features than those of this library; the message names both versions.
        """
        state = cls.checked(path)
        try:
            spec = NetworkSpec.from_dict(json.loads(state["spec"]), where=str(path))
            scales = Normalization(**json.loads(state["scales"]))
            settings = TrainingSettings(**json.loads(state["settings"]))
        except KeyError as error:
            raise DataError(f"{path} does not fit this library: {error}") from None
        return cls(spec, scales, settings, device).restored(state, path)


@contextmanager
def _flushed_denormals() -> Iterator[None]:
    """Within the block, round denormal numbers to zero; computing with them takes a hundred times as long."""
    torch.set_flush_denormal(True)
    try:
        yield
    finally:
        torch.set_flush_denormal(False)


def huber_loss(predicted: Tensor, true: Tensor, scale: Tensor, steps: int) -> Tensor:
    """Return the mean over particles of the Huber function of a position error, summed over axes.

    A constant error of the acceleration gives, after k steps, k (k + 1) / 2 times this error in the position;
    so the position error is divided by k (k + 1) / 2 and by the scale. The Huber function is quadratic below
    one and linear above. So collisions that cannot be predicted do not outweigh everything else, and the
    small errors of particles at rest do not count too much, as relative errors would.

    Parameters
    ----------
    predicted, true : (N, D)
        Positions [m].
    scale : (D,)
        Standard deviation of the acceleration [m per step^2].
    steps : int
        Number k of network steps from the last given position to these.
    """
    error = (predicted - true) / (scale * (steps * (steps + 1) / 2))
    return torch.nn.functional.huber_loss(error, torch.zeros_like(error), reduction="none").sum(-1).mean()
