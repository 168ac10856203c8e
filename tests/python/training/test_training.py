"""Training of learned simulators: it learns, resumes exactly, and refuses what it cannot use."""

import dataclasses
import json
from collections.abc import Iterator
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch

from hybridmpm import data
from hybridmpm.data import metadata
from hybridmpm.errors import ConfigError, DataError
from hybridmpm.physics.spec import HISTORY, NetworkSpec, Normalization
from hybridmpm.scene.particle_types import KINEMATIC, WATER
from hybridmpm.training import checkpoint, run
from hybridmpm.training.physics import datasets
from hybridmpm.training.physics.rollouts import errors, log_rollouts, rollout
from hybridmpm.training.physics.scales import normalization
from hybridmpm.training.physics.trainer import Trainer, huber_loss
from hybridmpm.training.physics.windows import Windows, edges_of, first_push
from hybridmpm.training.settings import TrainingSettings
from hybridmpm.training.sources import Drawn

CPU = torch.device("cpu")
Trajectories = list[data.Trajectory]
SPEC = NetworkSpec(
    scenarios=("water_2d",), latent=16, layers=2, hidden_layers=1, radius=0.04, r_p=1 / 16, r_t=4
)


@pytest.fixture(scope="module", autouse=True)
def one_thread() -> Iterator[None]:
    before = torch.get_num_threads()
    torch.set_num_threads(1)
    yield
    torch.set_num_threads(before)


@pytest.fixture(scope="module")
def trajectories() -> list[data.Trajectory]:
    recipe = data.Recipe(scenario="water_2d", frames=160, stride=SPEC.r_t, r_p=SPEC.r_p, substeps="cfl")
    return [data.simulate(recipe, seed) for seed in range(8)]


def trainer_of(trajectories: Trajectories, spec: NetworkSpec = SPEC, **settings: Any) -> Trainer:
    chosen = TrainingSettings(**{"steps": 200, "unroll": 1, "noise": 0.1, "batch": 2} | settings)
    return Trainer(spec, normalization(trajectories, spec, chosen.noise), chosen, CPU)


def windows_of(trajectories: Trajectories, unroll: int) -> Windows:
    return Windows(trajectories, unroll, step_dt=SPEC.step_dt)


def weights_of(trainer: Trainer) -> np.ndarray:
    return torch.cat([weight.flatten() for weight in trainer.simulator.parameters()]).detach().numpy()


def test_two_hundred_steps_halve_the_loss(trajectories: Trajectories) -> None:
    trainer = trainer_of(trajectories, noise=0.02, learning_rate=3e-3, final_rate=1e-3)
    windows = windows_of(trajectories, 1)
    losses = [trainer.step(windows) for _ in range(200)]
    # The median: of eight scenes, those with an impact have ten times the loss of the others.
    assert np.median(losses[-40:]) < 0.5 * np.median(losses[:10])


@pytest.mark.parametrize("seed", [0, 1])
def test_a_seed_gives_the_same_weights_again(trajectories: Trajectories, seed: int) -> None:
    first, again = (trainer_of(trajectories, steps=6, unroll=2, seed=seed) for _ in range(2))
    windows = windows_of(trajectories, 2)
    for trainer in (first, again):
        for _ in range(6):
            trainer.step(windows)
    assert np.array_equal(weights_of(first), weights_of(again))
    assert not np.array_equal(weights_of(first), weights_of(trainer_of(trajectories, seed=seed + 7)))


def test_an_interrupted_training_gives_the_weights_of_an_uninterrupted_one(
    trajectories: Trajectories, tmp_path: Path
) -> None:
    windows = windows_of(trajectories, 2)
    whole = trainer_of(trajectories, steps=8, unroll=2)
    for _ in range(8):
        whole.step(windows)
    part = trainer_of(trajectories, steps=8, unroll=2)
    for _ in range(3):
        part.step(windows)
    checkpoint.save(tmp_path / "c.pt", part, {})
    resumed = Trainer.load(tmp_path / "c.pt", CPU)
    while resumed.step_count < 8:
        resumed.step(windows)
    assert np.array_equal(weights_of(whole), weights_of(resumed))


def test_a_step_leaves_small_numbers_as_they_were(trajectories: Trajectories) -> None:
    """A processor's mode once outlived the training, and broke whoever computed next in the process."""
    trainer_of(trajectories).step(windows_of(trajectories, 1))
    assert np.float64(5e-324) * 1.0 > 0.0


