"""Many scenes at once, through the compiled module alone."""

import numpy as np
import pytest

from hybridmpm import _native


def drop(dim: int, height: float, stiffening: float = 1.0) -> _native.Solver:
    """Build a solver with a block of water at some height, in one substep a frame."""
    axis = np.arange(0.4, 0.6, 1 / 32, dtype=np.float32)
    x = np.stack(np.meshgrid(*[axis] * dim, indexing="ij"), -1).reshape(-1, dim)
    x[:, 1] += height
    count, volume = len(x), (1 / 32) ** dim
    return _native.Solver(
        resolution=16,
        frame_dt=0.0025,
        gravity=[0.0, -9.81, 0.0][:dim],
        wall_lower=[0.1] * dim,
        wall_upper=[0.9] * dim,
        materials=[_native.Material.water(density=1000.0, bulk_modulus=stiffening * 100_000.0)],
        x=x,
        v=np.zeros_like(x),
        material=np.zeros(count, np.uint8),
        mass=np.full(count, 1000.0 * volume, np.float32),
        volume=np.full(count, volume, np.float32),
        substeps=1,
        allow_unstable=stiffening > 1,
    )


def scenes() -> list[_native.Solver]:
    return [drop(dim, height) for dim in (2, 3) for height in (-0.2, 0.0, 0.2)]


def test_a_batch_gives_the_bits_of_each_scene_alone() -> None:
    together, alone = scenes(), scenes()
    _native.advance_all(together, 60)
    for one, other in zip(together, alone, strict=True):
        other.advance(60)
        assert one.frame == 60
        assert one.snapshot() == other.snapshot()


def test_a_scene_that_fails_stops_no_other() -> None:
    good, bad, last = drop(2, 0.0), drop(2, 0.2, stiffening=100.0), drop(2, 0.1)
    # Ten times the sound speed, far above the stability limit: some frame of the splash has to fail.
    with pytest.raises(_native.SimulationError, match="particle"):
        _native.advance_all([good, bad, last], 2000)
    assert good.frame == last.frame == 2000
    assert bad.frame < 2000


def test_no_scene_is_no_work() -> None:
    _native.advance_all([])
