"""`ModelInfo`: what an ONNX file of ours says about itself, and the check that it is one."""

import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Self

from hybridmpm._support.protobuf import fields, messages
from hybridmpm.errors import DataError
from hybridmpm.physics.spec import NetworkSpec, Normalization

FORMAT = 4
"""Version of the graph's inputs and of the metadata. It is raised when older files cannot be served."""
OPSET = 18
"""ONNX operator set: the exporter writes it, and no other is served."""

# Field numbers of onnx.proto.
_MODEL_GRAPH, _MODEL_OPSET, _GRAPH_NODE, _GRAPH_INITIALIZER = 7, 8, 1, 5
_NODE_ATTRIBUTE, _ATTRIBUTE_TENSOR, _TENSOR_NAME, _TENSOR_EXTERNAL = 5, 5, 8, 13
_OPSET_DOMAIN, _OPSET_VERSION = 1, 2


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


def check_file(data: bytes, *, where: str) -> None:
    """Refuse what is not a self-contained ONNX model of our opset, before anything runs it.

    Raises
    ------
    DataError
        Damaged, of another opset, or with weights in other files; the message begins with `where`.
    """
    try:
        model = list(fields(memoryview(data)))
        opsets = [_opset(part) for number, part in model if number == _MODEL_OPSET]
        graph = next(part for number, part in model if number == _MODEL_GRAPH)
        outside = [name for tensor in _tensors(_message(graph)) if (name := _external(tensor))]
    except (ValueError, StopIteration):
        raise DataError(f"{where} is no ONNX model, or damaged or cut off") from None
    if opsets != [str(OPSET)]:
        there = " and ".join(map(str, opsets)) or "none"
        raise DataError(
            f"{where} is of ONNX opset {there}; this library serves opset {OPSET}: export it anew"
        )
    if outside:
        raise DataError(
            f"{where} keeps {outside[0]} in another file (external data), of which no digest is known; "
            "export it as a single file"
        )


def _message(part: memoryview | int) -> memoryview:
    if isinstance(part, int):
        raise ValueError("a number where a message is expected")  # noqa: TRY004 - as of a damaged file
    return part


def _opset(part: memoryview | int) -> str:
    content = dict(fields(_message(part)))
    domain = bytes(_message(content.get(_OPSET_DOMAIN, memoryview(b"")))).decode()
    version = content.get(_OPSET_VERSION, 0)
    return f"{domain} {version}" if domain else f"{version}"


def _tensors(graph: memoryview) -> list[memoryview]:
    """Return the initializers, and tensors that nodes carry."""
    found = []
    for number, part in messages(graph):
        if number == _GRAPH_INITIALIZER:
            found.append(part)
        elif number == _GRAPH_NODE:
            attributes = [content for key, content in messages(part) if key == _NODE_ATTRIBUTE]
            found += [
                tensor
                for attribute in attributes
                for key, tensor in messages(attribute)
                if key == _ATTRIBUTE_TENSOR
            ]
    return found


def _external(tensor: memoryview) -> str:
    parts = list(messages(tensor))
    if all(number != _TENSOR_EXTERNAL for number, _ in parts):
        return ""
    return next((bytes(part).decode() for number, part in parts if number == _TENSOR_NAME), "a tensor")
