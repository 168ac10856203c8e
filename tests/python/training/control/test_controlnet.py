"""The Fluid ControlNet: what its answer depends on, its training, and its form in onnxruntime as a method."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import onnx
import pytest
import torch
from click.testing import CliRunner
from torch import Tensor, nn

from hybridmpm import MpmSolver, Scene, radius_graph, scenarios
from hybridmpm._support.networks import to_properties
from hybridmpm.cli import cli
from hybridmpm.control import Arrow, ControlNet, Ellipse, Sketch, follow, prepare
from hybridmpm.control.diffusion.law import Diffused
from hybridmpm.control.diffusion.network import FORMAT, SIDE, ControlNetwork, picture_of
from hybridmpm.control.diffusion.nodes import Nodes
from hybridmpm.control.goal.moments import moments
from hybridmpm.control.guidance import Guidance
from hybridmpm.errors import ConfigError
from hybridmpm.physics.model import edge_inputs
from hybridmpm.physics.spec import NetworkSpec
from hybridmpm.training import checkpoint
from hybridmpm.training.control.controlnet import cases, export, windows
from hybridmpm.training.control.controlnet.cases import FRAMES, NodeCase
from hybridmpm.training.control.controlnet.network import TIME_EMBEDDING, fluid_moments, ink_moments, waves
from hybridmpm.training.control.controlnet.sketch_encoder import EMBEDDING, SketchEncoder
from hybridmpm.training.control.controlnet.trainer import Conditioned, ControlNetTrainer
from hybridmpm.training.control.controlnet.ways import WAY, field_of
from hybridmpm.training.control.controlnet.windows import scale_of
from hybridmpm.training.control.pasts import Past
from hybridmpm.training.physics.network.edges import SortedEdges
from hybridmpm.training.settings import ControlNetSettings
from hybridmpm.training.sources import Drawn

COUNT = 40
SETTINGS = ("water_2d", "sand_3d")
OVAL = Ellipse(np.array([0.55, 0.5]), np.array([0.2, 0.1]), 0.3)
ARROW = Arrow(np.array([[0.2, 0.2], [0.6, 0.6]]))


def spec_of(scenario: str) -> NetworkSpec:
    radius = 0.15 if scenario.endswith("2d") else 0.3
    return NetworkSpec(scenarios=(scenario,), latent=16, layers=2, hidden_layers=1, radius=radius)


def network_of(scenario: str) -> Conditioned:
    """Return a network with random weights, those of the condition among them."""
    torch.manual_seed(3)
    conditioned = Conditioned(spec_of(scenario))
    for modulation in conditioned.network.modulations:
        nn.init.normal_(modulation[-1].weight, std=0.3)
    return conditioned.eval()


def inputs_of(scenario: str, count: int = COUNT, seed: int = 0) -> dict[str, Tensor]:
    """Return the inputs of one graph, with a disc of ink on the left of its picture."""
    rng, spec = np.random.default_rng(seed), spec_of(scenario)
    x = rng.uniform(0.15, 0.85, (count, spec.dim)).astype(np.float32)
    graph = edge_inputs(radius_graph(x, spec.radius))
    picture = torch.zeros(1, 3, SIDE, SIDE)
    picture[0, 1, 20:40, 5:25] = 1
    return {
        "x": torch.from_numpy(x),
        "v": torch.from_numpy(rng.normal(size=x.shape).astype(np.float32)),
        "types": torch.full((count,), 5),
        **{name: torch.from_numpy(array) for name, array in graph.items()},
        "noisy": torch.from_numpy(rng.normal(size=x.shape).astype(np.float32)),
        "step": torch.full((count, 1), 0.25),
        "picture": picture,
        "time": torch.tensor([500]),
    }


def answer(conditioned: Conditioned, inputs: dict[str, Tensor]) -> Tensor:
    graph = SortedEdges(*(inputs[name] for name in ("senders", "receivers", "arrivals", "mask")))
    walls = torch.tensor(conditioned.spec.bounds).T
    with torch.no_grad():
        condition = conditioned.network.condition(inputs["picture"], inputs["time"])
        told = {name: inputs[name] for name in ("noisy", "step")}
        found: Tensor = conditioned(
            inputs["x"], inputs["v"], inputs["types"], walls, graph, condition=condition, **told
        )
    return found


def test_the_encoder_has_the_layers_of_the_paper() -> None:
    encoder = SketchEncoder()
    convolutions = [part for part in encoder.modules() if isinstance(part, nn.Conv2d)]
    assert len(convolutions) == 8
    assert encoder(torch.zeros(2, 3, 96, 96)).shape == (2, EMBEDDING) == (2, 44)


@pytest.mark.parametrize("scenario", SETTINGS)
@pytest.mark.parametrize("key", ["x", "v", "noisy", "step", "picture", "time", "types"])
def test_the_answer_depends_on_every_input(scenario: str, key: str) -> None:
    network, inputs = network_of(scenario), inputs_of(scenario)
    changed = {
        "x": inputs["x"] + 0.05,
        "v": -inputs["v"],
        "noisy": inputs["noisy"] + 0.5,
        "step": inputs["step"] + 0.5,
        "picture": inputs["picture"].flip(-1),
        "time": inputs["time"] // 2,
        "types": inputs["types"] + 1,
    }
    before = answer(network, inputs)
    assert before.shape == inputs["noisy"].shape
    assert (answer(network, inputs | {key: changed[key]}) - before).abs().max() > 1e-4


def test_the_moments_of_the_ink_are_those_of_the_sketch() -> None:
    pictures = torch.from_numpy(np.stack([picture_of(OVAL), picture_of(ARROW)]).astype(np.float32))
    found = ink_moments(pictures / 255).numpy()
    np.testing.assert_allclose(found[0, :2], 2 * OVAL.center - 1, atol=0.01)
    # Points of an ellipse are about its semi-axes over the root of two away, in the root mean square.
    turn = np.array([[np.cos(OVAL.angle), -np.sin(OVAL.angle)], [np.sin(OVAL.angle), np.cos(OVAL.angle)]])
    covariance = turn @ np.diag((2 * OVAL.axes) ** 2 / 2) @ turn.T
    np.testing.assert_allclose(found[0, 2:4] ** 2, np.diag(covariance), rtol=0.2)
    correlation = covariance[0, 1] / np.sqrt(covariance[0, 0] * covariance[1, 1])
    assert found[0, 4] == pytest.approx(correlation, abs=0.1)
    assert found[1, 4] == pytest.approx(1.0, abs=0.1)
    assert found[1, 5] < 0.1 < found[0, 5]


def test_times_of_the_diffusion_differ() -> None:
    found = waves(torch.arange(1, 1001))
    assert found.shape == (1000, TIME_EMBEDDING)
    assert torch.cdist(found, found).fill_diagonal_(1.0).min() > 0.1


def _case(seed: int) -> NodeCase:
    """Return a case of a fluid at rest that goes to where the ink is, left or right."""
    rng = np.random.default_rng(seed)
    right = seed % 2
    x = rng.uniform(0.4, 0.6, (30, 2)).astype(np.float32)
    picture = np.zeros((3, SIDE, SIDE), dtype=np.uint8)
    picture[1, 20:40, 10 + 32 * right : 20 + 32 * right] = 255
    return NodeCase(
        x=x,
        v=np.zeros_like(x),
        end=x + np.float32(0.25) * np.array([2 * right - 1, 0], dtype=np.float32),
        types=np.full(30, 5),
        picture=picture,
        oval=np.ones((), dtype=bool),
        scene=scenarios.get("water_2d", 0),
    )


def _trainer(steps: int) -> ControlNetTrainer:
    made = [_case(seed) for seed in range(4)]
    return ControlNetTrainer(
        spec_of("water_2d"), ControlNetSettings(steps=steps, batch=4, learning_rate=1.2e-2), scale_of(made)
    )


@pytest.mark.long
def test_it_learns_that_the_sketch_tells_where_to() -> None:
    trainer, made = _trainer(120), [_case(seed) for seed in range(4)]
    others = made[1:] + made[:1]
    swapped = [replace(one, picture=other.picture) for one, other in zip(made, others, strict=True)]
    before = trainer.unexplained(made)
    for _ in range(120):
        trainer.step(made)
    assert before > 0.9
    assert trainer.unexplained(made) < min(0.8 * before, 0.9 * trainer.unexplained(swapped))


def test_a_training_that_was_interrupted_ends_with_the_same_weights(tmp_path: Path) -> None:
    made = [_case(seed) for seed in range(4)]
    through, first = _trainer(6), _trainer(6)
    for _ in range(6):
        through.step(made)
    for _ in range(3):
        first.step(made)
    checkpoint.save(tmp_path / "checkpoint.pt", first, {})
    second = ControlNetTrainer.load(tmp_path / "checkpoint.pt")
    for _ in range(3):
        second.step(made)
    pairs = zip(through.average.parameters(), second.average.parameters(), strict=True)
    assert all(torch.equal(one, other) for one, other in pairs)


def test_from_wherever_it_is_the_force_leads_to_the_true_end_at_rest() -> None:
    """A free body under the force, which changes linearly in time, comes to the end, and to rest there."""
    case = _case(1)
    on_its_way = windows._frame(case, 40)
    pushed = windows._forced(
        windows._pushed(np.random.default_rng(3), on_its_way, case.seconds), case.end, case
    )
    left = 60 * case.scene.frame_dt
    for sample in (on_its_way, pushed):
        start = sample.force + np.array(case.scene.gravity)
        way = case.end - sample.x
        last = -6 * way / left**2 + 2 * sample.v / left
        np.testing.assert_allclose(sample.v * left + left**2 * (start / 3 + last / 6), way, atol=1e-4)
        np.testing.assert_allclose(sample.v + left * (start + last) / 2, 0, atol=1e-3)
    assert np.abs(pushed.x - on_its_way.x).max() > 1e-3


def test_states_on_the_way_begin_where_control_does_and_stay_between_the_walls() -> None:
    case = replace(_case(0), v=np.full((30, 2), -6.0, dtype=np.float32))
    start = windows._frame(case, 0)
    assert np.array_equal(start.x, case.x)
    assert np.array_equal(start.v, case.v)
    lower, upper = start.walls
    for step in range(0, FRAMES, 10):
        sample = windows._frame(case, step)
        assert (sample.x >= lower).all()
        assert (sample.x <= upper).all()
        assert np.linalg.norm(sample.force, axis=1).max() <= 15 * 9.81 * (1 + 1e-5)
    # It would have gone through the floor; there it has no velocity.
    at_floor = windows._frame(case, 20)
    assert (at_floor.v[at_floor.x == lower] == 0).all()


@pytest.fixture(scope="module")
def file_2d(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a network of 2D water with random weights as a file."""
    conditioned = network_of("water_2d")
    properties = to_properties(
        FORMAT, spec=conditioned.spec.to_dict(), scale=30.0, frames=FRAMES, training={"command": "none"}
    )
    path = tmp_path_factory.mktemp("controlnet") / "random.onnx"
    path.write_bytes(export.to_onnx(conditioned, 30.0, properties))
    return path


