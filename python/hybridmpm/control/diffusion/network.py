"""`ControlNetwork`: a trained Fluid ControlNet under onnxruntime, with its sampler."""

import functools
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Self

import numpy as np
import numpy.typing as npt

from hybridmpm._core import radius_graph
from hybridmpm._support.onnx_file import session
from hybridmpm.control.diffusion.samplers import Solver, sampled
from hybridmpm.control.manifest import read_network
from hybridmpm.control.sketch.render import render
from hybridmpm.control.sketch.sketch import RASTER_SIZE, Sketch
from hybridmpm.errors import DataError
from hybridmpm.physics.model import edge_inputs
from hybridmpm.physics.spec import NetworkSpec

FORMAT = 1
"""Version of the network's inputs and of the metadata of its file."""
INPUTS = (
    "x", "v", "types", "senders", "receivers", "arrivals", "mask", "noisy", "step", "picture", "time",
)  # fmt: skip
OUTPUT = "clean"
SIDE = 64
"""Side of the picture of a sketch that a network sees [pixels]."""
WEIGHTS = Path(__file__).parent / "weights"
"""Folder of the networks that come with the library."""

Floats32 = npt.NDArray[np.float32]


def picture_of(sketch: Sketch) -> npt.NDArray[np.uint8]:
    """Return the ink of a sketch (3, 64, 64), 0 to 255 in each colour; 0 where there is none.

    It is drawn on the raster of 512 pixels, and each pixel is the mean over 8 by 8 of that.
    """
    block = RASTER_SIZE // SIDE
    ink = 255.0 - render(sketch)[..., :3].astype(np.float64)
    means = ink.reshape(SIDE, block, SIDE, block, 3).mean(axis=(1, 3))
    return np.asarray(means.round().astype(np.uint8).transpose(2, 0, 1))


class ControlNetwork:
    """A trained Fluid ControlNet. Safe to share between threads: it remembers nothing.

    Parameters
    ----------
    data : bytes
        An ONNX file that `hybridmpm export` wrote.
    where : str
        Begins the messages of errors.
    threads : int in [1, 1024]

    Raises
    ------
    DataError
        The file is damaged, or no Fluid ControlNet of this format.
    ConfigError
        The network was trained on features of another version, or `threads` is out of range.
    """

    def __init__(self, data: bytes, *, where: str, threads: int = 1) -> None:
        self._session = session(data, threads=threads, where=where)
        properties = self._session.get_modelmeta().custom_metadata_map
        self.spec, self.scale, self.frames, self.training = _told(properties, where)

    @classmethod
    def load(cls, name: str | Path, *, threads: int = 1) -> Self:
        """Load a network that comes with the library, by name, or a file whose name ends in .onnx.

        Raises
        ------
        DataError, ConfigError
            As the constructor; or there is no such network or file.
        """
        path = Path(name)
        if path.suffix != ".onnx":
            return cls(read_network(str(name), WEIGHTS), where=f"network {name}", threads=threads)
        try:
            data = path.read_bytes()
        except OSError as error:
            raise DataError(f"cannot read {path}: {error.strerror or error}") from None
        return cls(data, where=str(path), threads=threads)

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
        told: dict[str, npt.NDArray[Any]] = {
            "x": x,
            "v": v,
            "types": types,
            **graph,
            "step": np.full((len(x), 1), step, dtype=np.float32),
            "picture": picture[None].astype(np.float32) / 255.0,
        }

        def denoised(noisy: npt.NDArray[np.floating], time: int) -> npt.NDArray[np.floating]:
            feed = told | {"noisy": noisy.astype(np.float32), "time": np.array([time])}
            (clean,) = self._session.run([OUTPUT], feed)
            return np.asarray(clean)

        clean = sampled(denoised, noise, steps=steps, solver=solver)
        return (np.asarray(clean) * self.scale).astype(np.float32)


@functools.lru_cache(maxsize=4)
def network_of(name: str) -> ControlNetwork:
    """Return a network by name or file, loaded once; errors as `ControlNetwork.load`."""
    return ControlNetwork.load(name)


def properties_of(
    spec: NetworkSpec, scale: float, frames: int, training: Mapping[str, str]
) -> dict[str, str]:
    """Return texts for the metadata of a network's file, which `ControlNetwork` reads."""
    return {
        "format": f"controlnet {FORMAT}",
        "spec": json.dumps(spec.to_dict()),
        "scale": repr(scale),
        "frames": str(frames),
        "training": json.dumps(dict(training)),
    }


def _told(properties: Mapping[str, str], where: str) -> tuple[NetworkSpec, float, int, dict[str, Any]]:
    there = properties.get("format", "none")
    if there != f"controlnet {FORMAT}":
        raise DataError(f"{where} has format {there}; this library serves format controlnet {FORMAT}")
    try:
        spec, training = json.loads(properties["spec"]), dict(json.loads(properties["training"]))
        scale, frames = float(properties["scale"]), int(properties["frames"])
    except (KeyError, TypeError, ValueError) as error:
        raise DataError(f"{where}: its metadata is damaged: {error!r}; export it anew") from None
    return NetworkSpec.from_dict(spec, where=where), scale, frames, training
