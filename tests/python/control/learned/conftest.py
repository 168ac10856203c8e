"""Transport networks written by hand: they answer with where the particles are, in the aim's coordinates."""

from collections.abc import Callable
from pathlib import Path

import onnx
import pytest

from hybridmpm._support.networks import OPSET, to_properties
from hybridmpm.control.methods.learned.features import PLANES, channels, numbers, of_particle
from hybridmpm.control.methods.learned.network import FORMAT
from hybridmpm.control.methods.learned.spec import CELLS, TransportSpec

NetworkFile = Callable[..., Path]


@pytest.fixture
def network_file(tmp_path: Path) -> NetworkFile:
    """Return a writer of networks that answer `factor` times the particles' own coordinates."""

    def write(factor: float = 1.0, noise: float = 0.0, scenario: str = "water_2d") -> Path:
        spec = TransportSpec(scenarios=(scenario,))
        dim = spec.dim
        grid = f"{len(PLANES[dim]) * channels(dim, obstacles=spec.obstacles)}, {CELLS}, {CELLS}"
        # The first numbers of a particle are half of its place in the aim's own coordinates.
        text = f"""
            <ir_version: 10, opset_import: ["" : {OPSET}]>
            stay (float[1, {grid}] grid, float[1, {numbers(dim)}] numbers,
                  float[1, n, {of_particle(dim)}] particles, float[1, n, {dim}] places,
                  float[1, n, {dim}] noisy, float[1] time)
                => (float[1, n, {dim}] end)
            <int64[1] first = {{0}}, int64[1] last = {{{dim}}}, int64[1] axis = {{2}},
             float factor = {{{2 * factor}}}, float noise = {{{noise}}}>
            {{
                half = Slice(particles, first, last, axis)
                own = Mul(half, factor)
                apart = Mul(noisy, noise)
                end = Add(own, apart)
            }}
        """
        model = onnx.parser.parse_model(text)
        properties = to_properties(FORMAT, spec=spec.to_dict(), training={"command": "by hand"})
        onnx.helper.set_model_props(model, properties)
        onnx.checker.check_model(model)
        path = tmp_path / f"stay_{scenario}_{factor}_{noise}.onnx"
        path.write_bytes(model.SerializeToString())
        return path

    return write