def test_a_run_writes_its_checkpoint_logs_and_picture(trajectories: Trajectories, tmp_path: Path) -> None:
    trainer = trainer_of(trajectories, steps=100)
    seen = []
    run.train(
        trainer,
        tmp_path,
        step=partial(trainer.step, windows_of(trajectories[:4], 1)),
        validate=partial(log_rollouts, trainer, tmp_path, trajectories[4:5]),
        about={"command": "a test"},
        checkpoint_seconds=0.1,
        validation_seconds=1e9,
        on_step=lambda loss: seen.append((trainer.step_count, loss)),
    )
    assert [step for step, _ in seen] == list(range(1, 101))
    losses, rollouts = (
        json.loads((tmp_path / f"{name}.jsonl").read_text()) for name in ("losses", "rollouts")
    )
    assert list(losses) == ["step", "seconds", "loss", "learning_rate", "unroll"]
    assert losses["step"] == 100
    assert list(rollouts)[:4] == ["trained_steps", "scene", "step_10", "step_25"]
    assert (tmp_path / "rollout.png").stat().st_size > 5000
    state = checkpoint.read(tmp_path / run.CHECKPOINT)
    assert state["about"] == {"command": "a test"}
    assert state["step"] == 100


def test_a_loss_that_is_not_finite_keeps_the_last_checkpoint(
    trajectories: Trajectories, tmp_path: Path
) -> None:
    trainer = trainer_of(trajectories, steps=50)
    checkpoint.save(tmp_path / run.CHECKPOINT, trainer, {})
    before = (tmp_path / run.CHECKPOINT).read_bytes()
    with torch.no_grad():
        next(trainer.simulator.parameters()).fill_(float("nan"))
    with pytest.raises(ConfigError, match=r"the loss is nan at step 0; lower learning_rate \(now 0\.001\)"):
        run.train(
            trainer,
            tmp_path,
            step=partial(trainer.step, windows_of(trajectories[:2], 1)),
            validate=lambda: None,
            about={},
            on_step=lambda _loss: None,
        )
    assert (tmp_path / run.CHECKPOINT).read_bytes() == before


# At rest.


def gradient_norm(loss: torch.Tensor, at: torch.Tensor) -> float:
    (gradient,) = torch.autograd.grad(loss, at)
    return float(torch.linalg.vector_norm(gradient))


def test_the_loss_does_not_blow_up_at_rest() -> None:
    scale = torch.ones(2)
    for acceleration in (1.0, 1e-3, 1e-6):
        true = torch.full((5, 2), acceleration)
        predicted = torch.zeros(5, 2, requires_grad=True)
        assert gradient_norm(huber_loss(predicted, true, scale, 1), predicted) <= np.sqrt(2 / 5) + 1e-6
    moving = torch.full((5, 2), 1e-6, requires_grad=True)
    assert gradient_norm(huber_loss(moving, torch.zeros(5, 2), scale, 1), moving) < 1e-5


def test_huber_loss_by_hand() -> None:
    true = torch.zeros(1, 2)
    predicted = torch.tensor([[0.5, 3.0]])
    # 0.5^2 / 2 below one scale, |3| - 1/2 beyond; after two steps an acceleration counts three times.
    assert float(huber_loss(predicted, true, torch.ones(2), 1)) == pytest.approx(0.125 + 2.5)
    assert float(huber_loss(3 * predicted, true, torch.ones(2), 2)) == pytest.approx(0.125 + 2.5)


# Windows.


def test_targets_of_a_window_are_the_states_that_follow(trajectories: Trajectories) -> None:
    windows = windows_of(trajectories[:1], 3)
    batch = windows.draw(np.random.default_rng(4), size=3, unroll=3, noise_std=0.0)
    path = trajectories[0].positions
    count = path.shape[1]
    assert batch.counts == (count,) * 3
    for number in range(3):
        part = slice(number * count, (number + 1) * count)
        states = torch.cat([batch.history, batch.targets])[:, part].numpy()
        mirrored = states.copy()
        mirrored[..., 0] = 1.0 - mirrored[..., 0]
        starts = range(len(path) - HISTORY - 2)
        assert any(
            np.allclose(candidate, path[first : first + HISTORY + 3], atol=1e-6)
            for first in starts
            for candidate in (states, mirrored)
        )
    assert torch.equal(batch.acceleration, torch.tensor([0.0, -9.81]).expand_as(batch.acceleration))


def test_noise_is_a_random_walk_that_the_target_follows(trajectories: Trajectories) -> None:
    quiet, noisy = (
        windows_of(trajectories, 1).draw(np.random.default_rng(2), size=1, unroll=1, noise_std=std)
        for std in (0.0, 1e-3)
    )
    noise = (noisy.history - quiet.history).numpy()
    assert np.all(noise[0] == 0)
    assert np.std(noise[-1] - noise[-2]) == pytest.approx(1e-3, rel=0.15)
    assert np.allclose(noisy.targets - quiet.targets, noise[-1], atol=1e-7)


