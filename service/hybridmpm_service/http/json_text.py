"""JSON of clients: its values are counted before anything is built of it."""

import re
from typing import Any

from pydantic_core import from_json

from hybridmpm_service.errors import FieldError

MAX_VALUES = 1 << 15
"""Largest number of values in one text: items of arrays, and fields of objects.

Objects, errors and answers made of a text grow with this number, not with its bytes. The largest sketch, a
stroke of 4096 points with widths and times, has 20 500.
"""
MAX_LOG_VALUES = 1 << 18
"""Largest number of values in the log of a session: some twenty thousand pushes of a hand.

All but its inputs have to be at most `MAX_VALUES`.
"""
_LOG = re.compile(rb'\s*\{\s*"log"\s*:')


def read_json(text: bytes | str, field: str) -> Any:
    """Return the value of a JSON text.

    Commas and opening brackets bound the number of values. Those within strings are counted too, so a text
    of strings with thousands of commas is refused. The parser refuses a depth of more than 200.

    Parameters
    ----------
    text : bytes or str
        Bytes are UTF-8.
    field : str
        Name of the text in errors: "body" or "message".

    Raises
    ------
    FieldError
        The text is not JSON, has too many values, or is nested too deeply.
    """
    data = text if isinstance(text, bytes) else text.encode(errors="surrogatepass")
    is_log = _LOG.match(data) is not None
    most = MAX_LOG_VALUES if is_log else MAX_VALUES
    values = 1 + sum(map(data.count, (b",", b"[", b"{")))
    if values > most:
        raise FieldError(field, f"has about {values} values, and may have at most {most}")
    try:
        value = from_json(data)
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
