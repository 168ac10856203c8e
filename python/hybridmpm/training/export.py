"""Exporting a trained simulator as one ONNX file, with features and integrator; serving it needs no torch."""

import copy
import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import onnx
import torch
from torch import Tensor, nn

from hybridmpm.errors import DataError
from hybridmpm.physics.model import NeuralModel
from hybridmpm.physics.model_info import ModelInfo
from hybridmpm.physics.spec import HISTORY, NetworkSpec, Normalization
from hybridmpm.physics.track import warmup_frames
from hybridmpm.training import checkpoint
from hybridmpm.training.onnx_program import exported
from hybridmpm.training.physics.network.edges import SortedEdges
from hybridmpm.training.physics.network.simulator import LearnedSimulator
from hybridmpm.training.publish import Exported, parameters_of, training_record

INPUTS = ("history", "types", "acceleration", "walls", "senders", "receivers", "arrivals", "mask", "share")
OUTPUTS = ("positions",)


class _Served(nn.Module):
    """The simulator with its graph as separate inputs, which are named as in model files."""

    def __init__(self, simulator: LearnedSimulator) -> None:
        super().__init__()
        self.simulator = simulator

    def forward(  # noqa: PLR0917 - the exporter names inputs by their place
        self,
        history: Tensor,
        types: Tensor,
        acceleration: Tensor,
        walls: Tensor,
        senders: Tensor,
        receivers: Tensor,
        arrivals: Tensor,
        mask: Tensor,
        share: Tensor,
    ) -> Tensor:
        graph = SortedEdges(senders, receivers, arrivals, mask)
        answer = self.simulator.answer(history, types, walls, graph)
        weight = share.unsqueeze(-1)
        return self.simulator.moved(history, types, acceleration, walls, answer=answer, weight=weight)


def to_onnx(simulator: LearnedSimulator, info: ModelInfo) -> bytes:
    """Return a simulator as an ONNX model with its description.

    The model's inputs are those of `LearnedSimulator.forward`, with the edges as
    `hybridmpm.physics.model.edge_inputs` gives them, and the weight (N,) of the network's answer, which is
    named `share`. The output is that of `LearnedSimulator.moved`. N, E and K are free, E and K from 1 on. The
    model does not compute the weight: its many small operations would take onnxruntime a third of the time of
    a small network, so it is compiled.
    """
    return exported(
        _Served(copy.deepcopy(simulator)).eval().cpu(),
        _example(simulator.spec),
        inputs=INPUTS,
        outputs=OUTPUTS,
        dynamic_shapes=_free_sizes(),
        properties=info.to_properties(),
    )


def described(data: bytes, info: ModelInfo) -> bytes:
    """Return an exported model with another description."""
    model = onnx.load_from_string(data)
    model.ClearField("metadata_props")
    onnx.helper.set_model_props(model, info.to_properties())
    changed: bytes = model.SerializeToString()
    return changed


_KEPT = ("scenario", "method", "label", "ms_per_frame", "error_40", "error_100", "error_200", "as_good")
"""Keys of a row of `python -m hybridmpm_lab models` that are stored in a model."""


def export_checkpoint(
    path: Path, errors: Sequence[Mapping[str, Any]] = (), *, name: str | None = None
) -> Exported:
    """Return the network of a checkpoint as an ONNX model.

    Parameters
    ----------
    path : Path
        Checkpoint that `hybridmpm train` wrote.
    errors : sequence of mappings
        Rows of `python -m hybridmpm_lab models`. The model stores the rows of its own scenarios and warm-up
        that are of this network, of the bounds, or of MPM at its r_p.
    name : str, optional
        Name of this network in the rows; if absent, the rows of all networks count as its own.

    Raises
    ------
    DataError
        `checkpoint.read` refuses the file, or the weights do not fit its network.
    ConfigError
        The network has other features than those of this library; the message names both versions.
    """
    simulator = _simulator(checkpoint.read(path), path)
    info = ModelInfo(
        spec=simulator.spec,
        scales=simulator.scales,
        parameters=parameters_of(simulator),
        training=training_record(path),
        errors=_own_rows(errors, simulator.spec, name),
    )
    return exported_model(to_onnx(simulator, info), info)


