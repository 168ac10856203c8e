"""Findings about coarse levels are compared with what the levels do."""

import numpy as np
import pytest

from hybridmpm import MpmSolver
from hybridmpm.coarse import coarse_level, coarse_warnings
from hybridmpm_lab.compare import findings


@pytest.mark.filterwarnings("ignore::hybridmpm.CoarseWarning")
@pytest.mark.parametrize("kind", findings.KINDS)
def test_scenes_of_each_kind_are_drawn_and_simulated(kind: str) -> None:
    make, material, words, bound = findings.KINDS[kind]
    scenes = [make(np.random.default_rng(seed), material) for seed in range(20)]
    assert scenes[0] == make(np.random.default_rng(0), material)
    said = [
        any(words in text for text in coarse_warnings(scene, coarse_level(scene, "1/64"))) for scene in scenes
    ]
    assert any(said)
    assert bound < 1
    MpmSolver(scenes[0], coarse="1/64").advance(2)
