"""Exporting a module of torch as one self-contained ONNX file of our opset, and reading its weights back."""

import contextlib
import io
import logging
import warnings
from collections.abc import Mapping, Sequence
from typing import Any

import onnx
import torch
from torch import Tensor, nn

from hybridmpm._support.networks import OPSET
from hybridmpm.errors import DataError
from hybridmpm.training.checkpoint import with_this_solver


def exported(
    module: nn.Module,
    example: tuple[Tensor, ...],
    *,
    inputs: Sequence[str],
    outputs: Sequence[str],
    dynamic_shapes: dict[str, dict[int, Any]],
    properties: dict[str, str],
) -> bytes:
    """Return a module as an ONNX model.

    Parameters
    ----------
    module : nn.Module
        On the CPU, in the mode of evaluation.
    example : tuple of Tensor
        Arguments of its `forward`.
    inputs, outputs : sequences of str
        Names of the arguments and of what comes out.
    dynamic_shapes : dict
        For each argument the axes that are free, as `torch.onnx.export` takes them.
    properties : dict
        Texts for the metadata of the file.
    """
    with warnings.catch_warnings(), contextlib.redirect_stdout(io.StringIO()), _quiet_logs():
        warnings.simplefilter("ignore")
        program = torch.onnx.export(
            module,
            example,
            dynamo=True,
            # The optimizer takes 1e-12 for zero and drops it, though it keeps a root's argument positive.
            optimize=False,
            opset_version=OPSET,
            input_names=inputs,
            output_names=outputs,
            dynamic_shapes=dynamic_shapes,
        )
    if program is None:
        raise RuntimeError("torch exported nothing")
    model = program.model_proto
    _forget_origin(model)
    onnx.helper.set_model_props(model, properties)
    onnx.checker.check_model(model)
    data: bytes = model.SerializeToString()
    return data


def read_back(data: bytes, where: str) -> tuple[dict[str, str], dict[str, Tensor]]:
    """Return the metadata of an exported file, and its weights by their names in torch.

    Raises `DataError` where the file is damaged; the message begins with `where`.
    """
    try:
        model = onnx.load_from_string(data)
    except Exception as error:  # noqa: BLE001 - protobuf's own errors share no other parent
        raise DataError(f"{where} is no ONNX model, or damaged or cut off: {error}") from None
    return {one.key: one.value for one in model.metadata_props}, {
        one.name: torch.from_numpy(onnx.numpy_helper.to_array(one).copy()) for one in model.graph.initializer
    }


def weights_of(
    found: Mapping[str, Tensor], wanted: Mapping[str, Tensor], where: str, prefix: str = ""
) -> dict[str, Tensor]:
    """Return those that a network wants of weights, whose names begin with `prefix`.

    Raises `DataError` where one is missing or has another size; the message begins with `where`.
    """
    kept = {name: found.get(prefix + name) for name in wanted}
    missing = sorted(name for name, part in kept.items() if part is None or part.shape != wanted[name].shape)
    if missing:
        raise DataError(
            f"{where}: its weights are not those of its network; {prefix}{missing[0]} is missing or has "
            "another size"
        )
    return {name: part for name, part in kept.items() if part is not None}


def origin_of(training: Mapping[str, str]) -> dict[str, str]:
    """Return `checkpoint.origin_of` for the record of a training in an exported file."""
    return {
        "command": training.get("command", ""),
        "solver_versions": with_this_solver(training),
        "steps_before": training.get("steps") or "0",
        "seconds_before": training.get("seconds") or "0",
    }


def _forget_origin(model: onnx.ModelProto) -> None:
    """Remove the exporter's notes about each node, which are traces with paths of this machine."""
    for node in model.graph.node:
        node.ClearField("metadata_props")
        node.ClearField("doc_string")
    for part in (*model.graph.value_info, *model.graph.input, *model.graph.output, *model.graph.initializer):
        part.ClearField("metadata_props")
    model.graph.ClearField("value_info")
    model.graph.ClearField("metadata_props")
    model.graph.ClearField("doc_string")


@contextlib.contextmanager
def _quiet_logs() -> Any:
    logger = logging.getLogger("torch.onnx")
    level = logger.level
    logger.setLevel(logging.ERROR)
    try:
        yield
    finally:
        logger.setLevel(level)
