"""The zero network is free fall between walls, exactly."""

import numpy as np
import pytest

from hybridmpm import ConfigError, Scene
from hybridmpm.physics.free_fall import FreeFall
from hybridmpm.scene.particle_types import KINEMATIC, WATER

G = np.array([0.0, -9.81])
WALLS = np.array([[0.1, 0.1], [0.9, 0.9]], dtype=np.float32)


def parabola(start: np.ndarray, velocity: np.ndarray, times: np.ndarray) -> np.ndarray:
    """Positions (T, N, 2) of thrown particles at some times [s], in float64."""
    t = times[:, None, None]
    return start + velocity * t + G * t**2 / 2


@pytest.mark.parametrize("r_t", [1, 2, 8, 16])
def test_a_throw_follows_its_parabola(r_t: int) -> None:
    frame_dt = 0.0025
    stepper = FreeFall(frame_dt=frame_dt, r_p=0.25, r_t=r_t)
    rng = np.random.default_rng(r_t)
    start, velocity = rng.uniform(0.4, 0.8, (50, 2)), rng.uniform(-0.3, 0.3, (50, 2))
    times = r_t * frame_dt * np.arange(12)
    truth = parabola(start, velocity, times)
    states = list(truth[:6].astype(np.float32))
    far = np.array([[-9.0, -9.0], [9.0, 9.0]], dtype=np.float32)
    types = np.full(50, WATER, dtype=np.int64)
    push = np.broadcast_to(G.astype(np.float32), (50, 2))
    for _ in range(6):
        states.append(stepper.step(np.stack(states[-6:]), types, push, far))
    # Second differences of a parabola are g dt^2 whatever dt, so only the rounding of float32 is left.
    np.testing.assert_allclose(np.stack(states), truth, atol=1e-5)
    assert (stepper.r_p, stepper.r_t) == (0.25, r_t)
    assert states[-1].dtype == np.float32


def test_walls_stop_it_and_obstacles_stay() -> None:
    x = np.array([[0.101, 0.5], [0.5, 0.11], [0.5, 0.5], [0.95, 0.5]])
    before = x - [[-0.02, 0.0], [0.0, -0.02], [-0.1, 0.0], [0.0, 0.0]]
    history = np.stack([before] * 5 + [x]).astype(np.float32)
    types = np.array([WATER, WATER, KINEMATIC, KINEMATIC])
    push = np.zeros((4, 2), dtype=np.float32)
    after = FreeFall(frame_dt=0.0025).step(history, types, push, WALLS)
    # The third moves in the history, and the fourth is past the wall: neither is the stepper's to change.
    expected = [[0.1, 0.5], [0.5, 0.1], [0.5, 0.5], [0.95, 0.5]]
    np.testing.assert_array_equal(after, np.array(expected, dtype=np.float32))


def test_bad_settings_are_named(drop: Scene) -> None:
    with pytest.raises(ConfigError, match=r"r_p must be in \(0, 1\], got 0"):
        FreeFall(frame_dt=0.0025, r_p=0)
    with pytest.raises(ConfigError, match=r"r_t must be in \[1, 64\], got 65"):
        FreeFall(frame_dt=0.0025, r_t=65)
    with pytest.raises(ConfigError, match=r"frames of 0\.005 s, those of drop last 0\.0025 s"):
        FreeFall(frame_dt=0.005).check(drop)
    FreeFall(frame_dt=drop.frame_dt).check(drop)
