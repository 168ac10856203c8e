"""Networks that need no training, for the tests of whatever serves networks."""

from pathlib import Path

import pytest

FALLING = "falling"
"""A network whose every number is zero: what it moves falls freely, so it is right until something hits."""
BROKEN = "broken"
"""A network that answers NaN."""


@pytest.fixture(scope="session")
def model_folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder of models for water_2d, with r_p = 1/4 and r_t = 4: `FALLING` and `BROKEN`."""
    torch = pytest.importorskip("torch", reason="networks are exported with torch")
    from hybridmpm.physics.model_info import ModelInfo
    from hybridmpm.physics.spec import NetworkSpec, Normalization
    from hybridmpm.training.export import to_onnx
    from hybridmpm.training.publish import publish
    from hybridmpm.training.simulator import LearnedSimulator

    spec = NetworkSpec(
        scenarios=("water_2d",), latent=4, layers=1, hidden_layers=1, radius=0.03, r_p=1 / 4, r_t=4
    )
    scales = Normalization(
        velocity_mean=(0.0, 0.0),
        velocity_std=(0.02, 0.02),
        acceleration_mean=(0.0, 0.0),
        acceleration_std=(1e-4, 1e-4),
        noise_std=0.0,
    )
    folder = tmp_path_factory.mktemp("models")
    (folder / "manifest.json").write_text("{}", encoding="utf-8")
    for name, number in ((FALLING, 0.0), (BROKEN, float("nan"))):
        simulator = LearnedSimulator(spec, scales)
        with torch.no_grad():
            for parameter in simulator.parameters():
                parameter.fill_(number)
        info = ModelInfo(spec=spec, scales=scales, parameters=1, training={})
        publish(name, to_onnx(simulator, info), info, folder)
    return folder
