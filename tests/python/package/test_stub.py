"""The stub of the compiled module is shipped; `make lint` holds it against the module."""

import inspect
from pathlib import Path

import hybridmpm
from hybridmpm import _native


def test_stub_and_marker_are_shipped() -> None:
    package = Path(inspect.getfile(hybridmpm)).parent
    assert (package / "py.typed").exists()
    assert (package / "_native.pyi").exists()


def test_core_is_usable_directly() -> None:
    water = _native.Material.water(density=1000.0, bulk_modulus=1e5)
    assert (water.kind, water.density, water.sound_speed) == ("water", 1000.0, 10.0)
    assert water.cfl_limit >= 1.5 * water.default_cfl > 0
