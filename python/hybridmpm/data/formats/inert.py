"""Reading numpy's object arrays without running code that a file names.

An object array is a pickle, and a pickle may call any function. Here it may only name what numpy's arrays
need, and each of these names stands for a plain record defined below. So while the pickle is read, nothing of
numpy or of any other module is called. The arrays are built afterwards, from bytes and a checked dtype.
"""

import io
import pickle
import pickletools
from collections.abc import Callable
from typing import IO, Any, cast

import numpy as np
import numpy.typing as npt

_SIMPLE = frozenset(f"{kind}{size}" for kind in "iu" for size in (1, 2, 4, 8)) | {"f2", "f4", "f8", "b1"}
_MAX_LENGTH = 2**31
"""Length of an axis from which on an array is refused."""


class InertPickleError(ValueError):
    """A pickle names or has something that arrays of numbers do not need."""


class _Dtype:
    def __init__(self, name: object = None, *_flags: object) -> None:
        self.name, self.order = name, "="

    def __setstate__(self, state: Any) -> None:
        if isinstance(state, tuple) and len(state) > 1 and state[1] in {"<", ">", "=", "|"}:
            self.order = state[1]

    def dtype(self) -> np.dtype[Any]:
        if self.name not in _SIMPLE:
            raise InertPickleError(f"an array of type {self.name!r}")
        return np.dtype(f"{self.order}{self.name}")


class _Array:
    def __init__(self, *_arguments: object) -> None:
        self.state: Any = None

    def __setstate__(self, state: Any) -> None:
        self.state = state

    def value(self) -> Any:
        """Return an array of numbers, or the list of the entries of an object array."""
        if not isinstance(self.state, tuple) or len(self.state) != 5:
            raise InertPickleError("an array without content")
        _, shape, dtype, by_columns, content = self.state
        if not isinstance(dtype, _Dtype):
            raise InertPickleError("an array without a type")
        if dtype.name == "O8" and isinstance(content, list):
            return content
        return _numbers(shape, dtype.dtype(), content, by_columns=bool(by_columns))


def _numbers(
    shape: object, dtype: np.dtype[Any], content: object, *, by_columns: bool = False
) -> npt.NDArray[Any]:
    lengths = isinstance(shape, tuple) and all(isinstance(n, int) and 0 <= n < _MAX_LENGTH for n in shape)
    if not lengths or not isinstance(content, bytes):
        raise InertPickleError("an array whose shape or content is none")
    flat = np.frombuffer(content, dtype) if len(content) % dtype.itemsize == 0 else np.empty(0, dtype)
    if flat.size != int(np.prod(np.array(shape, dtype=object))):
        raise InertPickleError("an array whose content does not fill its shape")
    # `shape` is a tuple of numbers, as was checked above.
    return np.asarray(flat.reshape(cast("tuple[int, ...]", shape), order="F" if by_columns else "C"))


def _scalar(dtype: object, content: object = b"") -> Any:
    if not isinstance(dtype, _Dtype):
        raise InertPickleError("a number without a type")
    return _numbers((), dtype.dtype(), content)[()]


def _from_buffer(content: object, dtype: object, shape: object, order: object) -> Any:
    if not isinstance(dtype, _Dtype):
        raise InertPickleError("an array without a type")
    plain = bytes(content) if isinstance(content, bytes | bytearray) else None
    return _numbers(shape, dtype.dtype(), plain, by_columns=order == "F")


def _encode(text: object, _encoding: object = "latin1") -> bytes:
    """Stand in for `_codecs.encode`, by which pickles of old protocols store bytes."""
    if not isinstance(text, str):
        raise InertPickleError("bytes that are none")
    return text.encode("latin1")


def _no_bytes(*_arguments: object) -> bytes:
    """Stand in for `bytes`, which pickles of old protocols call to make b""."""
    return b""


_STANDINS: dict[tuple[str, str], Callable[..., Any]] = {
    ("numpy", "ndarray"): _Array,
    ("numpy", "dtype"): _Dtype,
    ("_codecs", "encode"): _encode,
    ("__builtin__", "bytes"): _no_bytes,
}
for _core in ("numpy.core", "numpy._core"):
    _STANDINS |= {
        (f"{_core}.multiarray", "_reconstruct"): _Array,
        (f"{_core}.multiarray", "scalar"): _scalar,
        (f"{_core}.numeric", "_frombuffer"): _from_buffer,
    }


class _Reader(pickle.Unpickler):
    def find_class(self, module: str, name: str) -> Any:
        try:
            return _STANDINS[module, name]
        except KeyError:
            raise InertPickleError(f"the name {module}.{name}") from None


def load(file: IO[bytes]) -> Any:
    """Read a pickled object array.

    Returns
    -------
    list
        Its entries: arrays of numbers as arrays, numbers as numbers, and other object arrays, lists and
        tuples as lists.

    Raises
    ------
    InertPickleError
        The pickle has anything but arrays of numbers, numbers, lists and tuples; the message names it.
    """
    content = file.read()
    try:
        _refuse_memo_holes(content)
        found = _Reader(io.BytesIO(content)).load()
    except InertPickleError:
        raise
    except Exception as error:  # noqa: BLE001 - whatever these bytes make the reader raise is their fault
        raise InertPickleError(f"no readable pickle ({type(error).__name__}: {error})") from None
    return _resolved(found, 0)


def _refuse_memo_holes(content: bytes) -> None:
    """Refuse pickles that write to a far place of the memo: a few bytes would claim a large memory."""
    for count, (opcode, argument, _) in enumerate(pickletools.genops(content)):
        if opcode.name in {"PUT", "BINPUT", "LONG_BINPUT"} and (argument or 0) > count:
            raise InertPickleError("a memo with holes")


def _resolved(value: Any, depth: int) -> Any:
    if depth > 8:
        raise InertPickleError("lists nested too deep")
    if isinstance(value, _Array):
        value = value.value()
    if isinstance(value, list | tuple):
        return [_resolved(part, depth + 1) for part in value]
    if isinstance(value, np.ndarray | np.generic | int | float):
        return value
    raise InertPickleError(f"a {type(value).__name__}")
