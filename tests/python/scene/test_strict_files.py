"""Files that people write: what could mean two things is an error, wherever it stands and in every format."""

import json
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from click.testing import CliRunner

from hybridmpm import ConfigError, Scene, SceneError
from hybridmpm.cli import cli
from hybridmpm.data import SceneTemplate
from hybridmpm.scene.plain_data import from_json, from_yaml

BODY = "{shape: ball, material: water, center: [0.5, 0.5], radius: 0.1}"
GOOD = f"dim: 2\nresolution: 64\nbodies:\n  - {BODY}\n"
YAML = {
    "a twin at the top": GOOD + "dim: 2\n",
    "in a body": GOOD.replace("radius: 0.1", "radius: 0.1, radius: 0.2"),
    "in a material": GOOD.replace("material: water", "material: {kind: water, tension: 0, tension: 1}"),
    "with other quotes": GOOD + '"dim": 2\n',
    "an octal": GOOD.replace("64", "064"),
    "an octal in a list": GOOD.replace("0.5, 0.5", "0.5, -01"),
    "base 60": GOOD.replace("64", "1:04"),
    "a fraction in base 60": GOOD.replace("0.1}", "1:04.5}"),
}
READERS: dict[str, Callable[[Path], Any]] = {
    "scene": Scene.load,
    "template": SceneTemplate.load,
    "text": lambda path: Scene.from_yaml(path.read_text(encoding="utf-8")),
    "bytes": lambda path: Scene.from_yaml(path.read_bytes()),
}


@pytest.mark.parametrize("reader", READERS)
@pytest.mark.parametrize("fault", YAML)
def test_yaml_that_could_mean_two_things_is_refused(fault: str, reader: str, tmp_path: Path) -> None:
    path = tmp_path / "scene.yaml"
    path.write_text(YAML[fault], encoding="utf-8")
    with pytest.raises(SceneError, match=r"line \d.*(keep one of them|octal|base 60)"):
        READERS[reader](path)


@pytest.mark.parametrize("text", ['{"a": 1, "a": 1}', '{"b": [{"a": {"c": 1, "\\u0063": 2}}]}'])
def test_a_key_stands_once_in_json_too(text: str) -> None:
    for read in (from_json, from_yaml):
        with pytest.raises(ValueError, match="keep one of them"):
            read(text)


def test_what_means_one_thing_is_read() -> None:
    text = "a: &x {p: 0, q: 0.50, r: -0.5, s: 0x40, t: 1_000, u: '064', v: +7}\nb: {<<: *x, p: 10}\n"
    plain = {"p": 0, "q": 0.5, "r": -0.5, "s": 64, "t": 1000, "u": "064", "v": 7}
    assert from_yaml(text) == {"a": plain, "b": plain | {"p": 10}}
    assert from_json('[{"a": 1}, {"a": 1, "b": {"a": 012}}]'.replace("012", "12")) == [
        {"a": 1},
        {"a": 1, "b": {"a": 12}},
    ]


@pytest.mark.parametrize("name", ["scene.yaml", "scene.json"])
def test_a_byte_order_mark_is_skipped(name: str, tmp_path: Path) -> None:
    scene = Scene.from_yaml(GOOD)
    path = tmp_path / name
    text = scene.to_json() if name.endswith("json") else scene.to_yaml()
    path.write_text(text, encoding="utf-8-sig")
    assert Scene.load(path) == scene
    read = Scene.from_json if name.endswith("json") else Scene.from_yaml
    assert read("\ufeff" + text) == scene
    assert len(SceneTemplate.load(path).draw(0).bodies) == 1


@pytest.mark.parametrize(
    ("line", "message"),
    [
        ("name: no", "name: must be text, got false"),
        ("name: 2024-05-01", "name: must be text, got 2024-05-01"),
        ("name: 7", "name: must be text, got 7"),
        ("walls: {lower: [0, 0], upper: [1, 1], contact: off}", "'separating', got false"),
        ("on: 1", "keys must be text"),
    ],
)
def test_text_without_quotes_gets_a_hint(line: str, message: str) -> None:
    with pytest.raises(SceneError, match=re.escape(message)) as caught:
        Scene.from_yaml(f"{GOOD}{line}\n")
    assert "quotes" in str(caught.value)


def test_a_file_of_ranges_says_so_and_takes_a_seed(tmp_path: Path) -> None:
    path = tmp_path / "ranges.yaml"
    path.write_text(GOOD.replace("radius: 0.1", "radius: {uniform: [0.05, 0.1]}"), encoding="utf-8")
    with pytest.raises(SceneError, match=r"is a range.*SceneTemplate"):
        Scene.load(path)
    saved = tmp_path / "state"
    for seed in (0, 3):
        command = [
            "simulate",
            "--scene",
            str(path),
            "--seed",
            str(seed),
            "--frames",
            "1",
            "--save",
            str(saved),
        ]
        result = CliRunner().invoke(cli, command, catch_exceptions=False)
        assert result.exit_code == 0, result.output
        assert f"has ranges; this is its scene of seed {seed}" in result.stderr
        assert f"scene seed {seed}" in result.stdout
    assert CliRunner().invoke(cli, ["check", str(path), "--seed", "2"]).exit_code == 0


def test_a_sketch_file_has_each_key_once(tmp_path: Path) -> None:
    path = tmp_path / "sketch.json"
    stroke = json.dumps({"points": [[0.2, 0.2], [0.7, 0.6]]})
    path.write_text(f'{{"strokes": [{stroke}], "strokes": [{stroke}]}}', encoding="utf-8")
    result = CliRunner().invoke(cli, ["control", "water_2d", "--sketch", str(path), "--frames", "1"])
    assert isinstance(result.exception, SystemExit | ConfigError)
    assert "keep one of them" in result.output
