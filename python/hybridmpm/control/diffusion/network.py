"""`ControlNetwork`: a trained Fluid ControlNet under onnxruntime, with its sampler."""

from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from hybridmpm._core import radius_graph
from hybridmpm._support.networks import NetworkFolder, ServedNetwork, damage
from hybridmpm.control.diffusion.samplers import Solver, sampled
from hybridmpm.control.sketch.render import render
from hybridmpm.control.sketch.sketch import RASTER_SIZE, Sketch
from hybridmpm.physics.model import edge_inputs
from hybridmpm.physics.spec import NetworkSpec

FORMAT = "controlnet 1"
"""Kind and version of the network's inputs and of the metadata of its file."""
INPUTS = (
    "x", "v", "types", "senders", "receivers", "arrivals", "mask", "noisy", "step", "picture", "time",
)  # fmt: skip
OUTPUT = "clean"
SIDE = 64
"""Side of the picture of a sketch that a network sees [pixels]."""

Floats32 = npt.NDArray[np.float32]


def picture_of(sketch: Sketch) -> npt.NDArray[np.uint8]:
    """Return the ink of a sketch (3, 64, 64), 0 to 255 in each colour; 0 where there is none.

    It is drawn on the raster of 512 pixels, and each pixel is the mean over 8 by 8 of that.
    """
    block = RASTER_SIZE // SIDE
    ink = 255.0 - render(sketch)[..., :3].astype(np.float64)
    means = ink.reshape(SIDE, block, SIDE, block, 3).mean(axis=(1, 3))
    return np.asarray(means.round().astype(np.uint8).transpose(2, 0, 1))


class ControlNetwork(ServedNetwork):
    """A trained Fluid ControlNet."""

    FORMAT = FORMAT
    FOLDER = NetworkFolder(Path(__file__).parent / "weights")

    def _described(self, plain: dict[str, Any]) -> None:
        with damage(self._where):
            spec, self.training = dict(plain["spec"]), dict(plain["training"])
            self.scale, self.frames = float(plain["scale"]), int(plain["frames"])
        self.spec = NetworkSpec.from_dict(spec, where=self._where)

    def field(
        self,
        x: Floats32,
        v: Floats32,
        types: npt.NDArray[np.int64],
        *,
        step: float,
        picture: npt.NDArray[np.uint8],
        noise: Floats32,
        steps: int,
        solver: Solver,
    ) -> Floats32:
        """Return the accelerations (K, D) [m/s^2] of control nodes in one frame.

        Parameters
        ----------
        x, v : (K, D)
            Positions [m] and velocities [m/s] of the nodes.
        types : int64 (K,)
            Their particle types.
        step : float in [0, 1]
            Control step over the number of steps.
        picture : uint8 (3, 64, 64)
            From `picture_of`.
        noise : (K, D)
            Normal numbers; other ones give another field.
        steps : int in [1, 20]
            Evaluations of the network.
        solver : "ddim" or "dpm"
            Sampler; of one step both are the same.

        Raises
        ------
        ConfigError
            `steps` or `solver` is out of range, or positions are not finite.
        GraphSizeError
            A node has more than 256 neighbours.
        """
        graph = edge_inputs(radius_graph(x, self.spec.radius))
        conditions: dict[str, npt.NDArray[Any]] = {
            "x": x,
            "v": v,
            "types": types,
            **graph,
            "step": np.full((len(x), 1), step, dtype=np.float32),
            "picture": picture[None].astype(np.float32) / 255.0,
        }

        def denoised(noisy: npt.NDArray[np.floating], time: int) -> npt.NDArray[np.floating]:
            feed = conditions | {"noisy": noisy.astype(np.float32), "time": np.array([time])}
            (clean,) = self._session.run([OUTPUT], feed)
            return np.asarray(clean)

        clean = sampled(denoised, noise, steps=steps, solver=solver)
        return (np.asarray(clean) * self.scale).astype(np.float32)
