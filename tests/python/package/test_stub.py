"""The committed stub says what the compiled module is."""

import inspect
import subprocess
import sys
from pathlib import Path

import hybridmpm
from hybridmpm import _native

ROOT = Path(__file__).parents[3]


def test_stub_agrees_with_the_module() -> None:
    command = [sys.executable, "-m", "mypy.stubtest", "--concise", "hybridmpm._native"]
    settings = ["--mypy-config-file", str(ROOT / "pyproject.toml")]
    done = subprocess.run([*command, *settings], capture_output=True, text=True, check=False, cwd=ROOT)
    assert done.returncode == 0, done.stdout + done.stderr


def test_stub_and_marker_are_shipped() -> None:
    package = Path(inspect.getfile(hybridmpm)).parent
    assert (package / "py.typed").exists()
    assert (package / "_native.pyi").exists()


def test_core_is_usable_directly() -> None:
    water = _native.Material.water(density=1000.0, bulk_modulus=1e5)
    assert (water.kind, water.density, water.sound_speed) == ("water", 1000.0, 10.0)
    assert water.cfl_limit >= 1.5 * water.default_cfl > 0
