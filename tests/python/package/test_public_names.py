"""The public list is what `__all__` says, and it all exists."""

import importlib
import pkgutil
from types import ModuleType

import pytest

import hybridmpm
from hybridmpm import errors


def test_all_names_exist() -> None:
    constants_first = sorted(hybridmpm.__all__, key=lambda name: (not name.isupper(), name))
    assert constants_first == hybridmpm.__all__
    assert [name for name in hybridmpm.__all__ if not hasattr(hybridmpm, name)] == []


def test_what_the_package_exposes_is_listed() -> None:
    submodules = {module.name for module in pkgutil.iter_modules(hybridmpm.__path__)}
    exposed = {
        name
        for name, value in vars(hybridmpm).items()
        if not name.startswith("_") and not (isinstance(value, ModuleType) and name in submodules)
    }
    modules = {name for name in hybridmpm.__all__ if isinstance(getattr(hybridmpm, name), ModuleType)}
    assert exposed | modules | {"__version__"} == set(hybridmpm.__all__)


def test_every_error_is_public_and_a_simulation_error() -> None:
    for name in errors.__all__:
        assert getattr(hybridmpm, name) is getattr(errors, name)
        assert issubclass(getattr(errors, name), errors.SimulationError)


@pytest.mark.parametrize(
    "module",
    [
        module.name
        for module in pkgutil.walk_packages(hybridmpm.__path__, "hybridmpm.")
        if not module.name.endswith("__main__")
    ],
)
def test_module_lists_only_names_that_exist(module: str) -> None:
    if ".bench.peers." in module:
        pytest.importorskip(module, reason="needs a peer: pip install 'hybridmpm[bench]'")
    loaded = importlib.import_module(module)
    assert [name for name in getattr(loaded, "__all__", []) if not hasattr(loaded, name)] == []
