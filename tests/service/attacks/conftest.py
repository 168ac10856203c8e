"""What attacks share."""

from collections.abc import Callable
from typing import Any

import pytest
from tests.service import conftest as service


@pytest.fixture
def problem() -> Callable[..., dict[str, Any]]:
    """Return the check of problems."""
    return service.problem
