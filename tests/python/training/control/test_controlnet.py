"""The Fluid ControlNet: shapes, what its answer depends on, and its form in onnxruntime."""

import io
import logging
import warnings

import numpy as np
import onnxruntime
import pytest
import torch
from torch import Tensor, nn

from hybridmpm import radius_graph
from hybridmpm._support.onnx_file import OPSET
from hybridmpm.physics.model import edge_inputs
from hybridmpm.physics.spec import NetworkSpec
from hybridmpm.training.control.controlnet import STEP_EMBEDDING, TIME_EMBEDDING, FluidControlNet, waves
from hybridmpm.training.control.sketch_encoder import EMBEDDING, SketchEncoder
from hybridmpm.training.physics.features import edge_features, node_features
from hybridmpm.training.physics.graph_network import SortedEdges

SIDE = 64
COUNT = 40
SETTINGS = ("water_2d", "sand_3d")


def spec_of(scenario: str) -> NetworkSpec:
    radius = 0.15 if scenario.endswith("2d") else 0.3
    return NetworkSpec(scenarios=(scenario,), latent=16, layers=2, hidden_layers=1, radius=radius)


def network_of(scenario: str) -> FluidControlNet:
    """Return a network with random weights, those of the condition among them."""
    torch.manual_seed(3)
    network = FluidControlNet(spec_of(scenario))
    for modulation in network.modulations:
        nn.init.normal_(modulation[-1].weight, std=0.3)
    return network.eval()


def inputs_of(scenario: str, count: int = COUNT, seed: int = 0) -> dict[str, Tensor]:
    """Return the inputs of one graph, with a disc of ink on the left of its picture."""
    rng, spec = np.random.default_rng(seed), spec_of(scenario)
    x = rng.uniform(0.1, 0.9, (count, spec.dim)).astype(np.float32)
    steps = rng.normal(0, 1e-3, (6, count, spec.dim)).astype(np.float32)
    graph = edge_inputs(radius_graph(x, spec.radius))
    picture = torch.zeros(1, 3, SIDE, SIDE)
    picture[0, 1, 20:40, 5:25] = 1
    return {
        "history": torch.from_numpy(x + np.cumsum(steps, axis=0)),
        "types": torch.full((count,), 5),
        **{name: torch.from_numpy(array) for name, array in graph.items()},
        "noisy": torch.from_numpy(rng.normal(size=(count, spec.dim)).astype(np.float32)),
        "step": torch.full((count, 1), 0.25),
        "picture": picture,
        "time": torch.tensor([500]),
    }


class Whole(nn.Module):
    """Network, features and condition, as they would be served."""

    def __init__(self, network: FluidControlNet) -> None:
        super().__init__()
        self.network = network

    def forward(  # noqa: PLR0917 - the exporter names inputs by their place
        self,
        history: Tensor,
        types: Tensor,
        senders: Tensor,
        receivers: Tensor,
        arrivals: Tensor,
        mask: Tensor,
        noisy: Tensor,
        step: Tensor,
        picture: Tensor,
        time: Tensor,
    ) -> Tensor:
        spec = self.network.spec
        graph = SortedEdges(senders, receivers, arrivals, mask)
        walls = torch.tensor([[0.1] * spec.dim, [0.9] * spec.dim])
        unit = torch.full((spec.dim,), 1e-3)
        nodes = node_features(history, walls, spec.radius, torch.zeros(spec.dim), unit)
        edges = edge_features(history[-1], graph, spec.radius)
        condition = self.network.condition(picture, time)
        return self.network(nodes, types, edges, graph, noisy=noisy, step=step, condition=condition)


def answer(network: FluidControlNet, inputs: dict[str, Tensor]) -> Tensor:
    with torch.no_grad():
        found: Tensor = Whole(network)(**inputs)
    return found


