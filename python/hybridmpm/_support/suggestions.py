"""Suggestions for names that are nearly right."""

import difflib
from collections.abc import Iterable


def nearest(name: object, known: Iterable[str]) -> str | None:
    """Return the known name that is most like `name`; None where none is, or where it is no text."""
    if not isinstance(name, str):
        return None
    written = {one.lower(): one for one in known}
    found = difflib.get_close_matches(name.lower(), written, n=1)
    return written[found[0]] if found else None


def did_you_mean(name: object, known: Iterable[str]) -> str:
    """Return the end of a message with the most similar name; "" without one."""
    near = nearest(name, known)
    return "" if near is None else f"; did you mean {near!r}?"
