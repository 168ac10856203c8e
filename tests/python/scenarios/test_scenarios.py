"""The seven scenarios: within their limits for many seeds, reproducible, as documented."""

import itertools
from pathlib import Path

import numpy as np
import pytest

from hybridmpm import Scene, SceneError, UnknownScenarioError, scenarios
from hybridmpm.scenarios.placement import CLEARANCE, RAMP_GAP
from hybridmpm.scenarios.samplers import SAMPLERS, markdown_table

DOCS = Path(__file__).parents[3] / "docs" / "reference" / "scenarios.md"
SEEDS = range(200)
PAPER = {  # dimension, limit of particles, frames, as the paper's table has them
    "water_2d": (2, 4000, 1000),
    "water_ramps_2d": (2, 3300, 600),
    "sand_2d": (2, 4000, 320),
    "sand_ramps_2d": (2, 3300, 400),
    "water_3d": (3, 4000, 800),
    "sand_3d": (3, 4000, 350),
    "water_sand_2d": (2, 4000, 500),
}


def test_names_and_sizes_are_the_papers() -> None:
    infos = [scenarios.describe(name) for name in scenarios.NAMES]
    assert {info.name: (info.dim, info.max_particles, info.frames) for info in infos} == PAPER


@pytest.mark.parametrize("name", PAPER)
def test_many_seeds_stay_within_limits(name: str) -> None:
    dim, limit, frames = PAPER[name]
    for seed in SEEDS:
        scene = scenarios.get(name, seed)
        particles = scene.sample()
        assert (scene.dim, scene.frames) == (dim, frames)
        assert 0.3 * limit < len(particles.x) <= limit
        assert ((particles.x > scene.walls.lower) & (particles.x < scene.walls.upper)).all()
        _assert_bodies_apart(scene)
        _assert_ramps_clear(scene, particles.x)


def _assert_bodies_apart(scene: Scene) -> None:
    for one, other in itertools.combinations(scene.bodies, 2):
        (lower, upper), (other_lower, other_upper) = one.bounds, other.bounds
        gap = np.maximum(np.maximum(lower - other_upper, other_lower - upper), 0.0)
        assert np.linalg.norm(gap) > (CLEARANCE - 0.01) * scene.dx


def _assert_ramps_clear(scene: Scene, x: np.ndarray) -> None:
    assert len(scene.obstacles) <= 4
    for ramp in scene.obstacles:
        assert ramp.shape == "segment"
        assert ramp.thickness >= 2 * scene.dx
        assert ramp.to_native().signed_distance(x).min() > 0.9 * CLEARANCE * scene.dx
        ends = np.array([ramp.start, ramp.end])
        assert (ends - ramp.thickness / 2 > np.array(scene.walls.lower)).all()
        assert (ends + ramp.thickness / 2 < np.array(scene.walls.upper)).all()
        others = [other for other in scene.obstacles if other is not ramp and other.shape == "segment"]
        along = np.linspace(ends[0], ends[1], 50).astype(np.float32)
        for other in others:
            gap = other.to_native().signed_distance(along).min() - ramp.thickness / 2
            assert gap > 0.9 * RAMP_GAP * scene.dx


@pytest.mark.parametrize("name", PAPER)
def test_same_seed_same_scene(name: str) -> None:
    assert scenarios.get(name, 7) == scenarios.get(name, 7) == getattr(scenarios, name)(7)
    assert scenarios.get(name, 7) != scenarios.get(name, 8)


def test_the_range_of_each_count_is_used() -> None:
    scenes = [scenarios.water_ramps_2d(seed) for seed in SEEDS]
    assert {len(scene.bodies) for scene in scenes} == {1, 2, 3}
    assert {len(scene.obstacles) for scene in scenes} == {1, 2, 3, 4}
    mixed = [scenarios.water_sand_2d(seed) for seed in SEEDS]
    assert {len(scene.bodies) for scene in mixed} == {2, 3}
    assert all({body.material.kind for body in scene.bodies} == {"water", "sand"} for scene in mixed)


@pytest.mark.parametrize("name", ["nope", "", "Water_2d", None, ["water_2d"]])
def test_unknown_name_lists_those_there_are(name: object) -> None:
    with pytest.raises(
        UnknownScenarioError, match=r"scenario: must be one of water_2d, .*water_sand_2d; got"
    ):
        scenarios.get(name)  # type: ignore[arg-type]
    with pytest.raises(UnknownScenarioError):
        scenarios.describe(name)  # type: ignore[arg-type]


@pytest.mark.parametrize("seed", [-1, 2**53, 0.5, "1", None])
def test_bad_seed(seed: object) -> None:
    with pytest.raises(SceneError, match=r"seed: must be a whole number in \[0, 9007199254740991\]"):
        scenarios.get("water_2d", seed)  # type: ignore[arg-type]


def test_salts_differ() -> None:
    assert len({sampler.salt for sampler in SAMPLERS.values()}) == len(SAMPLERS)


def test_documented_table_is_the_samplers() -> None:
    assert markdown_table() in DOCS.read_text(encoding="utf-8")