def test_onnxruntime_answers_as_torch(file_2d: Path) -> None:
    model = onnx.load_from_string(file_2d.read_bytes())
    assert "Scatter" not in {node.op_type for node in model.graph.node}
    served, conditioned = ControlNetwork.load(file_2d), network_of("water_2d")
    for count, seed in ((COUNT, 0), (17, 1)):
        inputs = inputs_of("water_2d", count, seed) | {"time": torch.tensor([1000])}
        found = served.field(
            inputs["x"].numpy(),
            inputs["v"].numpy(),
            inputs["types"].numpy(),
            step=0.25,
            picture=(255 * inputs["picture"][0]).to(torch.uint8).numpy(),
            noise=inputs["noisy"].numpy(),
            steps=1,
            solver="ddim",
        )
        way, gravity = WAY * answer(conditioned, inputs), torch.tensor([0.0, -9.81])
        field = field_of(way, inputs["v"], inputs["step"], torch.tensor(0.25), gravity)
        np.testing.assert_allclose(found, field.numpy(), rtol=1e-3, atol=1e-2)


def test_it_follows_a_sketch_from_seeds_under_the_cap_and_goes_on_from_a_snapshot(file_2d: Path) -> None:
    solver = MpmSolver(scenarios.water_2d(seed=3), r_p=0.25)
    solver.advance(30)
    start = solver.snapshot()
    runs = []
    for seed in (1, 1, 2):
        solver.restore(start)
        following = follow(solver, OVAL, ControlNet(str(file_2d), steps=2), frames=100, cap=3.0, seed=seed)
        assert following.guidance.method == "controlnet-2"
        for _ in range(3):
            next(following)
        runs.append(solver.positions)
    assert np.array_equal(runs[0], runs[1])
    assert not np.array_equal(runs[0], runs[2])
    guidance = following.guidance
    again = Guidance.restored(guidance.snapshot(), solver.scene)
    force, other = guidance.law.force(solver, 3), again.law.force(solver, 3)
    assert isinstance(force, np.ndarray)
    assert np.array_equal(force, other)
    assert np.linalg.norm(force, axis=1).max() <= 3.0 * 9.81 * (1 + 1e-6)


