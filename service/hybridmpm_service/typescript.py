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
_HEAD = """// What calls of the service take and return, by its OpenAPI document. `make types` writes this.
// A field that may be absent has a default.
"""
_PLAIN = {"integer": "number", "number": "number", "string": "string", "boolean": "boolean", "null": "null"}


def types(document: Mapping[str, Any]) -> str:
    """Return an interface for each schema of the OpenAPI document, and for what the stream sends besides."""
    schemas = dict(document["components"]["schemas"])
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
    kind = schema.get("type", "")
    if "$ref" in schema:
        text = str(schema["$ref"]).rpartition("/")[2]
    elif "const" in schema or "enum" in schema:
        text = " | ".join(map(json.dumps, schema.get("enum", [schema.get("const")])))
    elif choices := schema.get("anyOf") or schema.get("oneOf"):
        text = " | ".join(dict.fromkeys(map(_type, choices)))
    elif "prefixItems" in schema:
        text = f"[{', '.join(map(_type, schema['prefixItems']))}]"
    elif kind == "array":
        item = _type(schema["items"])
        text = f"({item})[]" if "|" in item else f"{item}[]"
    elif kind == "object":
        values = schema.get("additionalProperties")
        text = f"Record<string, {_type(values) if isinstance(values, dict) else 'unknown'}>"
    else:
        text = _PLAIN.get(kind, "unknown")
    return text


if __name__ == "__main__":
    FILE.write_text(types(create_app(Settings()).openapi()), encoding="utf-8")
    sys.stdout.write(f"wrote {FILE}\n")
