"""`ModelInfo`: what an ONNX file of a learned simulator says about itself."""

import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Self

from hybridmpm.errors import DataError
from hybridmpm.physics.spec import NetworkSpec, Normalization

FORMAT = 4
"""Version of the graph's inputs and of the metadata. It is raised when older files cannot be served."""


@dataclass(frozen=True, kw_only=True)
class ModelInfo:
    """A model's network, scales and origin, as kept in the metadata of its file."""

    spec: NetworkSpec
    scales: Normalization
    parameters: int
    """Count of the trained numbers."""
    training: Mapping[str, str]
    """`command`, `data`, `machine`, `seconds`, `steps`, `solver_versions`, and `exported`, a date; "" where
    not recorded."""
    errors: list[dict[str, Any]] = field(default_factory=list)
    """Rows of the errors measured with it; empty where none were."""

    @property
    def solver_versions(self) -> tuple[int, ...]:
        """Versions of the solvers that made its data, increasing."""
        return solver_versions(self.training)

    def to_properties(self) -> dict[str, str]:
        """Return texts for the file's metadata, which `from_properties` reads."""
        return {
            "format": str(FORMAT),
            "spec": json.dumps(self.spec.to_dict()),
            "scales": json.dumps(self.scales.to_dict()),
            "parameters": str(self.parameters),
            "training": json.dumps(dict(self.training)),
            "errors": json.dumps(self.errors),
        }

    @classmethod
    def from_properties(cls, properties: Mapping[str, str], *, where: str) -> Self:
        """Read what `to_properties` wrote.

        Raises
        ------
        DataError
            Of another format, or keys are missing or damaged; the message begins with `where`.
        ConfigError
            Of other features; the message names both versions.
        """
        there = properties.get("format", "none")
        if there != str(FORMAT):
            raise DataError(f"{where} has model format {there}; this library serves format {FORMAT}")
        try:
            plain = {key: json.loads(properties[key]) for key in properties if key != "format"}
            parts = {key: plain[key] for key in ("parameters", "training", "errors")}
            spec, scales = dict(plain["spec"]), Normalization(**plain["scales"])
        except (KeyError, TypeError, ValueError) as error:
            raise DataError(f"{where}: its metadata is damaged: {error!r}; export it anew") from None
        return cls(spec=NetworkSpec.from_dict(spec, where=where), scales=scales, **parts)


def solver_versions(training: Mapping[str, str]) -> tuple[int, ...]:
    """Return the versions of the solvers that made the data of a training; those of the first name none."""
    return tuple(int(version) for version in training.get("solver_versions", "1").split(", "))
