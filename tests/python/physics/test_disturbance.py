"""Where nothing happens, a body falls freely whatever the network answers; obstacles stay where they are."""

import numpy as np
import pytest
import torch

from hybridmpm.data.particle_types import KINEMATIC, WATER
from hybridmpm.physics.spec import HISTORY, NetworkSpec, Normalization
from hybridmpm.training.disturbance import disturbance
from hybridmpm.training.simulator import LearnedSimulator
from hybridmpm.training.windows import edges_of

SPEC = NetworkSpec(
    scenarios=("water_2d",), latent=8, layers=2, hidden_layers=1, radius=0.03, r_p=1 / 8, r_t=4, relaxations=2
)
WALLS = torch.tensor([[0.1, 0.1], [0.9, 0.9]])
GRAVITY = torch.tensor([0.0, -9.81])
COUNT = 25


def falling(height: float) -> torch.Tensor:
    """Return a history (6, 25, 2) of a square in free fall, its lower edge at a height in the end."""
    x, y = np.meshgrid(np.linspace(0.4, 0.44, 5), np.linspace(height, height + 0.04, 5))
    square = np.stack([x.ravel(), y.ravel()], axis=1)
    t = (np.arange(HISTORY) - HISTORY + 1)[:, None, None] * SPEC.step_dt
    path = square + np.array([0.3, -0.2]) * t + 0.5 * GRAVITY.numpy() * t**2
    return torch.from_numpy(path.astype(np.float32))


def shares(history: torch.Tensor) -> torch.Tensor:
    types = torch.full((COUNT,), WATER)
    graph = edges_of(history[-1], types, (COUNT,), SPEC.radius)
    known = (GRAVITY * SPEC.step_dt**2).expand(COUNT, 2)
    scale = torch.full((2,), 2e-3)
    return disturbance(history, known, WALLS, graph, radius=SPEC.radius, scale=scale, hops=2)


def step(history: torch.Tensor, types: torch.Tensor) -> torch.Tensor:
    torch.manual_seed(0)
    one = (2e-3, 2e-3)
    scales = Normalization(
        velocity_mean=(0.0, 0.0), velocity_std=one, acceleration_mean=one, acceleration_std=one, noise_std=0.0
    )
    graph = edges_of(history[-1], types, (COUNT,), SPEC.radius)
    with torch.no_grad():
        return LearnedSimulator(SPEC, scales)(history, types, GRAVITY.expand(COUNT, 2), WALLS, graph)


def test_nothing_happens_to_a_body_in_free_fall() -> None:
    assert torch.equal(shares(falling(0.6)), torch.zeros(COUNT, 1))


@pytest.mark.parametrize("what", ["wall", "push", "shear"])
def test_a_disturbance_is_seen(what: str) -> None:
    history = falling(0.11 if what == "wall" else 0.6)
    if what == "push":
        history[-1] += torch.tensor([1e-3, 0.0])
    if what == "shear":
        # Half of the body has moved against the other all along.
        history[:, : COUNT // 2, 0] += torch.linspace(-5e-3, 0.0, HISTORY)[:, None]
    assert shares(history).min() > 0.9


def test_an_untrained_network_lets_an_undisturbed_body_fall() -> None:
    history = falling(0.6)
    expected = 2 * history[-1] - history[-2] + GRAVITY * SPEC.step_dt**2
    water = torch.full((COUNT,), WATER)
    assert torch.allclose(step(history, water), expected, atol=1e-7)
    # Near the floor it answers something else, so the test above is not empty.
    near = falling(0.11)
    free = (2 * near[-1] - near[-2] + GRAVITY * SPEC.step_dt**2).clamp(0.1, 0.9)
    assert not torch.allclose(step(near, water), free, atol=1e-4)


def test_kinematic_particles_stay_where_they_are() -> None:
    history = falling(0.11)
    types = torch.full((COUNT,), WATER)
    types[:7] = KINEMATIC
    assert torch.equal(step(history, types)[:7], history[-1][:7])
    assert not torch.equal(step(history, types)[7:], history[-1][7:])
