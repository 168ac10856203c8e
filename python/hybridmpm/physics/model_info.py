"""`ModelInfo`: the metadata in the ONNX file of a learned simulator."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Self

from hybridmpm._support.networks import damage, to_properties
from hybridmpm.physics.spec import NetworkSpec, Normalization

FORMAT = "4"
"""Version of the graph's inputs and of the metadata. It is raised when older files cannot be served."""


@dataclass(frozen=True, kw_only=True)
class ModelInfo:
    """A model's network, scales and origin, as kept in the metadata of its file."""

    spec: NetworkSpec
    scales: Normalization
    parameters: int
    """Number of weights."""
    training: Mapping[str, str]
    """`command`, `data`, `machine`, `seconds`, `steps`, `solver_versions`, and `exported`, a date; "" where
    not recorded."""
    errors: list[dict[str, Any]] = field(default_factory=list)
    """Rows of measured errors; empty where there are none."""

    @property
    def solver_versions(self) -> tuple[int, ...]:
        """Solver versions of the training data, ascending."""
        return solver_versions(self.training)

    def to_properties(self) -> dict[str, str]:
        """Return texts for the file's metadata, which `from_metadata` reads."""
        return to_properties(
            FORMAT,
            spec=self.spec.to_dict(),
            scales=self.scales.to_dict(),
            parameters=self.parameters,
            training=dict(self.training),
            errors=self.errors,
        )

    @classmethod
    def from_metadata(cls, plain: Mapping[str, Any], *, where: str) -> Self:
        """Read the metadata of a file.

        Raises
        ------
        DataError
            Keys are missing or damaged; the message begins with `where`.
        ConfigError
            Of other features; the message names both versions.
        """
        with damage(where):
            parts = {key: plain[key] for key in ("parameters", "training", "errors")}
            spec, scales = dict(plain["spec"]), Normalization(**plain["scales"])
        return cls(spec=NetworkSpec.from_dict(spec, where=where), scales=scales, **parts)


def solver_versions(training: Mapping[str, str]) -> tuple[int, ...]:
    """Return the solver versions of the data of a training; the first trainings recorded none."""
    return tuple(int(version) for version in training.get("solver_versions", "1").split(", "))
