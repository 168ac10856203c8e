"""Snapshots as bytes: a tree of plain data, arrays and bytes in one block, followed by a checksum."""

import contextlib
import hashlib
import io
import json
import threading
from collections.abc import Iterator
from typing import Any

import numpy as np

from hybridmpm.errors import SnapshotError

_CHECKSUM = hashlib.sha256().digest_size
READING = threading.Lock()
"""Held while NumPy reads arrays: it parses headers, and Python before 3.11.8 fails if two threads parse."""


def to_bytes(magic: bytes, version: int, tree: dict[str, Any]) -> bytes:
    """Return a tree as bytes; the same tree always gives the same bytes.

    Parameters
    ----------
    magic : bytes
        First bytes of the result, one for each kind of snapshot.
    version : int
        Version of the layout of `tree`.
    tree : dict
        Dictionaries, lists, numbers, strings, None, arrays and bytes, nested at will.
    """
    arrays: dict[str, Any] = {}

    def plain(node: Any) -> Any:
        if isinstance(node, np.ndarray | bytes):
            name = str(len(arrays))
            arrays[name] = np.frombuffer(node, dtype=np.uint8) if isinstance(node, bytes) else node
            return {"bytes" if isinstance(node, bytes) else "array": name}
        if isinstance(node, dict):
            return {"dict": {key: plain(value) for key, value in node.items()}}
        if isinstance(node, list | tuple):
            return {"list": [plain(value) for value in node]}
        return node

    text = json.dumps({"version": version, "tree": plain(tree)}, default=number).encode()
    block = io.BytesIO()
    np.savez(block, allow_pickle=False, header=np.frombuffer(text, dtype=np.uint8), **arrays)
    body = magic + block.getvalue()
    return body + hashlib.sha256(body).digest()


def number(value: Any) -> Any:
    """Return NumPy's numbers as Python's own, for JSON."""
    if isinstance(value, np.generic):
        return value.item()
    raise SnapshotError(f"a snapshot holds numbers, texts, arrays and bytes, but not {type(value).__name__}")


@contextlib.contextmanager
def as_snapshot_error(what: str) -> Iterator[None]:
    """Turn whatever goes wrong while a state is read into a `SnapshotError`.

    A correct checksum does not imply valid content.
    """
    try:
        yield
    except SnapshotError:
        raise
    except Exception as error:
        raise SnapshotError(f"the {what} does not fit: {type(error).__name__}: {error}") from error


def from_bytes(magic: bytes, version: int, data: bytes) -> dict[str, Any]:
    """Return the tree that `to_bytes` made into bytes.

    Raises
    ------
    SnapshotError
        The bytes do not begin with `magic`, are damaged or cut off, or have another version.
    """
    if not data.startswith(magic):
        raise SnapshotError("the bytes are no snapshot of this kind of simulator")
    body, checksum = data[:-_CHECKSUM], data[-_CHECKSUM:]
    if hashlib.sha256(body).digest() != checksum:
        raise SnapshotError("the snapshot is damaged or cut off: its checksum does not match")
    with READING, np.load(io.BytesIO(body[len(magic) :]), allow_pickle=False) as arrays:
        header = json.loads(arrays["header"].tobytes())
        if header["version"] != version:
            raise SnapshotError(
                f"the snapshot has version {header['version']}, but this hybridmpm reads version {version}"
            )

        def full(node: Any) -> Any:
            if not isinstance(node, dict):
                return node
            ((kind, value),) = node.items()
            match kind:
                case "array":
                    return arrays[value]
                case "bytes":
                    return arrays[value].tobytes()
                case "dict":
                    return {key: full(child) for key, child in value.items()}
                case _:
                    return [full(child) for child in value]

        tree: dict[str, Any] = full(header["tree"])
        return tree