@pytest.mark.parametrize("name", ["water_2d", "sand_3d"])
def test_the_networks_of_the_library_serve_both_dimensions(name: str) -> None:
    solver = MpmSolver(getattr(scenarios, name)(seed=3), r_p=0.25)
    solver.advance(30)
    guidance = prepare(solver, OVAL, method="controlnet", frames=100, cap=15.0)
    assert guidance.method == "controlnet", guidance.reason
    assert isinstance(guidance.law, Diffused)
    assert guidance.law.network == f"controlnet_{name[-2:]}"


@pytest.mark.parametrize("sketch", [OVAL, ARROW])
def test_the_ends_that_the_force_leads_to_are_those_of_the_sketch(
    file_2d: Path, sketch: Sketch, monkeypatch: pytest.MonkeyPatch
) -> None:
    solver = MpmSolver(scenarios.water_2d(seed=3), r_p=0.25)
    guidance = prepare(solver, sketch, method=ControlNet(str(file_2d)), frames=100)
    fields = []
    monkeypatch.setattr(Nodes, "spread", lambda _nodes, field: fields.append(field) or field)
    law = guidance.law
    assert isinstance(law, Diffused)
    for index in (0, 50, 95):
        law.force(solver, index)
        nodes = Nodes.from_dict(law.nodes)
        x, v = nodes.gathered(solver.positions), nodes.gathered(solver.velocities)
        left = solver.scene.frame_dt * max(100 - index, 15)
        ends = x + (fields[-1] + 4 * v / left + np.array(solver.scene.gravity)) * left**2 / 6
        mass = np.bincount(nodes.group, solver.mass)
        mean, covariance = moments(ends, mass / mass.sum())
        wanted, root = guidance.goal.end()
        np.testing.assert_allclose(mean, wanted, atol=1e-4)
        if root is not None:
            np.testing.assert_allclose(covariance, root @ root, atol=1e-5)


