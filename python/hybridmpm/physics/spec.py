"""`NetworkSpec` and `Normalization`: the settings of a learned simulator besides its weights."""

import dataclasses
import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Self

from hybridmpm._support.arguments import whole
from hybridmpm.errors import ConfigError
from hybridmpm.scenarios.trained_on import TrainedOn

HISTORY = 6
"""Positions that a network step takes, the present one among them: they give five velocities."""
RADIUS_SPACINGS = {2: 2.5, 3: 1.8}
"""Default connectivity radius [spacings], by dimension. The cost grows with the number of neighbours, so the
radius is smaller than the paper's."""
TYPES = 9
"""Particle types of DeepMind's convention, used or not."""
TYPE_EMBEDDING = 16
"""Numbers that stand for a particle's type."""
FEATURES_VERSION = 1
"""Raised when the same inputs give other features; checkpoints and models of another version are refused."""

MAX_STRIDE = 64
"""Largest r_t."""

GRID_CELLS = (4, 64)
"""Smallest and largest number of cells of a grid branch along an axis."""

_MAX_LATENT, _MAX_LAYERS, _MAX_HIDDEN = 1024, 64, 8


@dataclass(frozen=True, kw_only=True)
class NetworkSpec:
    """A member of the family of networks (Sanchez-Gonzalez et al. 2020, arXiv:2002.09405).

    The paper's is latent 128, 10 layers, 2 hidden layers.

    Raises
    ------
    ConfigError
        A number is out of range, a scenario unknown, or scenarios differ in what one network must share.
    """

    scenarios: tuple[str, ...]
    """Scenarios in the training data, or names of other scenes."""
    scenes: TrainedOn | None = None
    """Properties of the scenes in the training data; if None, those of the scenarios."""
    latent: int = 128
    """Width of node and edge latents, in [1, 1024]."""
    layers: int = 10
    """Message-passing layers L, in [1, 64]."""
    hidden_layers: int = 2
    """ReLU layers inside each multilayer perceptron, in [1, 8]."""
    radius: float
    """Connectivity radius R [m]."""
    r_p: float = 1.0
    """Particles over those of the scene, in (0, 1]."""
    r_t: int = 1
    """Frames that one network step spans, in [1, 64]."""
    grid_cells: int = 0
    """Cells of the grid branch along each axis of the unit box, in [4, 64], or 0 without such a branch, as in
    the paper."""

    def __post_init__(self) -> None:
        object.__setattr__(self, "scenarios", tuple(self.scenarios))
        whole("latent", self.latent, 1, _MAX_LATENT)
        whole("layers", self.layers, 1, _MAX_LAYERS)
        whole("hidden_layers", self.hidden_layers, 1, _MAX_HIDDEN)
        whole("r_t", self.r_t, 1, MAX_STRIDE)
        if self.grid_cells != 0:
            whole("grid_cells", self.grid_cells, *GRID_CELLS)
        if not (0.0 < self.r_p <= 1.0):
            raise ConfigError(f"r_p must be in (0, 1], got {self.r_p}")
        if not (math.isfinite(self.radius) and 0.0 < self.radius <= 1.0):
            raise ConfigError(f"radius must be in (0, 1] m, got {self.radius}")
        if not self.scenarios:
            raise ConfigError("a network needs at least one scenario")
        _ = self.trained_on

    @property
    def trained_on(self) -> TrainedOn:
        """Properties of the scenes in the training data."""
        return self.scenes or TrainedOn.of_scenarios(self.scenarios)

    @property
    def dim(self) -> int:
        """D, 2 or 3."""
        return self.trained_on.dim

    @property
    def frame_dt(self) -> float:
        """Length of a frame [s]."""
        return self.trained_on.frame_dt

    @property
    def step_dt(self) -> float:
        """Time that one network step spans [s]."""
        return self.frame_dt * self.r_t

    @property
    def bounds(self) -> list[list[float]]:
        """Lower and upper wall of each axis [m], as in a data set's metadata."""
        return self.trained_on.bounds

    @property
    def spacing(self) -> float:
        """Mean distance of particles at rest [m]: that of the scene's, r_p^(-1/D) wider."""
        return float(self.trained_on.spacing * self.r_p ** (-1 / self.dim))

    @property
    def node_features(self) -> int:
        """Numbers of a node: 5 velocities, 2 wall distances an axis, the type; 30 in 2D and 37 in 3D."""
        return (HISTORY - 1) * self.dim + 2 * self.dim + TYPE_EMBEDDING

    @property
    def edge_features(self) -> int:
        """Numbers of an edge: displacement and distance."""
        return self.dim + 1

    def to_dict(self) -> dict[str, Any]:
        """Plain data that `from_dict` reads."""
        fields = dataclasses.asdict(self) | {"scenarios": list(self.scenarios)}
        if self.scenes is None:
            del fields["scenes"]
        return {"features": FEATURES_VERSION, **fields, "relaxations": 0}

    @classmethod
    def from_dict(cls, data: Mapping[str, Any], *, where: str) -> Self:
        """Read what `to_dict` wrote.

        Raises
        ------
        ConfigError
            Features of another version, relaxations of density after a step, or missing or unknown keys; the
            message begins with `where`.
        """
        plain = dict(data)
        version = plain.pop("features", None)
        if version != FEATURES_VERSION:
            raise ConfigError(f"{where} has features version {version}; this library has {FEATURES_VERSION}")
        relaxations = plain.pop("relaxations", 0)
        if relaxations != 0:
            raise ConfigError(
                f"{where} has {relaxations} relaxations of density after each step; this library has none"
            )
        scenes = plain.pop("scenes", None)
        own = None if scenes is None else TrainedOn.from_dict(scenes, where=where)
        try:
            return cls(**plain, scenes=own)
        except TypeError as error:
            raise ConfigError(f"{where} does not describe a network: {error}") from None


@dataclass(frozen=True, kw_only=True)
class Normalization:
    """Scales of the network's inputs and outputs, one number an axis, in metres per step and step squared.

    Standard deviations have the training noise folded in, sqrt(std^2 + noise_std^2), as in the reference
    implementation of Sanchez-Gonzalez et al. (2020). Accelerations are those left after the known ones,
    gravity and external, are taken out.
    """

    velocity_mean: tuple[float, ...]
    velocity_std: tuple[float, ...]
    acceleration_mean: tuple[float, ...]
    acceleration_std: tuple[float, ...]
    noise_std: float
    """Standard deviation of the noise on the last velocity of a training sample [m per step]."""

    def __post_init__(self) -> None:
        lengths = set()
        for field in dataclasses.fields(self):
            if field.name == "noise_std":
                continue
            numbers = tuple(float(number) for number in getattr(self, field.name))
            object.__setattr__(self, field.name, numbers)
            lengths.add(len(numbers))
            if not all(map(math.isfinite, numbers)):
                raise ConfigError(f"{field.name} must be finite, got {numbers}")
            if field.name.endswith("std") and min(numbers, default=0.0) <= 0.0:
                raise ConfigError(f"{field.name} must be above 0 on each axis, got {numbers}")
        if len(lengths) != 1:
            raise ConfigError("means and standard deviations must have one number an axis each")

    def to_dict(self) -> dict[str, Any]:
        """Plain data for the constructor."""
        return dataclasses.asdict(self)
