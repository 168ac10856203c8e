"""The public list is what `__all__` says, the stub is shipped, and documents name what exists."""

import importlib
import inspect
import pkgutil
import re
import subprocess
import sys
from pathlib import Path
from types import ModuleType

import pytest

import hybridmpm
from hybridmpm import _native, errors


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
    loaded = importlib.import_module(module)
    assert [name for name in getattr(loaded, "__all__", []) if not hasattr(loaded, name)] == []


def test_stub_and_marker_are_shipped() -> None:
    package = Path(inspect.getfile(hybridmpm)).parent
    assert (package / "py.typed").exists()
    assert (package / "_native.pyi").exists()


def test_core_is_usable_directly() -> None:
    water = _native.Material.water(density=1000.0, bulk_modulus=1e5)
    assert (water.kind, water.density, water.sound_speed) == ("water", 1000.0, 10.0)
    assert water.cfl_limit >= 1.5 * water.default_cfl > 0


ROOT = Path(__file__).parents[3]


def test_every_test_that_the_table_names_exists() -> None:
    text = (ROOT / "docs/results/validation/failures.md").read_text(encoding="utf-8")
    named = re.findall(r"`([\w/.]+)::(\w+)`", text)
    assert len(named) > 20
    for file, test in named:
        assert re.search(rf"\b(?:def|fn) {test}\b", (ROOT / file).read_text(encoding="utf-8")), (file, test)


def test_the_table_names_every_test_of_a_failure() -> None:
    text = (ROOT / "docs/results/validation/failures.md").read_text(encoding="utf-8")
    tests = {
        name
        for file in (ROOT / "tests/python/failures").glob("test_*.py")
        for name in re.findall(r"^def (test_\w+)", file.read_text(encoding="utf-8"), re.MULTILINE)
    }
    assert {name for name in tests if name not in text} <= {
        "test_obstacles_of_two_cells_are_not_warned_of",
        "test_scenarios_have_no_thin_obstacle",
    }


README = Path(__file__).parents[3] / "README.md"


def test_the_example_runs_and_moves_the_water_by_the_arrow(tmp_path: Path) -> None:
    example, *_others = re.findall(r"```python\n(.*?)```", README.read_text(encoding="utf-8"), re.DOTALL)
    result = subprocess.run(
        [sys.executable, "-c", example], cwd=tmp_path, check=True, capture_output=True, text=True
    )
    match = re.search(r"\) \[ *(\S+) +(\S+?)\]", result.stdout)
    assert match, result.stdout
    assert all(abs(float(number) - 0.2) < 0.01 for number in match.groups()), result.stdout
