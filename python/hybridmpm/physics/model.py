"""`NeuralModel`: a trained network under onnxruntime."""

from typing import Any

import numpy as np
import numpy.typing as npt

from hybridmpm._core import RadiusGraph, radius_graph
from hybridmpm._support.networks import NetworkFolder, ServedNetwork
from hybridmpm.errors import ConfigError, GraphSizeError
from hybridmpm.physics.answer_gate import answer_weights
from hybridmpm.physics.free_fall import free_fall
from hybridmpm.physics.manifest import WEIGHTS
from hybridmpm.physics.model_info import FORMAT, ModelInfo
from hybridmpm.physics.spec import NetworkSpec
from hybridmpm.scene import Scene
from hybridmpm.scene.particle_types import KINEMATIC

_MOST_NEIGHBORS = 256
"""Neighbours that a particle may have: ten times those in water at rest. A larger clump would fill the
memory."""
_NEAR = 1e-3
"""Relative difference of lengths and times that count as the same."""


class NeuralModel(ServedNetwork):
    """A trained network, its features and its integrator, under onnxruntime; a `Stepper`."""

    FORMAT = FORMAT
    FOLDER = NetworkFolder(WEIGHTS)

    def _described(self, plain: dict[str, Any]) -> None:
        self._info = ModelInfo.from_metadata(plain, where=self._where)

    @property
    def info(self) -> ModelInfo:
        """The model's network, scales and origin."""
        return self._info

    @property
    def spec(self) -> NetworkSpec:
        """The member of the family of networks that the model is."""
        return self._info.spec

    @property
    def r_p(self) -> float:
        """Ratio of the particles to those of the scene, in (0, 1]."""
        return self.spec.r_p

    @property
    def r_t(self) -> int:
        """Frames that one step spans."""
        return self.spec.r_t

    def check(self, scene: Scene) -> None:
        """Refuse a scene of another kind than the model was trained on.

        Raises
        ------
        ConfigError
            Dimension, frame_dt, particle spacing, a material or one of its constants, or obstacles where
            there were none: the message names both values. Or particles come and go, obstacles move, or
            `transfer_loss` is given.
        """
        trained = self.spec.trained_on
        if scene.world is not None:
            size = " x ".join(f"{length:g}" for length in scene.size)
            raise ConfigError(
                f"{self._for()}, in a world of one metre along each axis; that of the scene has {size} m"
            )
        pairs = {
            "dim": (scene.dim, trained.dim),
            "frame_dt": (scene.frame_dt, trained.frame_dt),
            "particle spacing": (scene.spacing, trained.spacing),
        }
        for name, (there, needed) in pairs.items():
            if abs(there - needed) > _NEAR * needed:
                raise ConfigError(f"{self._for()}, with {name} {needed:g}; the scene has {name} {there:g}")
        foreign = sorted({material.kind for material in scene.materials} - trained.materials.keys())
        if foreign:
            raise ConfigError(
                f"{self._for()}, with {', '.join(trained.materials)}; the scene has {foreign[0]}"
            )
        if (beyond := trained.constant_beyond(scene)) is not None:
            material, name, value, (low, high) = beyond
            known = f"{low:g}" if low == high else f"{low:g} to {high:g}"
            raise ConfigError(
                f"{self._for()}, with {material.kind} of {name} {known}; the scene's has {name} {value:g}"
            )
        scene.refuse_rigid("networks are", "none has learned their motion")
        if scene.obstacles and not trained.obstacles:
            raise ConfigError(f"{self._for()}, without obstacles; the scene has {len(scene.obstacles)}")
        if any(obstacle.motion is not None for obstacle in scene.obstacles):
            raise ConfigError(f"{self._for()}, with obstacles at rest; the scene has one that moves")
        if scene.is_open:
            raise ConfigError(f"{self._for()}, with fixed particles; the scene has emitters or sinks")
        if scene.transfer_loss is not None:
            raise ConfigError(
                f"{self._for()}, without transfer_loss; the scene has {scene.transfer_loss:g} 1/s"
            )

    def _for(self) -> str:
        return f"{self._where} was trained on {', '.join(self.spec.scenarios)}"

    def step(
        self,
        history: npt.NDArray[np.float32],
        types: npt.NDArray[np.int64],
        acceleration: npt.NDArray[np.float32],
        walls: npt.NDArray[np.float32],
    ) -> npt.NDArray[np.float32]:
        """Return positions one step later; see `Stepper.step`.

        Where nothing disturbs any particle, all fall freely and the network is not run.

        Raises
        ------
        ConfigError
            The latest positions are not finite.
        GraphSizeError
            A particle has more than 256 neighbours.
        """
        if not len(types):
            return np.array(history[-1], dtype=np.float32)
        history = np.ascontiguousarray(history)
        graph = radius_graph(
            history[-1],
            self.spec.radius,
            types,
            kinematic=KINEMATIC,
            max_edges=_MOST_NEIGHBORS * len(types),
        )
        state = (history, types, acceleration, walls)
        weight = answer_weights(*state, graph, spec=self.spec, scales=self.info.scales)
        if not weight.any():
            return free_fall(*state, self.spec.step_dt)
        feed = dict(zip(("history", "types", "acceleration", "walls"), state, strict=True))
        (moved,) = self._session.run(None, feed | edge_inputs(graph) | {"share": weight})
        return np.asarray(moved, dtype=np.float32)


def edge_inputs(graph: RadiusGraph) -> dict[str, npt.NDArray[Any]]:
    """Return the edges as the exported graph takes them: each once, and a table of those into each node.

    Where there is no edge, one that counts for nothing stands in: onnxruntime does not concatenate arrays
    without rows.

    Returns
    -------
    dict
        `senders`, `receivers` int32 (E,), `arrivals` int32 (N, K) and `mask` bool (N, K).

    Raises
    ------
    GraphSizeError
        K would exceed 256; the message names the particle.
    """
    starts = graph.starts.view(np.int32)
    degrees = np.diff(starts)
    most = int(degrees.max())
    if most > _MOST_NEIGHBORS:
        raise GraphSizeError(
            f"particle {int(degrees.argmax())} has {most} neighbours within {graph.radius:g} m, more than "
            f"{_MOST_NEIGHBORS}: the particles have clumped"
        )
    columns = np.arange(max(most, 1), dtype=np.int32)
    edges = (graph.senders.view(np.int32), graph.receivers.view(np.int32))
    if most == 0:
        edges = (np.zeros(1, np.int32), np.zeros(1, np.int32))
    arrivals = np.minimum(starts[:-1, None] + columns, len(edges[0]) - 1)
    return {
        "senders": edges[0],
        "receivers": edges[1],
        "arrivals": arrivals,
        "mask": columns < degrees[:, None],
    }
