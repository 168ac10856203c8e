"""Solvers built particle by particle: failures often need states that no scene describes."""

from collections.abc import Callable

import pytest
from tests.python.conftest import native_solver

from hybridmpm import _native


@pytest.fixture
def build() -> Callable[..., _native.Solver]:
    """Return `native_solver`."""
    return native_solver
