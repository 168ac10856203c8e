"""JSON is limited by its number of values and its depth."""

import gc
import json

import pytest

from hybridmpm_service.errors import FieldError
from hybridmpm_service.http.requests import MAX_LOG_VALUES, MAX_VALUES, read_json


@pytest.mark.parametrize(
    "value",
    [
        {"a": [1, 2.5, None, True], "b": {"c": "[{,"}},
        ['",[]{}\\"', "\\", '\\\\"', "\ud7ff\u00e9"],
        [0] * (MAX_VALUES - 1),
        json.loads("[" * 150 + "]" * 150),
        "{}" * 10_000,
    ],
    ids=["object", "escapes", "as many as allowed", "deep", "brackets in a string"],
)
def test_a_text_within_the_limits_is_read(value: object) -> None:
    assert read_json(json.dumps(value), "body") == value
    assert read_json(json.dumps(value, ensure_ascii=False).encode(), "body") == value


def test_the_inputs_of_a_log_are_read_to_few_objects() -> None:
    """The rest of the process is not to wait while Python searches among them for circles."""
    release, push = {"kind": "release", "frame": 1}, {"kind": "push", "frame": 2, "push": None}
    value = {"log": {"frame": 3, "inputs": [release, push] * (MAX_LOG_VALUES // 8)}}
    text = json.dumps(value)
    gc.collect()
    before = len(gc.get_objects())
    read = read_json(text, "body")
    assert len(gc.get_objects()) - before < 1000
    assert read["log"].pop("frame") == 3
    assert json.loads(read["log"].pop("inputs").text()) == value["log"]["inputs"]
    assert read == {"log": {}}
    with pytest.raises(
        FieldError, match=r"body\.log\.inputs\[2\]\.release\.frame: .*greater than or equal to 0"
    ):
        read_json(text.replace("1", "-1", 2).replace("-1", "1", 1), "body")


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (
            json.dumps([0] * MAX_VALUES),
            f"has {MAX_VALUES + 1} values or more, and may have at most {MAX_VALUES}",
        ),
        (json.dumps({str(i): 0 for i in range(MAX_VALUES)}), "may have at most"),
        ("[" + "{}," * MAX_VALUES + "{}]", "values"),
        (json.dumps({"log": {"inputs": [0] * MAX_LOG_VALUES}}), f"at most {MAX_LOG_VALUES}"),
        (json.dumps({"log": {"inputs": [], "scene": [0] * MAX_VALUES}}), "values beside its inputs"),
        (json.dumps({"log": {"inputs": []}, "scene": [0] * MAX_VALUES}), "values beside its inputs"),
        (json.dumps({"log": [0] * MAX_VALUES}), "values beside its inputs"),
        (json.dumps({"scene": 1, "log": {"inputs": [0] * MAX_VALUES}}), f"at most {MAX_VALUES}"),
        ("[" * 1000 + "]" * 1000, "recursion limit"),
        ("[" * 30_000, "recursion limit"),
        ('{"a":' * 1000 + "1" + "}" * 1000, "recursion limit"),
        ("]" * 100_000, "is not JSON"),
        ("[" * 1_000_000, "may have at most"),
        (json.dumps("," * MAX_VALUES), "may have at most"),
        ("9" * 2_000_000, "out of range"),
        ('"\\ud800"', "hex escape"),
        ("9" * 5000, "is not JSON"),
        ("", "is not JSON"),
        ('"' + '\\"' * 500_000, "is not JSON"),
        ('{"a": 1}'.encode("utf-16"), "is not JSON"),
        (b'"\xed\xa0\x80"', "invalid unicode"),
    ],
    ids=lambda value: "" if len(value) > 40 else None,
)
def test_a_text_beyond_a_limit_is_refused(text: str | bytes, message: str) -> None:
    with pytest.raises(FieldError, match=message) as refused:
        read_json(text, "body")
    assert refused.value.field == "body"
