"""The committed WebAssembly modules are those of the present sources, and small."""

import gzip
import importlib.util
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
MODULES = ROOT / "python" / "hybridmpm" / "playing"
NAMES = ("plane", "plane-exact", "space", "space-exact")


def _digest() -> str:
    spec = importlib.util.spec_from_file_location("web_sources", ROOT / "rust" / "web" / "sources.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return str(module.digest())


def test_the_modules_are_those_of_the_present_sources() -> None:
    built_from = (MODULES / "modules.txt").read_text(encoding="utf-8").strip()
    assert built_from == _digest(), (
        "the solver has changed: run `make web` and commit python/hybridmpm/playing"
    )


@pytest.mark.parametrize("name", NAMES)
def test_each_module_is_small(name: str) -> None:
    packed = (MODULES / f"{name}.wasm.gz").read_bytes()
    # Each material has transfers of its own: a fourth one takes 70 000 bytes. Distances to meshes: 100 000;
    # rigid bodies on meshes: 20 000.
    assert len(packed) < 555_000
    assert gzip.decompress(packed).startswith(b"\0asm")
