"""The committed stub says what the compiled module is."""

import inspect
import subprocess
import sys
from pathlib import Path

import hybridmpm
from hybridmpm import _native

# The stub imports numpy alone; to read the package around it as well takes twice as long.
MYPY = """
[mypy]
strict = true
follow_imports = skip
[mypy-numpy.*]
follow_imports = normal
"""


def test_stub_agrees_with_the_module(tmp_path: Path) -> None:
    settings = tmp_path / "mypy.ini"
    settings.write_text(MYPY, encoding="utf-8")
    command = [sys.executable, "-m", "mypy.stubtest", "--concise", "hybridmpm._native"]
    python = Path(inspect.getfile(hybridmpm)).parents[1]
    done = subprocess.run(
        [*command, "--mypy-config-file", settings], capture_output=True, text=True, check=False, cwd=python
    )
    assert done.returncode == 0, done.stdout + done.stderr


def test_stub_and_marker_are_shipped() -> None:
    package = Path(inspect.getfile(hybridmpm)).parent
    assert (package / "py.typed").exists()
    assert (package / "_native.pyi").exists()


def test_core_is_usable_directly() -> None:
    water = _native.Material.water(density=1000.0, bulk_modulus=1e5)
    assert (water.kind, water.density, water.sound_speed) == ("water", 1000.0, 10.0)
    assert water.cfl_limit >= 1.5 * water.default_cfl > 0
