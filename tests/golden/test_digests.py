"""The bits of eight scenes are those committed, with any number of threads and any vector instructions."""

import importlib.util
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType

import pytest

from hybridmpm import SOLVER_VERSION, ConfigError, _native


def _load() -> ModuleType:
    spec = importlib.util.spec_from_file_location("golden_digests", Path(__file__).with_name("digests.py"))
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


golden = _load()
COMMITTED = golden.committed()


def test_all_scenes_have_a_digest() -> None:
    assert set(COMMITTED["scenes"]) == set(golden.scenes())


def test_the_digests_are_those_of_this_version_of_the_solver() -> None:
    assert COMMITTED["solver_version"] == SOLVER_VERSION


def test_other_bits_need_another_version() -> None:
    older = {"solver_version": 1, "scenes": {"water_2d": {"particles": 1, "sha256": "a"}}}
    other = {"scenes": {"water_2d": {"particles": 1, "sha256": "b"}}}
    with pytest.raises(ValueError, match="differ from those of solver version 1: raise SOLVER_VERSION"):
        golden.checked(older, other | {"solver_version": 1})
    assert golden.checked(older, other | {"solver_version": 2})["solver_version"] == 2
    assert golden.checked(older, older) == older


@pytest.mark.parametrize("name", COMMITTED["scenes"])
def test_the_bits_are_those_committed(name: str) -> None:
    scene = golden.scenes()[name]
    for threads in (1, 2):
        assert golden.digest(scene, threads) == COMMITTED["scenes"][name], (
            "if the bits were meant to change, raise SOLVER_VERSION, run "
            "`python tests/golden/digests.py --write` and say why"
        )


@pytest.fixture
def _widest_again() -> Iterator[None]:
    yield
    _native.limit_instructions("avx512")


@pytest.mark.usefixtures("_widest_again")
@pytest.mark.parametrize("name", ["elastic_and_obstacles", "sand_3d"])
@pytest.mark.parametrize("instructions", ["portable", "avx2"])
def test_the_bits_do_not_depend_on_the_instructions(name: str, instructions: str) -> None:
    in_use = _native.limit_instructions(instructions)
    assert in_use in ("portable", instructions)
    assert golden.digest(golden.scenes()[name]) == COMMITTED["scenes"][name]


def test_a_set_of_instructions_that_does_not_exist_is_refused() -> None:
    with pytest.raises(ConfigError, match="portable, avx2 or avx512"):
        _native.limit_instructions("avx1024")
