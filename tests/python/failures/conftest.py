"""Solvers built particle by particle: failures often need states that no scene describes."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from hybridmpm import _native

Build = Callable[..., _native.Solver]


@pytest.fixture
def build() -> Build:
    """Return a function that builds a solver from positions (N, D), velocities and one material.

    Two particles per cell and axis at density 1000; walls at 0.1 and 0.9, no gravity, frames of 2.5 ms unless
    said otherwise. Further keywords go to `_native.Solver`.
    """

    def solver(
        x: Any, v: Any, material: _native.Material, *, resolution: int, **settings: Any
    ) -> _native.Solver:
        x = np.ascontiguousarray(x, dtype=np.float32)
        count, dim = x.shape
        volume = np.full(count, (0.5 / resolution) ** dim, np.float32)
        defaults: dict[str, Any] = {
            "frame_dt": 0.0025,
            "gravity": [0.0] * dim,
            "wall_lower": [0.1] * dim,
            "wall_upper": [0.9] * dim,
        }
        return _native.Solver(
            resolution=resolution,
            materials=[material],
            x=x,
            v=np.ascontiguousarray(np.broadcast_to(v, x.shape), dtype=np.float32),
            material=np.zeros(count, np.uint8),
            mass=volume * np.float32(material.density),
            volume=volume,
            **(defaults | settings),
        )

    return solver
