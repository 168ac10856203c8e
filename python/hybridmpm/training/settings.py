"""Settings of trainings: each with its default, range and description, of which commands make options."""

import math
from dataclasses import dataclass, field, fields
from typing import Any

from hybridmpm._support.arguments import flag, real, whole
from hybridmpm.errors import ConfigError

_WARM_UP = 100
"""Steps of a training of control in which the learning rate rises to its largest."""


def setting(default: Any, low: float, high: float, text: str) -> Any:
    """Return a field with a default, a closed range and a description."""
    return field(default=default, metadata={"low": low, "high": high, "text": text})


@dataclass(frozen=True, kw_only=True)
class Settings:
    """Settings that all trainings have.

    Raises
    ------
    ConfigError
        A number is out of range.
    """

    steps: int = setting(15_000, 1, 100_000_000, "Number of training steps.")
    batch: int = setting(16, 1, 4096, "Number of samples in a training step.")
    learning_rate: float = setting(1e-3, 0, 1, "Largest learning rate.")
    final_rate: float = setting(3e-5, 0, 1, "Learning rate at the end.")
    seed: int = setting(0, 0, 2**32 - 1, "Seed of the initial weights and of all random numbers in training.")

    def __post_init__(self) -> None:
        for one in fields(self):
            value, low, high = getattr(self, one.name), one.metadata["low"], one.metadata["high"]
            if one.type is bool:
                flag(one.name, value)
            elif one.type is int:
                whole(one.name, value, low, high)
            else:
                real(one.name, value, low, high)
        if not 0.0 < self.final_rate <= self.learning_rate:
            raise ConfigError(
                "final_rate must be above 0 and at most learning_rate, which must be at most 1, got "
                f"{self.final_rate} and {self.learning_rate}"
            )

    def rate_at(self, step: int) -> float:
        """Return the learning rate at a training step: it rises for some steps, and falls by a cosine."""
        fall = 0.5 * (1 + math.cos(math.pi * min(1.0, step / self.steps)))
        rate = self.final_rate + (self.learning_rate - self.final_rate) * fall
        return rate * min(1.0, (step + 1) / _WARM_UP)


@dataclass(frozen=True, kw_only=True)
class TrainingSettings(Settings):
    """Settings of the training of a learned simulator."""

    steps: int = setting(100_000, 1, 100_000_000, "Number of training steps.")
    batch: int = setting(2, 1, 4096, "Number of windows in a training step.")
    unroll: int = setting(
        6, 1, 32, "Number of successive network steps in the loss at the end of training; it grows from 1."
    )
    noise: float = setting(
        0.1, 0, 1, "Standard deviation of the noise on the inputs, over that of the velocity."
    )

    def unroll_at(self, step: int) -> int:
        """Return the number of network steps in the loss at a training step."""
        return min(self.unroll, 1 + self.unroll * step // self.steps)

    def rate_at(self, step: int) -> float:
        """Return the learning rate at a training step: it decays exponentially."""
        return float(self.learning_rate * (self.final_rate / self.learning_rate) ** (step / self.steps))


@dataclass(frozen=True, kw_only=True)
class TransportSettings(Settings):
    """Settings of the training of a transport network.

    Samples of the flow that are not on the way from noise to data are at the noise, from where one evaluation
    predicts the ends. Ends that are means of what is possible lie closer together than a fluid can; `spread`
    counters that.
    """

    learning_rate: float = setting(1.5e-3, 0, 1, "Largest learning rate.")
    particles: int = setting(256, 1, 4096, "Number of particles of a sample whose ends are predicted.")
    flow: float = setting(
        0.7, 0, 1, "Share of the samples on the way from noise to data; 0 trains for one evaluation alone."
    )
    spread: float = setting(0.0, 0, 100, "Weight of the relative error of the covariance of all ends.")
    bfloat16: bool = setting(
        default=False,
        low=0,
        high=1,
        text="Compute with numbers of 16 bits, faster on processors that have such instructions.",
    )


@dataclass(frozen=True, kw_only=True)
class ControlNetSettings(Settings):
    """Settings of the training of a Fluid ControlNet."""

    batch: int = setting(8, 1, 4096, "Number of samples in a training step.")
