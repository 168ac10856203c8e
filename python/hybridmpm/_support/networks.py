"""Trained networks as ONNX files: folders of them with a manifest, their metadata, and onnxruntime."""

import contextlib
import functools
import hashlib
import json
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, Self, TypeVar

from hybridmpm._support.arguments import whole
from hybridmpm._support.protobuf import fields, messages
from hybridmpm._support.suggestions import did_you_mean
from hybridmpm.errors import ConfigError, DataError

if TYPE_CHECKING:
    import onnxruntime

OPSET = 18
"""ONNX operator set: the exporter writes it, and no other is served."""
MANIFEST = "manifest.json"

# Field numbers of onnx.proto.
_MODEL_GRAPH, _MODEL_OPSET, _MODEL_METADATA, _GRAPH_NODE, _GRAPH_INITIALIZER = 7, 8, 14, 1, 5
_NODE_ATTRIBUTE, _ATTRIBUTE_TENSOR, _TENSOR_NAME, _TENSOR_EXTERNAL = 5, 5, 8, 13
_OPSET_DOMAIN, _OPSET_VERSION = 1, 2
_ENTRY_KEY, _ENTRY_VALUE = 1, 2


@dataclass(frozen=True)
class NetworkFolder:
    """Networks in one folder: a file `NAME.onnx` each, and a manifest with an entry for each.

    The manifest lists networks in order of preference. Every entry has the SHA-256 of the file as `sha256`.
    """

    path: Path

    def entries(self) -> dict[str, dict[str, Any]]:
        """Return the entries by name.

        Raises
        ------
        DataError
            The manifest is missing or damaged.
        """
        path = self.path / MANIFEST
        try:
            plain = json.loads(path.read_text(encoding="utf-8"))
            return {str(name): {**entry, "sha256": str(entry["sha256"])} for name, entry in plain.items()}
        except (OSError, ValueError, TypeError, KeyError, AttributeError) as error:
            raise DataError(f"{path} is missing or damaged: {error!r}; install the library anew") from None

    def read(self, name: str) -> bytes:
        """Return the bytes of a network's file, once its digest has been checked.

        Raises
        ------
        ConfigError
            There is no network of this name; the message lists the names.
        DataError
            The file is missing, or is not the one of the manifest: the message has both digests.
        """
        known = self.entries()
        if name not in known:
            listed = ", ".join(known) or "none yet"
            raise ConfigError(f"there is no model {name!r}; known are {listed}{did_you_mean(name, known)}")
        path, sha256 = self.path / f"{name}.onnx", known[name]["sha256"]
        try:
            data = path.read_bytes()
        except OSError as error:
            reason = error.strerror or error
            raise DataError(f"cannot read {path}: {reason}; install the library anew") from None
        digest = hashlib.sha256(data).hexdigest()
        if digest != sha256:
            raise DataError(
                f"{path} is damaged or another file: its SHA-256 is {digest}, the manifest has {sha256}; "
                "install the library anew"
            )
        return data

    def write_entry(self, name: str, entry: Mapping[str, Any]) -> Path:
        """Add an entry, or replace the one of this name in its place; return the path of the manifest."""
        path = self.path / MANIFEST
        known = self.entries() if path.exists() else {}
        path.write_text(json.dumps(known | {name: dict(entry)}, indent=1) + "\n", encoding="utf-8")
        return path


