"""The compiled relaxation of density against the one with gradients."""

from typing import Any

import numpy as np
import pytest
import torch

from hybridmpm import ConfigError, radius_graph
from hybridmpm._native import relaxed
from hybridmpm.physics import NetworkSpec
from hybridmpm.physics.relaxation import STRENGTH, rest_density
from hybridmpm.training.physics.network.edges import EdgeList
from hybridmpm.training.physics.network.relaxation import relaxation


def _settings(dim: int) -> dict[str, Any]:
    return {
        "radius": 0.05,
        "rest_density": 0.5,
        "strength": STRENGTH,
        "rounds": 3,
        "lower": [0.1] * dim,
        "upper": [0.9] * dim,
    }


@pytest.mark.parametrize("dim", [2, 3])
def test_both_forms_agree(dim: int) -> None:
    rng = np.random.default_rng(0)
    # Crowded in a corner; edges are those of points a little elsewhere, as of the state before a step.
    x = rng.uniform(0.1, 0.2, (150, dim)).astype(np.float32)
    answer_weight = np.where(rng.random(150) < 0.2, 0.0, rng.random(150)).astype(np.float32)
    graph = radius_graph((x + rng.normal(0, 0.002, x.shape)).astype(np.float32), 0.05)
    found = relaxed(x, answer_weight, graph.starts, graph.senders, **_settings(dim))
    ends = (torch.from_numpy(ids.astype(np.int64)) for ids in (graph.senders, graph.receivers))
    edges, wanted = EdgeList(*ends, [150]), torch.from_numpy(x)
    for _ in range(3):
        push = relaxation(wanted, edges, 0.05, 0.5)
        wanted = (wanted + torch.from_numpy(answer_weight)[:, None] * push).clamp(0.1, 0.9)
    np.testing.assert_allclose(found, wanted, atol=5e-6)
    assert np.abs(found - x).max() > 0.01
    np.testing.assert_array_equal(found[answer_weight == 0], x[answer_weight == 0])


def test_a_lattice_at_rest_stays() -> None:
    spec = NetworkSpec(scenarios=("water_2d",), radius=0.0275, r_p=1 / 8)
    sites = 0.3 + spec.spacing * np.arange(12)
    x = np.stack(np.meshgrid(sites, sites), axis=-1).reshape(-1, 2).astype(np.float32)
    graph = radius_graph(x, spec.radius)
    settings = _settings(2) | {"radius": spec.radius, "rest_density": rest_density(spec)}
    found = relaxed(x, np.ones(len(x), np.float32), graph.starts, graph.senders, **settings)
    np.testing.assert_allclose(found, x, atol=1e-6)


def test_centre_of_mass_stays() -> None:
    x = np.random.default_rng(1).uniform(0.4, 0.5, (100, 2)).astype(np.float32)
    graph = radius_graph(x, 0.05)
    settings = _settings(2) | {"rest_density": 3.0}
    found = relaxed(x, np.ones(100, np.float32), graph.starts, graph.senders, **settings)
    assert ((found > 0.11) & (found < 0.89)).all()
    np.testing.assert_allclose(found.mean(0, np.float64), x.mean(0, np.float64), atol=1e-7)
    assert np.abs(found - x).max() > 1e-3


CASES: list[tuple[dict[str, Any], str]] = [
    ({"x": np.zeros((3, 4), np.float32)}, r"x must be float32 of shape \(N, 2\) or \(N, 3\)"),
    ({"answer_weight": np.zeros(2, np.float32)}, "answer_weight must have 3 entries for 3 points, got 2"),
    ({"starts": np.zeros(3, np.uint32)}, "starts must have 4 entries for 3 points, got 3"),
    ({"starts": np.array([0, 2, 1, 1], np.uint32)}, "starts must ascend from 0 to the number of senders, 1"),
    ({"starts": np.array([0, 0, 0, 2], np.uint32)}, "starts must ascend from 0 to the number of senders, 1"),
    ({"senders": np.array([3], np.uint32)}, "senders must be below 3, the number of points, got 3"),
    ({"radius": 0.0}, "radius must be finite and > 0, got 0"),
    ({"rest_density": float("nan")}, "rest_density must be finite and > 0, got NaN"),
    ({"lower": [0.1]}, "lower must have 2 components, got 1"),
    ({"upper": [0.9, 0.0]}, "lower must be at or below upper"),
]


@pytest.mark.parametrize(("change", "message"), CASES)
def test_what_does_not_fit_is_refused(change: dict[str, Any], message: str) -> None:
    graph = {"starts": np.array([0, 0, 1, 1], np.uint32), "senders": np.array([0], np.uint32)}
    fine = {
        "x": np.zeros((3, 2), np.float32),
        "answer_weight": np.ones(3, np.float32),
        **graph,
        **_settings(2),
    }
    relaxed(**fine)
    with pytest.raises(ConfigError, match=message):
        relaxed(**fine | change)
