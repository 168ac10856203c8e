"""Scene files with ranges: what they draw, and what they refuse."""

import copy
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

from hybridmpm import Scene, SceneError, data

from .conftest import DROPS

EXAMPLE = Path(__file__).parents[3] / "docs" / "examples" / "dam-breaks.yaml"


def test_draws_lie_in_their_ranges_and_fill_them() -> None:
    template = data.SceneTemplate(DROPS)
    scenes = [template.draw(seed) for seed in range(60)]
    for extract, low, high in (
        (lambda scene: scene.bodies[0].center[0], 0.3, 0.7),
        (lambda scene: scene.bodies[0].radius, 0.04, 0.06),
    ):
        values = np.array([extract(scene) for scene in scenes])
        assert low <= values.min() < low + 0.1 * (high - low)
        assert high - 0.1 * (high - low) < values.max() <= high
    assert {scene.bodies[0].material.kind for scene in scenes} == {"water", "sand"}
    assert len({scene.bodies[0].seed for scene in scenes}) == 60
    assert {scene.bodies[0].center[1] for scene in scenes} == {0.5}
    assert scenes[7].name == "drops seed 7"


def test_a_seed_gives_one_scene_whatever_was_drawn_before() -> None:
    template = data.SceneTemplate(copy.deepcopy(DROPS))
    first = template.draw(5)
    template.draw(6)
    assert template.draw(5) == first
    assert template.draw(6) != first
    assert template.data == DROPS


def test_a_scene_without_ranges_differs_by_its_particles_alone(tmp_path: Path, drop: Scene) -> None:
    plain = drop.model_dump(exclude_none=True)
    del plain["bodies"][0]["seed"]
    drawn = data.SceneTemplate(yaml.safe_load(Scene.parse(plain).to_yaml())).draw(3)
    assert drawn.bodies[0].center == drop.bodies[0].center


def test_shift_vectors_integers_and_lists_of_bodies() -> None:
    box = {"shape": "box", "material": "water", "lower": [0.2, 0.2], "upper": [0.3, 0.25]}
    two = [box, {**box, "shift": [0.3, 0.0]}]
    template = data.SceneTemplate(
        {
            "dim": 2,
            "bodies": {"choice": [[{**box, "shift": {"uniform": [[0.0, 0.1], [0.4, 0.3]]}}], two]},
            "obstacles": [
                {
                    "shape": "segment",
                    "start": [0.2, 0.6],
                    "end": [0.3, 0.6],
                    "thickness": 0.02,
                    "shift": [0.1, 0.1],
                }
            ],
        }
    )
    scenes = [template.draw(seed) for seed in range(30)]
    assert {len(scene.bodies) for scene in scenes} == {1, 2}
    for scene in scenes:
        assert scene.obstacles[0].start == pytest.approx((0.3, 0.7))
        if len(scene.bodies) == 2:
            assert scene.bodies[1].lower == pytest.approx((0.5, 0.2))
            assert scene.bodies[0].seed != scene.bodies[1].seed
        else:
            x, y = np.subtract(scene.bodies[0].lower, (0.2, 0.2))
            assert 0.0 <= x <= 0.4
            assert 0.1 <= y <= 0.3
            assert np.subtract(scene.bodies[0].upper, scene.bodies[0].lower) == pytest.approx((0.1, 0.05))
    seeds = {"bodies": [{**box, "seed": {"integer": [3, 5]}}], "dim": 2}
    assert {data.SceneTemplate(seeds).draw(seed).bodies[0].seed for seed in range(30)} == {3, 4, 5}


def test_scenes_that_are_none_are_drawn_again() -> None:
    # Half of these balls reach out of the walls.
    reaching = {**DROPS, "bodies": [{**DROPS["bodies"][0], "center": [{"uniform": [-0.4, 0.7]}, 0.5]}]}
    template = data.SceneTemplate(reaching)
    assert all(0.1 < template.draw(seed).bodies[0].center[0] < 0.7 for seed in range(20))


def test_the_example_of_the_docs_works() -> None:
    template = data.SceneTemplate.load(EXAMPLE)
    scenes = [template.draw(seed) for seed in range(20)]
    assert len({scene.bodies[0].upper for scene in scenes}) == 20
    assert len({len(scene.obstacles) for scene in scenes}) == 2


def changed(**changes: Any) -> dict[str, Any]:
    return {**DROPS, "bodies": [{**DROPS["bodies"][0], **changes}]}


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ([], "must be an object with named fields"),
        ({**DROPS, "gravity": [0, {"uniform": [-10, -5]}]}, "gravity: must have no range"),
        ({**DROPS, "bodies": 3}, "bodies: must be a list, got 3"),
        (changed(radius={"uniform": [0.2]}), r"bodies\[0\]\.radius\.uniform: must be \[low, high\]"),
        (changed(radius={"uniform": [0.2, 0.1]}), "low <= high"),
        (changed(radius={"choice": []}), r"bodies\[0\]\.radius\.choice: must be a list, got \[\]"),
        (changed(seed={"integer": [0.5, 2]}), "must be two whole numbers"),
        (changed(shift=[0.1]), "shift must be as many numbers as the place that it moves"),
        (
            changed(radius={"uniform": [0.5, 0.6]}),
            "none of 100 draws of seed 0 is a valid scene; the last: bodies",
        ),
        (changed(radis=3), r"bodies\[0\]\.radis: unknown field"),
    ],
)
def test_bad_templates(content: Any, message: str) -> None:
    with pytest.raises(SceneError, match=message):
        data.SceneTemplate(content)


def test_bad_files(tmp_path: Path) -> None:
    (tmp_path / "a.yaml").write_text("dim: [")
    with pytest.raises(SceneError, match=r"a\.yaml is not YAML"):
        data.SceneTemplate.load(tmp_path / "a.yaml")
