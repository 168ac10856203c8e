"""A network without training, small enough to be exported in a moment."""

from pathlib import Path

import pytest

from hybridmpm.physics.model_info import ModelInfo
from hybridmpm.physics.spec import NetworkSpec, Normalization


@pytest.fixture(scope="session")
def tiny_model(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the file of a network for water_2d with r_p = 1/16 and r_t = 8."""
    from hybridmpm.training.export import to_onnx
    from hybridmpm.training.physics.simulator import LearnedSimulator

    spec = NetworkSpec(
        scenarios=("water_2d",),
        latent=8,
        layers=1,
        hidden_layers=1,
        radius=0.03,
        r_p=1 / 16,
        r_t=8,
        relaxations=1,
    )
    scales = Normalization(
        velocity_mean=(0.0, 0.0),
        velocity_std=(0.02, 0.02),
        acceleration_mean=(0.0, 0.0),
        acceleration_std=(1e-4, 1e-4),
        noise_std=0.0,
    )
    simulator = LearnedSimulator(spec, scales)
    parameters = sum(parameter.numel() for parameter in simulator.parameters())
    info = ModelInfo(spec=spec, scales=scales, parameters=parameters, training={})
    file = tmp_path_factory.mktemp("models") / "tiny.onnx"
    file.write_bytes(to_onnx(simulator, info))
    return file