def exported_model(data: bytes, info: ModelInfo) -> Exported:
    """Return an ONNX model with the card and the manifest entry that follow from its description."""
    spec = info.spec
    return Exported(
        data=data,
        training={**info.training, "solver_versions": ", ".join(map(str, info.solver_versions))},
        parameters=info.parameters,
        folder=NeuralModel.FOLDER,
        rows={
            "serves": ", ".join(spec.scenarios),
            "network": f"latent {spec.latent}, {spec.layers} layers, {spec.hidden_layers} hidden ReLU "
            f"layers; {info.parameters} parameters",
            "radius": f"{spec.radius:.4g} m, {spec.radius / spec.spacing:.2f} spacings",
            "particles": f"r_p = {spec.r_p:.4g}",
            "step": f"r_t = {spec.r_t} frames of {spec.frame_dt * 1e3:g} ms",
        },
        errors=_error_table(info.errors),
        entry={
            **{key: getattr(spec, key) for key in ("scenarios", "r_p", "r_t", "latent", "layers", "radius")},
            "parameters": info.parameters,
            "solver_versions": info.solver_versions,
        },
    )


def _error_table(rows: Sequence[Mapping[str, Any]]) -> str:
    if not rows:
        return "Not measured."
    columns = list(dict.fromkeys(key for row in rows for key in row))
    cells = [columns, ["---"] * len(columns)]
    for row in rows:
        values = (row.get(column, "") for column in columns)
        cells.append([f"{value:.4g}" if isinstance(value, float) else str(value) for value in values])
    return "\n".join(f"| {' | '.join(line)} |" for line in cells)


def _own_rows(rows: Sequence[Mapping[str, Any]], spec: NetworkSpec, name: str | None) -> list[dict[str, Any]]:
    kept, warm_up = [], warmup_frames(spec.r_t)
    for row in rows:
        method = row.get("method")
        other = method == "neural" and name is not None and row.get("label") != name
        level = method in {"mpm", "merged"} and abs(row.get("r_p", 0.0) - spec.r_p) > 1e-3
        later = row.get("warm_up", warm_up) != warm_up
        if row.get("scenario") in spec.scenarios and not other and not level and not later:
            # Files of models have the quickest MPM of equal error under the key "as_good".
            known = {**row, "as_good": row.get("equal_mpm")}
            kept.append({key: "" if known.get(key) is None else known[key] for key in _KEPT})
    return kept


def _simulator(state: Mapping[str, Any], path: Path) -> LearnedSimulator:
    spec = NetworkSpec.from_dict(json.loads(state["spec"]), where=str(path))
    simulator = LearnedSimulator(spec, Normalization(**json.loads(state["scales"])))
    try:
        simulator.network.load_state_dict(state["weights"])
    except RuntimeError as error:
        raise DataError(f"{path}: its weights are not those of its network: {error}") from None
    return simulator


def _example(spec: NetworkSpec) -> tuple[Tensor, ...]:
    """Return example inputs: three particles, two of which are neighbours."""
    count, dim = 3, spec.dim
    return (
        torch.rand(HISTORY, count, dim),
        torch.zeros(count, dtype=torch.int64),
        torch.zeros(count, dim),
        torch.tensor([[0.0] * dim, [1.0] * dim]),
        torch.tensor([1, 0], dtype=torch.int32),
        torch.tensor([0, 1], dtype=torch.int32),
        torch.tensor([[0, 1], [1, 1], [1, 1]], dtype=torch.int32),
        torch.tensor([[True, False], [True, False], [False, False]]),
        torch.ones(count),
    )


def _free_sizes() -> dict[str, dict[int, Any]]:
    free = torch.export.Dim.DYNAMIC
    return {
        "history": {1: free},
        "types": {0: free},
        "acceleration": {0: free},
        "walls": {},
        "senders": {0: free},
        "receivers": {0: free},
        "arrivals": {0: free, 1: free},
        "mask": {0: free, 1: free},
        "share": {0: free},
    }
