"""The public list is what `__all__` says, and it all exists."""

import importlib
import pkgutil
import subprocess
import sys
from types import ModuleType

import pytest

import hybridmpm
from hybridmpm import errors


def test_all_names_exist() -> None:
    constants_first = sorted(hybridmpm.__all__, key=lambda name: (not name.isupper(), name))
    assert constants_first == hybridmpm.__all__
    assert [name for name in hybridmpm.__all__ if not hasattr(hybridmpm, name)] == []


def test_what_a_scene_and_mpm_do_not_need_is_imported_on_demand() -> None:
    program = """
import sys
import hybridmpm
late = ("control", "data", "hybrid", "metrics", "physics", "planner", "simulators", "export")
assert not {f"hybridmpm.{name}" for name in late} & set(sys.modules)
assert not {"PIL", "matplotlib", "onnxruntime", "torch"} & set(sys.modules)
assert dir(hybridmpm) == sorted(hybridmpm.__all__)
assert hybridmpm.control.Arrow and hybridmpm.load and hybridmpm.HybridSimulator
"""
    subprocess.run([sys.executable, "-c", program], check=True)


def test_completion_knows_scenarios_and_models() -> None:
    assert set(hybridmpm.scenarios.NAMES) < set(dir(hybridmpm.scenarios))
    assert set(hybridmpm.physics.models()) < set(dir(hybridmpm.physics))
    for name in hybridmpm.physics.models():
        assert getattr(hybridmpm.physics, name) == name
    assert all(hasattr(hybridmpm.physics, name) for name in dir(hybridmpm.physics))


def test_a_name_that_is_not_there_is_an_attribute_error() -> None:
    with pytest.raises(AttributeError, match=r"no attribute 'MpmSolvr'; did you mean 'MpmSolver'\?"):
        _ = hybridmpm.MpmSolvr  # type: ignore[attr-defined]
    with pytest.raises(AttributeError, match="no attribute 'fluids_9d'"):
        _ = hybridmpm.physics.fluids_9d  # type: ignore[attr-defined]


def test_what_the_package_exposes_is_listed() -> None:
    submodules = {module.name for module in pkgutil.iter_modules(hybridmpm.__path__)}
    exposed = {
        name
        for name, value in vars(hybridmpm).items()
        if not name.startswith("_") and not (isinstance(value, ModuleType) and name in submodules)
    }
    modules = {name for name in hybridmpm.__all__ if isinstance(getattr(hybridmpm, name), ModuleType)}
    later = {name for name in hybridmpm.__all__ if name not in vars(hybridmpm)}
    assert exposed | modules | later | {"__version__"} == set(hybridmpm.__all__)


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
        pytest.importorskip(module, reason="needs a peer: pip install --editable lab")
    loaded = importlib.import_module(module)
    assert [name for name in getattr(loaded, "__all__", []) if not hasattr(loaded, name)] == []
