"""JSON and YAML that people write, as plain data; whatever could be meant in two ways is an error.

A byte-order mark at the start is skipped. A key that stands twice in one mapping is refused, since one of its
values would be lost. So are the octal and base-60 numbers of YAML 1.1: `064` would be 52, and `1:04` 64.
"""

import json
import re
from collections.abc import Hashable
from typing import Any

import yaml
from pydantic_core import from_json as parsed_json

_BOM = b"\xef\xbb\xbf"
_YAML_ERRORS = (yaml.YAMLError, ValueError, KeyError, AttributeError, RecursionError)
"""Errors of the YAML loader: its own and those of conversions, e.g. a date in month 13."""
_OCTAL = re.compile(r"[-+]?0[0-9_]+")


class AmbiguousError(ValueError):
    """Text that could be meant in two ways."""


def from_json(text: str | bytes) -> Any:
    """Return what JSON contains; raises ValueError, with the reason, where it is none or has a key twice."""
    data = text.encode(errors="surrogatepass") if isinstance(text, str) else bytes(text)
    data = data.removeprefix(_BOM)
    found = parsed_json(data)
    json.loads(data, object_pairs_hook=_once, parse_int=float, parse_constant=float)
    return found


def _once(pairs: list[tuple[str, Any]]) -> None:
    keys = set()
    for key, _ in pairs:
        if key in keys:
            raise AmbiguousError(f"the key {key!r} stands twice in one object: keep one of them")
        keys.add(key)


def from_yaml(text: str | bytes) -> Any:
    """Return what YAML contains; raises ValueError, with the reason, where it is none or ambiguous."""
    try:
        return yaml.load(text.removeprefix("\ufeff") if isinstance(text, str) else text, _Loader)  # noqa: S506
    except _YAML_ERRORS as error:
        raise ValueError(" ".join(str(error).split())) from None


class _Loader(yaml.SafeLoader):
    """The safe loader, without what could mean two things."""

    def construct_mapping(self, node: yaml.MappingNode, deep: bool = False) -> dict[Hashable, Any]:  # noqa: FBT001, FBT002
        lines: dict[Hashable, int] = {}
        for key, _ in node.value:
            if not isinstance(key, yaml.ScalarNode) or key.tag == "tag:yaml.org,2002:merge":
                continue
            name, line = self.construct_object(key), key.start_mark.line + 1
            if name in lines:
                text = f"line {line}: the key {name!r} stands in line {lines[name]} already: keep one of them"
                raise AmbiguousError(text)
            lines[name] = line
        return super().construct_mapping(node, deep)


def _int(loader: _Loader, node: yaml.ScalarNode) -> Any:
    return _unambiguous(loader.construct_yaml_int(node), node, is_octal=bool(_OCTAL.fullmatch(node.value)))


def _str(loader: _Loader, node: yaml.ScalarNode) -> str:
    if node.style is None and _OCTAL.fullmatch(node.value):
        text = f"line {node.start_mark.line + 1}: {node.value} has a leading zero and is no octal number"
        raise AmbiguousError(f"{text}: write it without leading zeros, or as text in quotes")
    return str(loader.construct_yaml_str(node))


def _float(loader: _Loader, node: yaml.ScalarNode) -> Any:
    return _unambiguous(loader.construct_yaml_float(node), node, is_octal=False)


def _unambiguous(number: float, node: yaml.ScalarNode, *, is_octal: bool) -> float:
    text = node.value
    if is_octal or ":" in text:
        kind = "octal" if is_octal else "base 60"
        raise AmbiguousError(
            f"line {node.start_mark.line + 1}: {text} is {kind} in YAML, the number {number}: write {number} "
            "if that is meant, else a number without leading zeros and colons, or text in quotes"
        )
    return number


_Loader.add_constructor("tag:yaml.org,2002:int", _int)
_Loader.add_constructor("tag:yaml.org,2002:float", _float)
_Loader.add_constructor("tag:yaml.org,2002:str", _str)
