"""JSON is bounded by its structure, whatever its bytes."""

import json

import pytest

from hybridmpm_service.errors import FieldError
from hybridmpm_service.http.json_text import MAX_DEPTH, MAX_LOG_VALUES, MAX_VALUES, read_json


@pytest.mark.parametrize(
    "value",
    [
        {"a": [1, 2.5, None, True], "b": {"c": "[{,"}},
        ['",[]{}\\"', "\\", '\\\\"', "\ud7ff\u00e9"],
        [0] * (MAX_VALUES - 1),
        json.loads("[" * MAX_DEPTH + "]" * MAX_DEPTH),
        "[" * 100_000,
        {"log": {"frame": 3, "inputs": [[0, 0]] * MAX_VALUES}},
    ],
    ids=["object", "escapes", "as many as allowed", "as deep as allowed", "brackets in a text", "log"],
)
def test_what_is_within_the_bounds_is_read(value: object) -> None:
    assert read_json(json.dumps(value), "body") == value
    assert read_json(json.dumps(value, ensure_ascii=False).encode(), "body") == value


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (
            json.dumps([0] * MAX_VALUES),
            f"has about {MAX_VALUES + 1} values, and may have at most {MAX_VALUES}",
        ),
        (json.dumps({str(i): 0 for i in range(MAX_VALUES)}), "may have at most"),
        ("[" + "{}," * MAX_VALUES + "{}]", "values"),
        (json.dumps({"log": {"inputs": [0] * MAX_LOG_VALUES}}), f"at most {MAX_LOG_VALUES}"),
        (json.dumps({"log": {"inputs": [], "scene": [0] * MAX_VALUES}}), "values beside its inputs"),
        (json.dumps({"log": {"inputs": []}, "scene": [0] * MAX_VALUES}), "values beside its inputs"),
        (json.dumps({"log": [0] * MAX_VALUES}), "values beside its inputs"),
        (json.dumps({"scene": 1, "log": {"inputs": [0] * MAX_VALUES}}), f"at most {MAX_VALUES}"),
        ("[" * (MAX_DEPTH + 1) + "]" * (MAX_DEPTH + 1), f"at most {MAX_DEPTH} arrays and objects in each"),
        ('{"a":' * 1000 + "1" + "}" * 1000, "in each other"),
        ("]" * 100_000, "more brackets are closed than opened"),
        ("9" * 5000, "is not JSON"),
        ("", "is not JSON"),
        ('"' + '\\"' * 500_000, "is not JSON"),
        ('{"a": 1}'.encode("utf-16"), "byte 0 is not UTF-8"),
        (b'"\xed\xa0\x80"', "is not UTF-8"),
    ],
    ids=lambda value: "" if len(value) > 40 else None,
)
def test_what_is_beyond_is_refused(text: str | bytes, message: str) -> None:
    with pytest.raises(FieldError, match=message) as refused:
        read_json(text, "body")
    assert refused.value.field == "body"
