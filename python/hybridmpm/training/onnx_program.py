"""Exporting a module of torch as one self-contained ONNX file of our opset."""

import contextlib
import io
import logging
import warnings
from collections.abc import Sequence
from typing import Any

import onnx
import torch
from torch import Tensor, nn

from hybridmpm._support.networks import OPSET


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