@pytest.mark.parametrize(
    ("scene", "frames", "reason"),
    [
        (scenarios.sand_2d(seed=1), 100, "trained without sand"),
        (scenarios.water_ramps_2d(seed=1), 100, "trained without obstacles"),
        (scenarios.water_2d(seed=1), 60, "trained for 100 frames, not for 60"),
    ],
)
def test_analytic_control_takes_over_where_the_network_was_not_trained(
    file_2d: Path, scene: Scene, frames: int, reason: str
) -> None:
    guidance = prepare(MpmSolver(scene, r_p=0.25), OVAL, method=ControlNet(str(file_2d)), frames=frames)
    assert guidance.method == "analytic"
    assert reason in guidance.reason


def test_a_network_that_is_absent_or_foreign_hands_over(tmp_path: Path) -> None:
    solver = MpmSolver(scenarios.water_2d(seed=3), r_p=0.25)
    guidance = prepare(solver, OVAL, method=ControlNet(str(tmp_path / "none.onnx")), frames=100)
    assert "there is no network: cannot read" in guidance.reason
    with pytest.raises(ConfigError, match="there is no model 'nobody'"):
        ControlNetwork.load("nobody")
    with pytest.raises(ConfigError, match="steps must be in"):
        ControlNet(steps=0)
    with pytest.raises(ConfigError, match="solver must be ddim or dpm"):
        ControlNet(solver="euler")  # type: ignore[arg-type]


