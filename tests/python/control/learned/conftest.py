"""Transport networks written by hand: they answer with where the particles are, in the aim's coordinates."""

from collections.abc import Callable
from pathlib import Path

import onnx
import pytest

from hybridmpm._support.onnx_file import OPSET
from hybridmpm.control.methods.learned.features import CHANNELS, NUMBERS, OF_PARTICLE
from hybridmpm.control.methods.learned.network import properties_of
from hybridmpm.control.methods.learned.spec import CELLS, TransportSpec

NetworkFile = Callable[..., Path]


@pytest.fixture
def network_file(tmp_path: Path) -> NetworkFile:
    """Return what writes a network for water_2d; it answers `factor` times the particles' own coordinates."""

    def write(factor: float = 1.0, noise: float = 0.0) -> Path:
        # The first two numbers of a particle are half of its place in the aim's own coordinates.
        text = f"""
            <ir_version: 10, opset_import: ["" : {OPSET}]>
            stay (float[1, {CHANNELS}, {CELLS}, {CELLS}] grid, float[1, {NUMBERS}] numbers,
                  float[1, n, {OF_PARTICLE}] particles, float[1, n, 2] places, float[1, n, 2] noisy,
                  float[1] time)
                => (float[1, n, 2] end)
            <int64[1] first = {{0}}, int64[1] last = {{2}}, int64[1] axis = {{2}},
             float factor = {{{2 * factor}}}, float noise = {{{noise}}}>
            {{
                half = Slice(particles, first, last, axis)
                own = Mul(half, factor)
                apart = Mul(noisy, noise)
                end = Add(own, apart)
            }}
        """
        model = onnx.parser.parse_model(text)
        properties = properties_of(TransportSpec(scenarios=("water_2d",)), {"command": "by hand"})
        onnx.helper.set_model_props(model, properties)
        onnx.checker.check_model(model)
        path = tmp_path / f"stay_{factor}_{noise}.onnx"
        path.write_bytes(model.SerializeToString())
        return path

    return write
