"""Where nothing happens, a body falls freely whatever the network answers; obstacles stay where they are."""

from typing import Any

import numpy as np
import pytest
import torch
from tests.python.physics.conftest import random_inputs

from hybridmpm import ConfigError, Scene, radius_graph
from hybridmpm._native import answer_weights as compiled
from hybridmpm.physics.answer_gate import MOST, QUIET, UNNOTICED
from hybridmpm.physics.answer_gate import answer_weights as served_weights
from hybridmpm.physics.free_fall import FreeFall
from hybridmpm.physics.model import NeuralModel
from hybridmpm.physics.spec import HISTORY, NetworkSpec, Normalization
from hybridmpm.scene.particle_types import KINEMATIC, WATER
from hybridmpm.training.physics.network.answer_gate import answer_weights
from hybridmpm.training.physics.network.simulator import LearnedSimulator
from hybridmpm.training.physics.windows import edges_of

SPEC = NetworkSpec(
    scenarios=("water_2d",), latent=8, layers=2, hidden_layers=1, radius=0.03, r_p=1 / 8, r_t=4
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


def weights(history: torch.Tensor) -> torch.Tensor:
    types = torch.full((COUNT,), WATER)
    graph = edges_of(history[-1], types, (COUNT,), SPEC.radius)
    known = (GRAVITY * SPEC.step_dt**2).expand(COUNT, 2)
    scale = torch.full((2,), 2e-3)
    return answer_weights(history, known, WALLS, graph, radius=SPEC.radius, scale=scale, hops=2)


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
    assert torch.equal(weights(falling(0.6)), torch.zeros(COUNT, 1))


@pytest.mark.parametrize("what", ["wall", "push", "shear"])
def test_a_disturbance_is_seen(what: str) -> None:
    history = falling(0.11 if what == "wall" else 0.6)
    if what == "push":
        history[-1] += torch.tensor([1e-3, 0.0])
    if what == "shear":
        # Half of the body has moved against the other all along.
        history[:, : COUNT // 2, 0] += torch.linspace(-5e-3, 0.0, HISTORY)[:, None]
    assert weights(history).min() > 0.9


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


@pytest.mark.parametrize("dim", [2, 3])
def test_both_forms_agree(model: NeuralModel, model_3d: NeuralModel, dim: int) -> None:
    """What training computes with gradients and what serving computes compiled."""
    info = (model if dim == 2 else model_3d).info
    simulator = LearnedSimulator(info.spec, info.scales)
    seen = []
    for nudge in (0.0, 0.02, 0.05, 0.1, 1.0):
        given = random_inputs(np.random.default_rng(1), 150, dim, kinematic=20, width=0.3)
        types, known = given["types"], given["acceleration"]
        # All falls freely, but that one particle in ten was a little elsewhere in the oldest state.
        t = info.spec.step_dt * np.arange(-5, 1)[:, None, None]
        path = given["history"][-1] + np.where((types == KINEMATIC)[:, None], 0.0, 0.5 * known * t * t)
        path[0, ::10] += nudge * np.array(info.scales.acceleration_std)
        state = (path.astype(np.float32), types, known, given["walls"])
        graph = radius_graph(state[0][-1], info.spec.radius, types, kinematic=KINEMATIC)
        found = served_weights(*state, graph, spec=info.spec, scales=info.scales)
        tensors = [torch.from_numpy(part) for part in state]
        edges = edges_of(tensors[0][-1], tensors[1], (len(types),), info.spec.radius)
        np.testing.assert_allclose(found, simulator.answer_weights(*tensors, edges)[:, 0], atol=2e-3)
        assert (found[types == KINEMATIC] == 0).all()
        seen.append(found)
    everywhere = np.concatenate(seen)
    assert (everywhere == 0).any()
    assert (everywhere > 0.999).any()
    assert ((everywhere > 0.1) & (everywhere < 0.9)).any()


def test_the_network_rests_while_nothing_happens(model: NeuralModel, monkeypatch: pytest.MonkeyPatch) -> None:
    history = falling(0.6).numpy()
    water = np.full(COUNT, WATER)
    known = np.tile(GRAVITY.numpy(), (COUNT, 1))
    runs = []
    monkeypatch.setattr(model._session, "run", lambda *_: runs.append(1) or [np.zeros((COUNT, 2))])
    found = model.step(history, water, known, WALLS.numpy())
    expected = 2 * history[-1] - history[-2] + known * np.float32(model.spec.step_dt**2)
    np.testing.assert_allclose(found, expected, atol=1e-6)
    assert not runs
    model.step(falling(0.11).numpy(), water, known, WALLS.numpy())
    assert runs == [1]


CASES: list[tuple[dict[str, Any], str]] = [
    ({"history": np.zeros((1, 3, 2), np.float32)}, r"history must be float32 of shape \(S, N, 2\)"),
    ({"history": np.zeros((6, 3, 4), np.float32)}, r"got shapes \[6, 3, 4\] and \[3, 2\]"),
    (
        {"known_acceleration": np.zeros((2, 2), np.float32)},
        "known_acceleration must have 3 entries for 3 points, got 2",
    ),
    ({"starts": np.zeros(3, np.uint32)}, "starts must have 4 entries for 3 points, got 3"),
    ({"senders": np.array([3], np.uint32)}, "senders must be below 3, the number of points, got 3"),
    ({"radius": 0.0}, "radius must be finite and > 0, got 0"),
    ({"scale": [1.0, 0.0]}, "scale must be finite and > 0, got 0"),
    ({"scale": [1.0]}, "scale must have 2 components, got 1"),
    ({"quiet": float("nan")}, "quiet must be finite and > 0, got NaN"),
    ({"upper": [0.9, 0.0]}, "lower must be at or below upper"),
]


@pytest.mark.parametrize(("change", "message"), CASES)
def test_what_does_not_fit_is_refused(change: dict[str, Any], message: str) -> None:
    fine = {
        "history": np.zeros((6, 3, 2), np.float32),
        "known_acceleration": np.zeros((3, 2), np.float32),
        "starts": np.array([0, 0, 1, 1], np.uint32),
        "senders": np.array([0], np.uint32),
        "radius": 0.1,
        "scale": [1.0, 1.0],
        "hops": 2,
        "quiet": QUIET,
        "unnoticed": UNNOTICED,
        "most": MOST,
        "lower": [0.1] * 2,
        "upper": [0.9] * 2,
    }
    assert compiled(**fine).shape == (3,)
    with pytest.raises(ConfigError, match=message):
        compiled(**fine | change)


G = np.array([0.0, -9.81])
BOX = np.array([[0.1, 0.1], [0.9, 0.9]], dtype=np.float32)


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
    after = FreeFall(frame_dt=0.0025).step(history, types, push, BOX)
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