def test_a_network_that_fails_hands_over(file_2d: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(*_arguments: object, **_options: object) -> None:
        raise RuntimeError("no memory")

    monkeypatch.setattr(ControlNetwork, "field", fail)
    solver = MpmSolver(scenarios.water_2d(seed=3), r_p=0.25)
    guidance = prepare(solver, OVAL, method=ControlNet(str(file_2d)), frames=100)
    assert "the network failed: no memory" in guidance.reason


def test_the_command_trains_and_the_export_is_published(
    tmp_path: Path, file_2d: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    out, data = tmp_path / "run", tmp_path / "nodes"
    options = ["--scenes", "1", "--valid", "1", "--latent", "8", "--layers", "1", "--batch", "1"]
    command = ["train", "controlnet", "--scenario", "water_2d", "--out", str(out), "--data", str(data)]
    done = CliRunner().invoke(cli, [*command, *options, "--steps", "2"], prog_name="hybridmpm")
    assert done.exit_code == 0, done.output
    assert (out / "validation.jsonl").exists()
    # Writing the file takes many seconds; `file_2d` stands for it.
    monkeypatch.setattr(export, "to_onnx", lambda *_: file_2d.read_bytes())
    made = export.export_controlnet(out / "checkpoint.pt")
    written = made.publish("mine", tmp_path / "weights")
    assert [path.name for path in written] == ["mine.onnx", "mine.md", "manifest.json"]
    assert "reversed cases of 1 scenes of each of water_2d" in written[1].read_text(encoding="utf-8")
    assert written[0].read_bytes() == file_2d.read_bytes()


def test_cases_lead_back_to_where_the_fluid_was(tmp_path: Path) -> None:
    cases.prepare(tmp_path, Drawn(scenario="water_2d"), range(1))
    found = cases.read(tmp_path, Drawn(scenario="water_2d"), range(1), "train")
    assert 1 <= len(found) <= 4
    past = Past.simulated(scenarios.get("water_2d", 0))
    gone = [past.positions(state).mean(axis=0) for state in range(11)]
    for case in found:
        assert case.x.shape == case.v.shape == case.end.shape == (128, 2)
        assert case.seconds == pytest.approx(0.25)
        # Nodes are of nearly equal mass, so that their mean is that of the fluid.
        assert min(np.linalg.norm(case.end.mean(axis=0) - mean) for mean in gone) < 1e-3
        assert np.linalg.norm(case.end.mean(axis=0) - case.x.mean(axis=0)) > 0.03


def test_the_moments_of_the_fluid_are_those_of_each_graph() -> None:
    rng = np.random.default_rng(0)
    x, v = (torch.from_numpy(rng.normal(size=(7, 3))) for _ in range(2))
    graphs = torch.tensor([0, 0, 0, 0, 1, 1, 1])
    found = fluid_moments(x, v, graphs)
    for rows in (slice(0, 4), slice(4, 7)):
        middle, spread, velocity = fluid_moments(x[rows], v[rows]).split(3, dim=1)
        torch.testing.assert_close(found[rows], torch.cat([middle, spread, velocity], dim=1))
        torch.testing.assert_close(middle + x[rows], x[rows].mean(dim=0).expand(len(middle), -1))
        torch.testing.assert_close(spread[0], x[rows].std(dim=0, correction=0))
        torch.testing.assert_close(velocity[0], v[rows].mean(dim=0))