def test_the_encoder_has_the_layers_of_the_paper() -> None:
    encoder = SketchEncoder()
    convolutions = [part for part in encoder.modules() if isinstance(part, nn.Conv2d)]
    assert len(convolutions) == 8
    assert encoder(torch.zeros(2, 3, 96, 96)).shape == (2, EMBEDDING) == (2, 44)


def test_the_encoder_tells_where_the_ink_is() -> None:
    torch.manual_seed(0)
    encoder, left = SketchEncoder(), inputs_of("water_2d")["picture"]
    one, other = encoder(left), encoder(left.flip(-1))
    assert (one - other).norm() > 0.05 * (one - encoder(torch.zeros_like(left))).norm()


def test_the_control_step_takes_sixteen_features() -> None:
    network = network_of("water_2d")
    assert STEP_EMBEDDING == 16
    assert network.encoder.node.in_features == 30 + 16 + 2


@pytest.mark.parametrize("scenario", SETTINGS)
@pytest.mark.parametrize("key", ["noisy", "step", "picture", "time", "types", "history"])
def test_the_answer_depends_on_every_input(scenario: str, key: str) -> None:
    network, inputs = network_of(scenario), inputs_of(scenario)
    changed = {
        "noisy": inputs["noisy"] + 0.5,
        "step": inputs["step"] + 0.5,
        "picture": inputs["picture"].flip(-1),
        "time": inputs["time"] // 2,
        "types": inputs["types"] + 1,
        "history": inputs["history"].flip(0),
    }
    before = answer(network, inputs)
    assert before.shape == inputs["noisy"].shape
    assert (answer(network, inputs | {key: changed[key]}) - before).abs().max() > 1e-4


def test_a_new_network_does_not_see_the_sketch() -> None:
    """Training begins from the backbone; the condition grows in from zero."""
    network, inputs = FluidControlNet(spec_of("water_2d")), inputs_of("water_2d")
    blank = inputs | {"picture": torch.zeros_like(inputs["picture"])}
    assert torch.equal(answer(network, inputs), answer(network, blank))


def test_the_control_step_is_in_the_noise() -> None:
    network = network_of("water_2d")
    noise = torch.zeros(2, 2)
    early, late = (network.start(noise, torch.full((2, 1), step)) for step in (0.0, 1.0))
    assert torch.equal(early[0], early[1])
    assert (early - late).abs().max() > 1e-3


def test_times_of_the_diffusion_differ() -> None:
    found = waves(torch.arange(1, 1001))
    assert found.shape == (1000, TIME_EMBEDDING)
    assert torch.cdist(found, found).fill_diagonal_(1.0).min() > 0.1


@pytest.mark.parametrize("scenario", SETTINGS)
def test_onnxruntime_answers_as_torch(scenario: str) -> None:
    network, example = network_of(scenario), inputs_of(scenario)
    free = torch.export.Dim.DYNAMIC
    sizes = {"history": {1: free}, "arrivals": {0: free, 1: free}, "mask": {0: free, 1: free}}
    sizes |= {key: {0: free} for key in ("types", "senders", "receivers", "noisy", "step")}
    logging.getLogger("torch.onnx").setLevel(logging.ERROR)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        program = torch.onnx.export(
            Whole(network),
            tuple(example.values()),
            dynamo=True,
            optimize=False,
            opset_version=OPSET,
            input_names=list(example),
            dynamic_shapes=sizes | {"picture": {}, "time": {}},
            verbose=False,
        )
    assert program is not None
    data = io.BytesIO()
    program.save(data)
    assert "Scatter" not in {node.op_type for node in program.model_proto.graph.node}
    session = onnxruntime.InferenceSession(data.getvalue())
    for count, seed in ((COUNT, 0), (17, 1)):
        inputs = inputs_of(scenario, count, seed)
        (served,) = session.run(None, {key: value.numpy() for key, value in inputs.items()})
        np.testing.assert_allclose(served, answer(network, inputs).numpy(), rtol=1e-4, atol=1e-5)