def test_noise_leaves_kinematic_particles_where_they_are() -> None:
    recipe = data.Recipe(scenario="water_ramps_2d", frames=40, stride=4, r_p=1 / 16, substeps="cfl")
    trajectory = data.simulate(recipe, 0)
    windows = windows_of([trajectory], 1)
    noisy = windows.draw(np.random.default_rng(2), size=1, unroll=1, noise_std=1e-3)
    still = ~noisy.moving
    assert still.sum() == (trajectory.types == KINEMATIC).sum() > 0
    assert torch.equal(noisy.history[0][still], noisy.history[-1][still])
    assert torch.equal(noisy.targets[0][still], noisy.history[-1][still])


def test_windows_begin_shortly_before_the_first_contact(trajectories: Trajectories) -> None:
    trajectory = trajectories[0]
    steps = np.diff(trajectory.positions.astype(np.float64), n=2, axis=0) / SPEC.step_dt**2
    falling = np.linalg.norm(steps - np.array(trajectory.scene.gravity), axis=2).max(axis=1) < 1.0
    contact = int(np.flatnonzero(~falling)[0]) + 1
    assert contact > HISTORY + 5, "the scene has to begin with free fall"
    pushed = first_push(trajectory, SPEC.step_dt)
    assert contact <= pushed <= contact + 2
    windows = windows_of([trajectory], 1)
    begun = [
        float(windows.draw(np.random.default_rng(seed), size=1, unroll=1, noise_std=0.0).history[0, 0, 1])
        for seed in range(60)
    ]
    path = trajectory.positions[:, 0, 1]
    assert max(begun) <= path[pushed - HISTORY - 5] + 1e-6 < path[0] - 1e-3
    assert min(begun) >= path.min() - 1e-6


def test_edges_join_only_particles_of_one_window() -> None:
    x = torch.tensor([[0.5, 0.5], [0.51, 0.5], [0.5, 0.5]])
    graph = edges_of(x, torch.tensor([WATER, WATER, WATER]), (2, 1), 0.05)
    received = graph.sum(graph.from_senders(torch.tensor([[1.0], [2.0], [4.0]])))
    assert received.flatten().tolist() == [2.0, 1.0, 0.0]


def test_edges_do_not_lead_into_kinematic_particles() -> None:
    x = torch.tensor([[0.5, 0.5], [0.51, 0.5]])
    graph = edges_of(x, torch.tensor([WATER, KINEMATIC]), (2,), 0.05)
    received = graph.sum(graph.from_senders(torch.tensor([[1.0], [2.0]])))
    assert received[0].item() == 2.0


def test_scales_are_those_of_the_data_with_the_noise_folded_in(trajectories: Trajectories) -> None:
    scales = normalization(trajectories, SPEC, 0.1)
    velocity = np.concatenate(
        [np.diff(t.positions.astype(float), axis=0).reshape(-1, 2) for t in trajectories]
    )
    assert scales.noise_std == pytest.approx(0.1 * np.sqrt(np.mean(velocity.std(axis=0) ** 2)), rel=1e-6)
    assert scales.velocity_std == pytest.approx(np.hypot(velocity.std(axis=0), scales.noise_std), rel=1e-6)
    assert scales.velocity_mean == pytest.approx([0.0, velocity[:, 1].mean()])
    changes = [np.diff(t.positions.astype(float), n=2, axis=0).reshape(-1, 2) for t in trajectories]
    free = np.concatenate(changes) - np.array([0.0, -9.81]) * SPEC.step_dt**2
    assert scales.acceleration_std == pytest.approx(np.hypot(free.std(axis=0), scales.noise_std), rel=1e-5)


# A network that knows the answer.


def test_a_network_that_knows_the_accelerations_rolls_out_to_the_recorded_positions(
    trajectories: Trajectories, monkeypatch: pytest.MonkeyPatch
) -> None:
    trajectory = trajectories[0]
    trainer = trainer_of(trajectories)
    simulator, path = trainer.simulator, trajectory.positions.astype(np.float64)
    known = np.array([0.0, -9.81]) * SPEC.step_dt**2
    state = iter(range(HISTORY, len(path)))

    def recorded(*_: object) -> torch.Tensor:
        now = next(state)
        residual = path[now] - 2 * path[now - 1] + path[now - 2] - known
        mean, std = simulator.acceleration_mean, simulator.acceleration_std
        return (torch.from_numpy(residual).float() - mean) / std

    simulator.answer = recorded
    # Without it an answer would count in part where a body is hardly disturbed.
    monkeypatch.setattr(
        "hybridmpm.training.physics.network.simulator.answer_weights", lambda *_, **__: torch.ones(())
    )
    found = rollout(simulator, trajectory)
    # Rounding alone: an error of an acceleration grows with the square of the steps.
    assert np.abs(found - trajectory.positions).max() < 1e-7 * len(path) ** 2
    assert errors(found, trajectory).max() < 1e-2


