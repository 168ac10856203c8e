"""An untrained network for water_2d; `python -m tests.python.bench.conftest` makes its file.

An export takes seconds in each process that tests. So the file is committed; a library of other features
refuses it, and tells so.
"""

from pathlib import Path

import pytest

FILE = Path(__file__).with_name("tiny.onnx")


@pytest.fixture(scope="session")
def tiny_model() -> Path:
    """Return the file of a network for water_2d with r_p = 1/16 and r_t = 8."""
    return FILE


def write() -> None:
    """Export a network with r_p = 1/16 and r_t = 8."""
    import torch

    from hybridmpm.physics.model_info import ModelInfo
    from hybridmpm.physics.spec import NetworkSpec, Normalization
    from hybridmpm.training.export import to_onnx
    from hybridmpm.training.physics.network.simulator import LearnedSimulator

    torch.manual_seed(0)
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
    FILE.write_bytes(to_onnx(simulator, info))


if __name__ == "__main__":
    write()
