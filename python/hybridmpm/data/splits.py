"""Splits by seed: which seeds are for training, validation and tests."""

from dataclasses import dataclass

from hybridmpm._support.arguments import whole
from hybridmpm.errors import ConfigError

NAMES = ("train", "valid", "test")
FIRST_VALID, FIRST_TEST = 1_000_000, 1_100_000
"""First seed for validation and first seed for tests; smaller seeds are for training."""


def split_of(seed: int) -> str:
    """Return the split that a seed belongs to."""
    if seed < FIRST_VALID:
        return "train"
    return "valid" if seed < FIRST_TEST else "test"


@dataclass(frozen=True)
class Seeds:
    """The seeds of a data set. Each split has successive seeds from the start of its range plus `first` on.

    Raises
    ------
    ConfigError
        All splits are empty, or one has more seeds than its range.
    """

    train: int
    """Number of seeds for training."""
    valid: int = 0
    """Number of seeds for validation."""
    test: int = 0
    """Number of seeds for tests."""
    first: int = 0
    """Distance of each split's first seed from the start of its range."""

    def __post_init__(self) -> None:
        room = {"train": FIRST_VALID, "valid": FIRST_TEST - FIRST_VALID, "test": FIRST_VALID}
        whole("seed", self.first, 0, FIRST_VALID - 1)
        for name, count in self.counts().items():
            whole(name, count, 0, room[name])
            if count and self.first + count > room[name]:
                raise ConfigError(
                    f"seed + {name} must be at most {room[name]}, the seeds of that split, got "
                    f"{self.first} + {count}"
                )
        if not any(self.counts().values()):
            raise ConfigError("a data set needs at least one trajectory, got none in any split")

    def counts(self) -> dict[str, int]:
        """Return the number of seeds of each split."""
        return {"train": self.train, "valid": self.valid, "test": self.test}

    def of(self, split: str) -> range:
        """Return the seeds of a split."""
        start = {"train": 0, "valid": FIRST_VALID, "test": FIRST_TEST}[split] + self.first
        return range(start, start + self.counts()[split])

    def all(self) -> list[int]:
        """Return all seeds, those for training first."""
        return [seed for split in NAMES for seed in self.of(split)]