# Bad input.


def test_data_of_another_time_step_are_refused(tmp_path: Path) -> None:
    amount = datasets.Amount(train=1, valid=1, frames=40)
    water = Drawn(scenario="water_2d")
    datasets.prepare(tmp_path, water, SPEC, amount)
    assert len(list(datasets.trajectories(tmp_path, water, SPEC, "train"))) == 1
    folder = datasets.folder_of(tmp_path, water, SPEC)
    about = json.loads((folder / metadata.FILE).read_text())
    for key, value, text in (
        ("dt", 0.004, "dt is 0.004, but the network is for 0.01"),
        (
            "bounds",
            [[0.0, 1.0], [0.1, 0.9]],
            r"bounds is \[\[0.0, 1.0\], \[0.1, 0.9\]\], but the network is for",
        ),
    ):
        (folder / metadata.FILE).write_text(json.dumps({**about, key: value}))
        with pytest.raises(DataError, match=text):
            list(datasets.trajectories(tmp_path, water, SPEC, "train"))


def test_trajectories_without_a_scene_are_refused(trajectories: Trajectories) -> None:
    bare = dataclasses.replace(trajectories[0], scene=None)
    with pytest.raises(DataError, match="comes without its scene"):
        windows_of([bare], 1)


def test_trajectories_that_are_too_short_are_refused(trajectories: Trajectories) -> None:
    short = dataclasses.replace(trajectories[0], positions=trajectories[0].positions[:6])
    with pytest.raises(DataError, match="no trajectory has the 8 states"):
        windows_of([short], 2)


@pytest.mark.parametrize("damage", ["cut", "foreign", "missing"])
def test_files_that_are_no_checkpoints_are_refused(
    trajectories: Trajectories, tmp_path: Path, damage: str
) -> None:
    path = tmp_path / "c.pt"
    checkpoint.save(path, trainer_of(trajectories), {})
    if damage == "cut":
        path.write_bytes(path.read_bytes()[:1000])
    elif damage == "foreign":
        torch.save({"weights": torch.zeros(3)}, path)
    else:
        path.unlink()
    with pytest.raises(DataError, match=r"c\.pt"):
        Trainer.load(path, CPU)


def test_a_checkpoint_of_other_features_is_refused(trajectories: Trajectories, tmp_path: Path) -> None:
    path = tmp_path / "c.pt"
    checkpoint.save(path, trainer_of(trajectories), {})
    state = torch.load(path, weights_only=True)
    state["spec"] = json.dumps({**json.loads(state["spec"]), "features": 99})
    torch.save(state, path)
    with pytest.raises(ConfigError, match=r"c\.pt has features version 99; this library has 1"):
        Trainer.load(path, CPU)


@pytest.mark.parametrize(
    ("change", "text"),
    [
        ({"latent": 0}, r"latent must be in \[1, 1024\], got 0"),
        ({"r_p": 0.0}, r"r_p must be in \(0, 1\], got 0"),
        ({"radius": float("nan")}, r"radius must be in \(0, 1\] m"),
        ({"scenarios": ()}, "at least one scenario"),
        ({"scenarios": ("lava",)}, "lava"),
        ({"scenarios": ("water_2d", "water_3d")}, "one dimension.*2 in water_2d seed 0 and 3 in water_3d"),
    ],
)
def test_networks_that_cannot_be_are_refused(change: dict[str, Any], text: str) -> None:
    with pytest.raises(ConfigError, match=text):
        dataclasses.replace(SPEC, **change)


@pytest.mark.parametrize(
    ("change", "text"),
    [
        ({"steps": 0}, "steps must be in"),
        ({"noise": -1.0}, r"noise must be in \[0, 1\]"),
        ({"final_rate": 0.1}, "final_rate must be above 0 and at most learning_rate"),
    ],
)
def test_settings_out_of_range_are_refused(change: dict[str, Any], text: str) -> None:
    with pytest.raises(ConfigError, match=text):
        TrainingSettings(**{"steps": 10} | change)


def test_scales_must_be_positive() -> None:
    one = (1.0, 1.0)
    with pytest.raises(ConfigError, match="velocity_std must be above 0 on each axis"):
        Normalization(
            velocity_mean=one,
            velocity_std=(1.0, 0.0),
            acceleration_mean=one,
            acceleration_std=one,
            noise_std=0.0,
        )


def test_unrolling_grows_evenly_and_the_rate_decays_exponentially() -> None:
    settings = TrainingSettings(steps=90, unroll=3, learning_rate=1e-2, final_rate=1e-4)
    assert [settings.unroll_at(step) for step in (0, 29, 30, 60, 89)] == [1, 1, 2, 3, 3]
    assert [settings.rate_at(step) for step in (0, 45, 90)] == pytest.approx([1e-2, 1e-3, 1e-4])
