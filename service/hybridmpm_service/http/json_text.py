"""JSON that clients send: its structure is counted before anything is built of it."""

import json
import re
from typing import Any

from hybridmpm_service.errors import FieldError

MAX_VALUES = 1 << 15
"""Largest number of values in one text: items of arrays, and fields of objects.

Objects, errors and answers that are made of a text grow with this number, whatever its bytes. The largest
sketch, a stroke of 4096 points with widths and times, has 20 500.
"""
MAX_LOG_VALUES = 1 << 18
"""Largest number of values in a text that is the log of a session: some twenty thousand pushes of a hand.

All but its inputs have to be at most `MAX_VALUES`.
"""
MAX_DEPTH = 32
"""Largest depth of arrays and objects within each other."""

# Nothing here is tried twice, so that also a text without end takes time in proportion to its length.
_STRING = re.compile(r'"[^"\\]*+(?:\\.[^"\\]*+)*+(?:"|\\?\Z)', re.DOTALL)
_LOG = re.compile(r'\s*\{\s*"log"\s*:')
_BRACKET = re.compile(r"[\[\]{}]")


def read_json(text: bytes | str, field: str) -> Any:
    """Return what a JSON text stands for.

    Parameters
    ----------
    text : bytes or str
        Bytes are UTF-8.
    field : str
        What the text is, for errors: "body" or "message".

    Raises
    ------
    FieldError
        The text is not JSON, or has too many values, or too many in each other.
    """
    try:
        decoded = text.decode() if isinstance(text, bytes) else text
        is_log = _LOG.match(decoded) is not None
        _check_structure(decoded, field, MAX_LOG_VALUES if is_log else MAX_VALUES)
        value = json.loads(decoded)
    except UnicodeDecodeError as err:
        raise FieldError(field, f"is not JSON: byte {err.start} is not UTF-8") from None
    except ValueError as err:
        raise FieldError(field, f"is not JSON: {err}") from None
    if is_log:
        _check_beside_inputs(value, field)
    return value


def _check_beside_inputs(body: dict[str, Any], field: str) -> None:
    log = body["log"]
    inputs = log.get("inputs") if isinstance(log, dict) else None
    values, waiting = 0, [body]
    while waiting:
        one = waiting.pop()
        values += 1
        if one is not inputs and isinstance(one, dict | list):
            waiting += one.values() if isinstance(one, dict) else one
    if values > MAX_VALUES:
        raise FieldError(field, f"has {values} values beside its inputs, and may have at most {MAX_VALUES}")


def _check_structure(text: str, field: str, most: int) -> None:
    structure = _STRING.sub("", text)
    opened = structure.count("[") + structure.count("{")
    values = 1 + opened + structure.count(",")
    if values > most:
        raise FieldError(field, f"has about {values} values, and may have at most {most}")
    if structure.count("]") + structure.count("}") > opened:
        raise FieldError(field, "is not JSON: more brackets are closed than opened")
    depth = 0
    for bracket in _BRACKET.findall(structure):
        depth += 1 if bracket in "[{" else -1
        if depth > MAX_DEPTH:
            raise FieldError(field, f"may have at most {MAX_DEPTH} arrays and objects in each other")
