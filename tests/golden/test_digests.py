"""The bits of eight scenes are those that were committed, on one thread and on two."""

import importlib.util
import json
from pathlib import Path
from types import ModuleType

import pytest


def _load() -> ModuleType:
    spec = importlib.util.spec_from_file_location("golden_digests", Path(__file__).with_name("digests.py"))
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


golden = _load()
COMMITTED = json.loads(golden.FILE.read_text(encoding="utf-8"))


def test_all_scenes_have_a_digest() -> None:
    assert set(COMMITTED) == set(golden.scenes())


@pytest.mark.parametrize("name", COMMITTED)
def test_the_bits_are_those_committed(name: str) -> None:
    scene = golden.scenes()[name]
    for threads in (1, 2):
        assert golden.digest(scene, threads) == COMMITTED[name], (
            "if the bits were meant to change, run `python tests/golden/digests.py --write` and say why"
        )