class ServedNetwork:
    """A trained network under onnxruntime. Safe to share between threads: it has no state.

    Parameters
    ----------
    data : bytes
        An ONNX file that `hybridmpm export` wrote.
    where : str
        Begins the messages of errors.
    name : str, optional
        Name or path by which `load` finds the same network, for snapshot files.
    threads : int in [1, 1024]

    Raises
    ------
    DataError
        The file is damaged, has another format or opset, or keeps weights in other files.
    ConfigError
        The network was trained on features of another version, or `threads` is out of range.
    """

    FORMAT: ClassVar[str]
    """Kind and version of the network's inputs and of the metadata of its file."""
    FOLDER: ClassVar[NetworkFolder]
    """Networks that come with the library."""

    def __init__(self, data: bytes, *, where: str, name: str | None = None, threads: int = 1) -> None:
        self._where = where
        self.name = name
        """Name or path by which `load` finds it; None for bytes from elsewhere."""
        self.sha256 = hashlib.sha256(data).hexdigest()
        """SHA-256 of the file."""
        properties = check_file(data, where=where)
        self._described(metadata(properties, self.FORMAT, where=where))
        self._session = _session(data, threads=threads, where=where)
        self._arguments = (data, where, name, threads)

    def __copy__(self) -> Self:
        return self  # it has no state

    def __deepcopy__(self, _memo: dict[int, Any]) -> Self:
        return self

    def __reduce__(self) -> tuple[Any, ...]:
        return _network, (type(self), *self._arguments)

    def _described(self, plain: dict[str, Any]) -> None:
        """Take the metadata of the file; a KeyError, TypeError or ValueError is reported as damage."""
        raise NotImplementedError

    @classmethod
    def load(cls, name: str | Path, *, threads: int = 1) -> Self:
        """Load a network that comes with the library, by name, or a file whose name ends in .onnx.

        Raises
        ------
        DataError, ConfigError
            As the constructor; there is no such network or file; or the file of a name is not the one whose
            SHA-256 is in the manifest.
        """
        data, where = read_network(name, cls.FOLDER)
        return cls(data, where=where, name=str(name), threads=threads)


def _network(cls: type[ServedNetwork], data: bytes, where: str, name: str | None, threads: int) -> Any:
    """Return the network of a pickle."""
    return cls(data, where=where, name=name, threads=threads)


Network = TypeVar("Network", bound=ServedNetwork)


def cached(kind: type[Network], name: str) -> Network:
    """Return a network by name or file, loaded once; errors as `ServedNetwork.load`."""
    hashable: Any = kind
    network: Network = _loaded(hashable, name)
    return network


@functools.lru_cache(maxsize=8)
def _loaded(kind: Any, name: str) -> Any:
    return kind.load(name)


def read_network(name: str | Path, folder: NetworkFolder) -> tuple[bytes, str]:
    """Return the file of a network of a folder, or of a path that ends in .onnx, and its name in messages.

    Raises
    ------
    DataError, ConfigError
        As `NetworkFolder.read`, or the file cannot be read.
    """
    path = Path(name)
    if path.suffix != ".onnx":
        return folder.read(str(name)), f"model {name}"
    try:
        return path.read_bytes(), str(path)
    except OSError as error:
        raise DataError(f"cannot read {path}: {error.strerror or error}") from None


def to_properties(kind: str, **parts: Any) -> dict[str, str]:
    """Return texts for the metadata of a network's file, which `metadata` reads."""
    return {"format": kind, **{key: json.dumps(part) for key, part in parts.items()}}


def metadata(properties: Mapping[str, str], kind: str, *, where: str) -> dict[str, Any]:
    """Return the metadata of a network's file as plain data.

    Raises
    ------
    DataError
        Of another format, or damaged; the message begins with `where`.
    """
    there = properties.get("format", "none")
    if there != kind:
        raise DataError(f"{where} has model format {there}; this library serves format {kind}")
    with damage(where):
        return {key: json.loads(text) for key, text in properties.items() if key != "format"}


@contextlib.contextmanager
def damage(where: str) -> Iterator[None]:
    """Raise a `DataError` about damaged metadata in place of the errors of reading it."""
    try:
        yield
    except (KeyError, TypeError, ValueError) as error:
        raise DataError(f"{where}: its metadata is damaged: {error!r}; export it anew") from None


def _session(data: bytes, *, threads: int, where: str) -> "onnxruntime.InferenceSession":
    """Return a session on the CPU; raises `DataError`, or `ConfigError` for `threads`."""
    import onnxruntime  # noqa: PLC0415 - its import takes a moment, and only networks need it

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


def check_file(data: bytes, *, where: str) -> dict[str, str]:
    """Return the metadata of a self-contained ONNX model of our opset, without running any of it.

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
        properties = dict(_text_pair(part) for number, part in model if number == _MODEL_METADATA)
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
    return properties


def _text_pair(part: memoryview | int) -> tuple[str, str]:
    content = dict(messages(_message(part)))
    key, value = (bytes(content.get(number, b"")).decode() for number in (_ENTRY_KEY, _ENTRY_VALUE))
    return key, value


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
    """Return the initializers, and tensors that nodes contain."""
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
