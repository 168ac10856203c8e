"""Motions that laws are made of."""

from typing import Any

import pytest

from hybridmpm.control.goal.paths import Motion
from hybridmpm.control.laws import Tracked


@pytest.fixture
def motions(monkeypatch: pytest.MonkeyPatch) -> list[Motion]:
    """Return the motions of which laws are made from now on."""
    along, made = Tracked.along, []

    def noted(motion: Motion, *args: Any, **settings: Any) -> Tracked:
        made.append(motion)
        return along(motion, *args, **settings)

    monkeypatch.setattr(Tracked, "along", noted)
    return made
