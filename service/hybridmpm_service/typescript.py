"""`python -m hybridmpm_service.typescript`: types of the client in JavaScript, by the OpenAPI document."""

import json
import sys
from collections.abc import Mapping
from typing import Any

from hybridmpm_service.app import create_app
from hybridmpm_service.http.answers import HistoryBody
from hybridmpm_service.http.files import PAGE
from hybridmpm_service.sessions.view import Forces
from hybridmpm_service.settings import Settings

FILE = PAGE / "api.d.ts"
"""File of the types."""
_HEAD = """// What calls of the service take and return, as its OpenAPI document has it; `make types` writes this file.
// A field that may be absent has a default.
"""
_PLAIN = {"integer": "number", "number": "number", "string": "string", "boolean": "boolean", "null": "null"}


def types() -> str:
    """Return an interface for each schema of the OpenAPI document, and for what the stream sends besides."""
    schemas: dict[str, Any] = dict(create_app(Settings()).openapi()["components"]["schemas"])
    for model in (HistoryBody, Forces):
        schema = model.model_json_schema(ref_template="#/components/schemas/{model}")
        schemas |= schema.pop("$defs", {}) | {model.__name__: schema}
    return _HEAD + "".join(_interface(name, schemas[name]) for name in sorted(schemas))


def _interface(name: str, schema: Mapping[str, Any]) -> str:
    required = schema.get("required", ())
    lines = []
    for field, about in schema["properties"].items():
        if text := " ".join(about.get("description", "").split()):
            lines.append(f"  /** {text.replace('*/', '* /')} */\n")
        lines.append(f"  {field}{'' if field in required else '?'}: {_type(about)};\n")
    return f"\nexport interface {name} {{\n{''.join(lines)}}}\n"


def _type(schema: Mapping[str, Any]) -> str:
    if "$ref" in schema:
        return str(schema["$ref"]).rpartition("/")[2]
    if "const" in schema:
        return json.dumps(schema["const"])
    if "enum" in schema:
        return " | ".join(map(json.dumps, schema["enum"]))
    if choices := schema.get("anyOf") or schema.get("oneOf"):
        return " | ".join(dict.fromkeys(map(_type, choices)))
    if schema.get("type") == "array":
        if "prefixItems" in schema:
            return f"[{', '.join(map(_type, schema['prefixItems']))}]"
        item = _type(schema["items"])
        return f"({item})[]" if "|" in item else f"{item}[]"
    if schema.get("type") == "object":
        values = schema.get("additionalProperties")
        return f"Record<string, {_type(values) if isinstance(values, dict) else 'unknown'}>"
    return _PLAIN.get(schema.get("type", ""), "unknown")


if __name__ == "__main__":
    FILE.write_text(types(), encoding="utf-8")
    sys.stdout.write(f"wrote {FILE}\n")
