"""`TransportNetwork`: a trained transport network under onnxruntime."""

from pathlib import Path
from typing import Any

import numpy as np

from hybridmpm._support.arguments import whole
from hybridmpm._support.networks import NetworkFolder, ServedNetwork, damage
from hybridmpm.control.goal.cloud import Floats
from hybridmpm.control.methods.learned.features import Aim, State, inputs
from hybridmpm.control.methods.learned.noise import smooth_noise
from hybridmpm.control.methods.learned.spec import TransportSpec

FORMAT = "transport 1"
"""Kind and version of the network's inputs and of the metadata of its file."""
INPUTS = ("grid", "numbers", "particles", "places", "noisy", "time")
OUTPUT = "end"


class TransportNetwork(ServedNetwork):
    """A trained transport network."""

    FORMAT = FORMAT
    FOLDER = NetworkFolder(Path(__file__).parent / "weights")

    def _described(self, plain: dict[str, Any]) -> None:
        with damage(self._where):
            spec, self.training = plain["spec"], dict(plain["training"])
        self.spec = TransportSpec.from_dict(spec, where=self._where)

    def ends(self, state: State, aim: Aim, *, seed: int, evaluations: int) -> Floats:
        """Return where the particles may have come from: places (N, D) for the end of control [m].

        Parameters
        ----------
        state : State
            Where the N particles are.
        aim : Aim
            The end as far as the sketch shows it.
        seed : int
            Seed of the noise; other seeds give other ends.
        evaluations : int in [1, 20]
            Steps in which the flow from noise to places is followed, by Euler's method.
        """
        steps = whole("evaluations", evaluations, 1, 20)
        given = inputs([state], [aim], [None], obstacles=self.spec.obstacles)
        noisy = smooth_noise(np.random.default_rng(seed), given.places[0].astype(np.float64))[None]
        for step in range(steps):
            time = np.full(1, step / steps, dtype=np.float32)
            feed = {**vars(given), "noisy": noisy.astype(np.float32), "time": time}
            (end,) = self._session.run([OUTPUT], feed)
            noisy += (end - noisy) / (steps - step)
        return aim.to_metres(noisy[0])
