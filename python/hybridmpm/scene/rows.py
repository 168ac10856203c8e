"""Rows of three numbers: corners and triangles of surfaces, too many of both for tuples.

In JSON and YAML more than 1000 rows are one text: base 64 of the numbers, little-endian and row by row. What
is read may have either form, with any number of rows.
"""

import base64
import binascii
from collections.abc import Iterator, Sequence
from typing import Annotated, Any, overload

import numpy as np
import numpy.typing as npt
from pydantic import (
    Field,
    GetCoreSchemaHandler,
    GetJsonSchemaHandler,
    SerializationInfo,
    ValidatorFunctionWrapHandler,
)
from pydantic.json_schema import JsonSchemaValue
from pydantic_core import CoreSchema, core_schema

from hybridmpm._support.arguments import unmasked
from hybridmpm.scene.fields import raise_faults

_NAMED = 10
"""Largest number of rows out of range that are named."""
_FEWEST = 4
"""Smallest number of rows: no fewer corners or triangles enclose anything."""
_LISTED = 1000
"""Largest number of rows that are written as lists, which people can read."""


class Rows(Sequence[tuple[float, ...]]):
    """Rows of three numbers each, which do not change. `numpy.asarray` of them copies nothing.

    Parameters
    ----------
    rows : (N, 3)
    """

    __slots__ = ("_array",)

    def __init__(self, rows: npt.ArrayLike) -> None:
        self._array: npt.NDArray[Any] = np.array(rows)
        self._array.flags.writeable = False

    def __array__(self, dtype: npt.DTypeLike | None = None, copy: bool | None = None) -> npt.NDArray[Any]:  # noqa: FBT001
        return self._array.astype(dtype or self._array.dtype, copy=bool(copy))

    def __len__(self) -> int:
        return len(self._array)

    @overload
    def __getitem__(self, place: int) -> tuple[float, ...]: ...

    @overload
    def __getitem__(self, place: slice) -> "Rows": ...

    def __getitem__(self, place: int | slice) -> "tuple[float, ...] | Rows":
        found = self._array[place]
        return Rows(found) if isinstance(place, slice) else tuple(found.tolist())

    def __iter__(self) -> Iterator[tuple[float, ...]]:
        return map(tuple, self._array.tolist())

    def __eq__(self, other: object) -> bool:
        return np.array_equal(self._array, other._array) if isinstance(other, Rows) else NotImplemented

    def __hash__(self) -> int:
        return hash(self._array.tobytes())

    def __repr__(self) -> str:
        return f"Rows({self._array.tolist() if len(self) <= _LISTED else f'<{len(self)} rows>'})"


class Table:
    """Reader and writer of the `Rows` of a model, for use in `Annotated`.

    Parameters
    ----------
    number : type
        Type of the numbers in lists, with their limits.
    kind : {"<f8", "<u4"}
        Type of the numbers in text.
    most : int
        Largest number of rows.
    high : float
        Largest number; 0 is the smallest.
    """

    def __init__(self, number: Any, kind: str, *, most: int, high: float) -> None:
        row = Annotated[list[number], Field(min_length=2, max_length=3)]
        self._lists: Any = Annotated[list[row], Field(min_length=_FEWEST, max_length=most)]
        self._kind, self._most, self._high = np.dtype(kind), most, high

    def __get_pydantic_core_schema__(self, source: object, handler: GetCoreSchemaHandler) -> CoreSchema:
        written = core_schema.plain_serializer_function_ser_schema(self._written, info_arg=True)
        lists = handler.generate_schema(self._lists)
        return core_schema.no_info_wrap_validator_function(self._read, lists, serialization=written)

    def __get_pydantic_json_schema__(
        self, schema: CoreSchema, handler: GetJsonSchemaHandler
    ) -> JsonSchemaValue:
        shape = f"base 64 of {self._kind.name}, little-endian, three a row"
        text = {"type": "string", "contentEncoding": "base64", "description": shape}
        return {"anyOf": [handler(schema), text]}

    def read(self, text: str) -> npt.NDArray[Any]:
        """Return the rows (N, 3) in a text; raises ValueError where there are none."""
        row = 3 * self._kind.itemsize
        # Nothing is decoded that is too large.
        if len(text) > (self._most * row + 2) // 3 * 4:
            raise ValueError(f"must have {self._most} or fewer rows")
        try:
            data = base64.b64decode(text, validate=True)
        except (binascii.Error, ValueError) as error:
            raise ValueError(f"must be lists, or text in base 64, which it is not: {error}") from None
        if len(data) % row:
            name = f"three {self._kind.name}, {row} bytes"
            raise ValueError(f"as text must have rows of {name}, and has {len(data)} bytes")
        return np.frombuffer(data, dtype=self._kind).reshape(-1, 3)

    def _read(self, value: Any, lists: ValidatorFunctionWrapHandler) -> Rows:
        if isinstance(value, str):
            value = self.read(value)
        found = np.asarray(value) if isinstance(value, Rows) else unmasked("rows", value, error=ValueError)
        if not isinstance(found, np.ndarray) or not self._is_valid(found):
            # Faults are found one by one.
            read = lists(self._with_few_faults(found) if isinstance(found, np.ndarray) else found)
            for place, row in enumerate(read):
                if len(row) != 3:
                    text = "must have 3 numbers; a mesh is for dim 3 only"
                    raise_faults("Rows", [((place,), text)])
            found = np.array(read)
        is_whole = self._kind.kind == "u" and found.dtype != object
        return Rows(found.astype(np.int64 if is_whole else np.float64) if found.dtype != object else found)

    def _with_few_faults(self, found: npt.NDArray[Any]) -> Any:
        """Return an array as lists in which only some rows are out of range: each fault is an object."""
        if found.dtype.kind in "fiu" and found.ndim == 2:
            wrong = np.flatnonzero(~((found >= 0) & (found <= self._high)).all(axis=1))
            found = found.copy()
            found[wrong[_NAMED:]] = 0
        return found.tolist()

    def _is_valid(self, found: npt.NDArray[Any]) -> bool:
        kinds = "iu" if self._kind.kind == "u" else "f"
        if found.dtype.kind not in kinds or found.ndim != 2 or found.shape[1] != 3:
            return False
        return _FEWEST <= len(found) <= self._most and bool(((found >= 0) & (found <= self._high)).all())

    def _written(self, rows: Rows, info: SerializationInfo) -> Any:
        if info.mode != "json":
            return rows
        if len(rows) <= _LISTED:
            return [list(row) for row in rows]
        return base64.b64encode(np.asarray(rows, dtype=self._kind).tobytes()).decode()
