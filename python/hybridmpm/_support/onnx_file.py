"""ONNX files of networks: the check that one is self-contained, and its session under onnxruntime."""

from typing import TYPE_CHECKING

from hybridmpm._support.arguments import whole
from hybridmpm._support.protobuf import fields, messages
from hybridmpm.errors import DataError

if TYPE_CHECKING:
    import onnxruntime

OPSET = 18
"""ONNX operator set: the exporter writes it, and no other is served."""

# Field numbers of onnx.proto.
_MODEL_GRAPH, _MODEL_OPSET, _GRAPH_NODE, _GRAPH_INITIALIZER = 7, 8, 1, 5
_NODE_ATTRIBUTE, _ATTRIBUTE_TENSOR, _TENSOR_NAME, _TENSOR_EXTERNAL = 5, 5, 8, 13
_OPSET_DOMAIN, _OPSET_VERSION = 1, 2


def session(data: bytes, *, threads: int, where: str) -> "onnxruntime.InferenceSession":
    """Return a network of ours, ready to run on the CPU.

    Parameters
    ----------
    data : bytes
        An ONNX file.
    threads : int in [1, 1024]
    where : str
        Begins the messages of errors.

    Raises
    ------
    DataError
        Damaged, of another opset, or with weights in other files.
    ConfigError
        `threads` is out of range.
    """
    check_file(data, where=where)
    import onnxruntime  # noqa: PLC0415 - takes a moment, and only networks need it

    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = whole("threads", threads, 1, 1024)
    options.inter_op_num_threads = 1
    options.execution_mode = onnxruntime.ExecutionMode.ORT_SEQUENTIAL
    options.log_severity_level = 4
    # Threads that spin while they wait would take the cores from the solver.
    options.add_session_config_entry("session.intra_op.allow_spinning", "0")
    try:
        return onnxruntime.InferenceSession(data, options, providers=["CPUExecutionProvider"])
    except Exception as error:  # noqa: BLE001 - onnxruntime's own errors share no other parent
        raise DataError(f"{where} is no model that onnxruntime can load: {error}") from None


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
