"""`TransportNetwork`: a trained transport network under onnxruntime."""

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Self

import numpy as np

from hybridmpm._support.arguments import whole
from hybridmpm._support.onnx_file import session
from hybridmpm.control.goal.cloud import Floats
from hybridmpm.control.manifest import read_network
from hybridmpm.control.methods.learned.features import Aim, State, inputs
from hybridmpm.control.methods.learned.noise import smooth_noise
from hybridmpm.control.methods.learned.spec import TransportSpec
from hybridmpm.errors import DataError

FORMAT = 1
"""Version of the network's inputs and of the metadata of its file."""
INPUTS = ("grid", "numbers", "particles", "places", "noisy", "time")
OUTPUT = "end"
WEIGHTS = Path(__file__).parent / "weights"
"""Folder of the networks that come with the library."""


class TransportNetwork:
    """A trained transport network. Safe to share between threads: it remembers nothing.

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
        The file is damaged, or no transport network of this format.
    ConfigError
        The network was trained on features of another version, or `threads` is out of range.
    """

    def __init__(self, data: bytes, *, where: str, threads: int = 1) -> None:
        self._session = session(data, threads=threads, where=where)
        properties = self._session.get_modelmeta().custom_metadata_map
        self.spec, self.training = _told(properties, where)

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

    def ends(self, state: State, aim: Aim, *, seed: int, evaluations: int) -> Floats:
        """Return where the particles may have come from: places (N, D) for the end of control [m].

        Parameters
        ----------
        state : State
            Where the N particles are.
        aim : Aim
            What the sketch tells of the end.
        seed : int
            Seed of the noise; other seeds give other ends.
        evaluations : int in [1, 20]
            Steps in which the flow from noise to places is followed, by Euler's method.
        """
        steps = whole("evaluations", evaluations, 1, 20)
        told = inputs([state], [aim], [None])
        noisy = smooth_noise(np.random.default_rng(seed), told.places[0].astype(np.float64))[None]
        for step in range(steps):
            time = np.full(1, step / steps, dtype=np.float32)
            feed = {**vars(told), "noisy": noisy.astype(np.float32), "time": time}
            (end,) = self._session.run([OUTPUT], feed)
            noisy += (end - noisy) / (steps - step)
        return aim.to_metres(noisy[0])


def properties_of(spec: TransportSpec, training: Mapping[str, str]) -> dict[str, str]:
    """Return texts for the metadata of a network's file, which `TransportNetwork` reads."""
    return {
        "format": f"transport {FORMAT}",
        "spec": json.dumps(spec.to_dict()),
        "training": json.dumps(dict(training)),
    }


def _told(properties: Mapping[str, str], where: str) -> tuple[TransportSpec, dict[str, Any]]:
    there = properties.get("format", "none")
    if there != f"transport {FORMAT}":
        raise DataError(f"{where} has format {there}; this library serves format transport {FORMAT}")
    try:
        spec, training = json.loads(properties["spec"]), dict(json.loads(properties["training"]))
    except (KeyError, TypeError, ValueError) as error:
        raise DataError(f"{where}: its metadata is damaged: {error!r}; export it anew") from None
    return TransportSpec.from_dict(spec, where=where), training
