"""What a transport network is told, and the noise that it begins with."""

from dataclasses import replace

import numpy as np
import pytest

from hybridmpm import MpmSolver, scenarios
from hybridmpm.control.goal.cloud import Cloud
from hybridmpm.control.methods.learned.features import Aim, State, inputs, rasters
from hybridmpm.control.methods.learned.noise import smooth_noise
from hybridmpm.control.methods.learned.spec import CELLS, TransportSpec
from hybridmpm.errors import ConfigError

AIM = Aim(np.array([0.4, 0.5]), np.array([[0.08, 0.02], [0.02, 0.05]]), 0.25)


def state() -> State:
    scene = scenarios.get("water_2d", 5)
    solver = MpmSolver(scene)
    solver.advance(60)
    cloud = Cloud.of(solver)
    lower, upper = (np.array(corner) for corner in (scene.walls.lower, scene.walls.upper))
    sand = np.arange(len(cloud.x)) % 3 == 0
    return State(
        cloud.x, cloud.v, sand, cloud.weight, scene.spacing**2, lower, upper, np.array(scene.gravity)
    )


def test_rasters_keep_area_momentum_and_energy() -> None:
    one = state()
    fill, velocity, deviation, sand = rasters(one)
    cell = np.prod(one.upper - one.lower) / CELLS**2
    assert fill.sum() * cell == pytest.approx(len(one.x) * one.particle_volume)
    assert sand.sum() == pytest.approx(fill.sum() * one.sand.mean())
    mass = fill * cell / one.particle_volume
    np.testing.assert_allclose((mass * velocity).sum(axis=(1, 2)), one.v.sum(axis=0), rtol=1e-3)
    energy = (mass * ((velocity**2).sum(axis=0) + deviation**2)).sum()
    assert energy == pytest.approx((one.v**2).sum(), rel=1e-3)


def test_a_mirrored_state_is_told_mirrored() -> None:
    """Left and right are alike: the network may be trained on mirrored states."""
    one = state()
    both, sign = one.lower[0] + one.upper[0], np.array([-1.0, 1.0])
    shift = np.array([both, 0.0])
    flipped = replace(one, x=shift + sign * one.x, v=sign * one.v)
    aim = Aim(shift + sign * AIM.mean, AIM.root * np.outer(sign, sign), AIM.seconds)
    mine, other = (inputs([a], [b], [None]) for a, b in ((one, AIM), (flipped, aim)))
    signs = np.ones(10)
    signs[[1, 5, 8]] = -1
    np.testing.assert_allclose(other.grid[0], signs[:, None, None] * mine.grid[0, :, :, ::-1], atol=1e-5)
    signs = np.ones(13)
    signs[0:12:2] = -1
    np.testing.assert_allclose(other.particles[0], signs * mine.particles[0], atol=1e-4)


def test_own_coordinates_go_back_to_metres() -> None:
    x = np.random.default_rng(0).uniform(0.1, 0.9, (50, 2))
    for aim in (AIM, replace(AIM, root=None)):
        np.testing.assert_allclose(aim.to_metres(aim.to_own(x)), x, atol=1e-12)


def test_noise_is_normal_and_smooth() -> None:
    places = np.random.default_rng(0).uniform(-1, 1, (200, 2))
    places[:4] = [[-1, -1], [1, 1], [-1, 1], [0, 0]]
    near = places + 0.01
    drawn = np.array([smooth_noise(np.random.default_rng(seed), places) for seed in range(2000)])
    np.testing.assert_allclose(drawn.mean(axis=0), 0, atol=0.12)
    np.testing.assert_allclose(drawn.var(axis=0), 1, atol=0.18)
    apart = smooth_noise(np.random.default_rng(0), near) - drawn[0]
    assert np.abs(apart).max() < 0.2


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"width": 22}, "multiple of 4"),
        ({"scenarios": ()}, "at least one"),
        ({"scenarios": ("water_3d",)}, "2D without obstacles"),
        ({"scenarios": ("water_ramps_2d",)}, "2D without obstacles"),
        ({"shortest": 0.5}, "shortest"),
        ({"longest": float("inf")}, "longest"),
    ],
)
def test_what_a_network_cannot_be(change: dict[str, object], message: str) -> None:
    with pytest.raises(ConfigError, match=message):
        TransportSpec(**{"scenarios": ("water_2d",), **change})  # type: ignore[arg-type]


def test_other_features_are_refused() -> None:
    plain = TransportSpec(scenarios=("water_2d",)).to_dict()
    assert TransportSpec.from_dict(plain, where="file").scenarios == ("water_2d",)
    with pytest.raises(ConfigError, match="file has transport features of version 0"):
        TransportSpec.from_dict({**plain, "features": 0}, where="file")
