"""`metadata.json`: DeepMind's keys, the keys that LagrangeBench reads, and ours under "hybridmpm"."""

import hashlib
import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from hybridmpm._core import __version__
from hybridmpm._support.files import replacing
from hybridmpm.coarse.merging import spacing_at
from hybridmpm.data.recipe import Recipe
from hybridmpm.data.statistics import Statistics
from hybridmpm.errors import DataError
from hybridmpm.scene import Fluid, Scene
from hybridmpm.scene.materials import REFERENCE_BULK_MODULUS
from hybridmpm.scene.particle_types import NAMES
from hybridmpm.scene.plain_data import from_json

FILE = "metadata.json"
FORMAT_VERSION = 1
REQUIRED = ("bounds", "dim", "dt", "default_connectivity_radius", "sequence_length")
"""Keys that every reader needs and that do not follow from the positions."""
RADIUS_2D, RADIUS_3D = 0.015 * 256 / 1.75**0.5, 2.0
"""Connectivity radius [spacings]: in 2D 0.015 m at r_p = 1/1.75, as in DeepMind's sets; in 3D 2 spacings."""
_MATERIALS = 16
"""Largest number of materials listed. With ranges there may be more; each scene lists its own, too."""


def write(folder: Path, data: Mapping[str, Any]) -> None:
    """Write `metadata.json`, whole or not at all; raises `ExportError` where it cannot be written."""
    with replacing(folder / FILE) as part:
        part.write_text(json.dumps(data, indent=1) + "\n", encoding="utf-8")


def read(folder: Path) -> dict[str, Any]:
    """Read `metadata.json`.

    Raises
    ------
    DataError
        The file is missing or damaged, or it lacks a key of `REQUIRED`; the message names file and key.
    """
    path = folder / FILE
    try:
        data = from_json(path.read_bytes())
    except FileNotFoundError:
        raise DataError(
            f"{path} is missing; it must hold {', '.join(REQUIRED)}, which do not follow from positions"
        ) from None
    except (OSError, ValueError) as error:
        raise DataError(f"{path} cannot be read: {error}") from None
    if isinstance(data, dict) and "train" in data and "bounds" not in data:
        data = data["train"]  # gns may have one set of keys for training and another for rollouts
    if isinstance(data, dict):
        data = _from_lagrangebench(data)
    missing = [key for key in REQUIRED if not isinstance(data, dict) or key not in data]
    if missing:
        raise DataError(f"{path} lacks the key {missing[0]}; needed are {', '.join(REQUIRED)}")
    _check_bounds(data, path)
    return dict(data)


def _from_lagrangebench(data: dict[str, Any]) -> dict[str, Any]:
    """Turn LagrangeBench's keys into DeepMind's: its length counts states, its dt is of solver steps."""
    every, states = data.get("write_every", 1), data.get("sequence_length_train")
    if every != 1 and "dt" in data:
        data = {**data, "dt": data["dt"] * every, "write_every": 1}
    if "sequence_length" not in data and isinstance(states, int):
        data = {**data, "sequence_length": states - 1}
    return data


def _check_bounds(data: Mapping[str, Any], path: Path) -> None:
    bounds, dim = data["bounds"], data["dim"]
    pairs = isinstance(bounds, list) and all(isinstance(pair, list) and len(pair) == 2 for pair in bounds)
    if dim not in {2, 3} or not pairs or len(bounds) != dim or not all(low < high for low, high in bounds):
        raise DataError(
            f"{path}: bounds must be one [low, high] for each of dim = 2 or 3 axes, got {bounds!r}"
        )


def describe(
    recipe: Recipe,
    scenes: Sequence[Scene],
    statistics: Mapping[str, Statistics],
    *,
    digests: Mapping[str, Sequence[str]],
    seeds: Mapping[str, Sequence[int]],
    failed: Mapping[int, str],
) -> dict[str, Any]:
    """Build the metadata of a generated data set.

    Parameters
    ----------
    recipe : Recipe
    scenes : sequence of Scene, at least one
        Scenes of all trajectories.
    statistics, digests, seeds : mapping from split
        Statistics of each split, and digests and seeds of its trajectories. The velocities' and
        accelerations' statistics are those of the first split, which is "train" unless it is empty.
    failed : mapping from seed to message
        Simulations that failed.
    """
    scene = scenes[0]
    spacing = spacing_at(scene, recipe.r_p)
    first = next(iter(statistics.values()))
    dt = scene.frame_dt * recipe.stride
    return {
        "bounds": [list(pair) for pair in zip(scene.walls.lower, scene.walls.upper, strict=True)],
        "sequence_length": recipe.states - 1,
        "default_connectivity_radius": round((RADIUS_2D if scene.dim == 2 else RADIUS_3D) * spacing, 6),
        "dim": scene.dim,
        "dt": dt,
        **first.metadata(),
        **lagrangebench_keys(statistics),
        "case": recipe.name,
        "solver": "MLS-MPM",
        "dx": spacing,
        "t_end": dt * (recipe.states - 1),
        "write_every": 1,
        "g_ext_magnitude": sum(g * g for g in scene.gravity) ** 0.5,
        "hybridmpm": {
            "format": "hybridmpm",
            "format_version": FORMAT_VERSION,
            "version": __version__,
            "recipe": recipe.to_dict(),
            "frame_dt": scene.frame_dt,
            "frame_stride": recipe.stride,
            "r_p": recipe.r_p,
            "gravity": list(scene.gravity),
            "resolution": scene.resolution,
            "particles_per_cell": scene.particles_per_cell,
            "materials": _materials(scenes),
            "type_names": {str(number): name for number, name in NAMES.items()},
            "noise_std": 0.0,
            "statistics_of": next(iter(statistics)),
            "seeds": {split: _runs(numbers) for split, numbers in seeds.items()},
            "digests": {split: digest_of(parts) for split, parts in digests.items()},
            "failed": {str(seed): text for seed, text in failed.items()},
        },
    }


def lagrangebench_keys(statistics: Mapping[str, Statistics]) -> dict[str, Any]:
    """Return the keys that LagrangeBench reads besides DeepMind's; lengths in them count states."""
    dim = next(iter(statistics.values())).dim
    keys: dict[str, Any] = {
        "num_particles_max": max(max(part.particles) for part in statistics.values()),
        "periodic_boundary_conditions": [False] * dim,
    }
    for split, part in statistics.items():
        keys[f"sequence_length_{split}"] = max(part.states)
        keys[f"num_trajs_{split}"] = part.trajectories
    return keys


def digest_of(parts: Sequence[str]) -> str:
    """Return the SHA-256 of the digests of a split's trajectories, in their order."""
    return hashlib.sha256("\n".join(parts).encode()).hexdigest()


def _materials(scenes: Sequence[Scene]) -> list[dict[str, Any]]:
    distinct: dict[str, dict[str, Any]] = {}
    for scene in scenes:
        for material in scene.materials:
            constants = material.model_dump(exclude_none=True)
            if isinstance(material, Fluid) and material.max_compression is None:
                constants.setdefault("bulk_modulus", REFERENCE_BULK_MODULUS)
            distinct.setdefault(json.dumps(constants), constants)
    return list(distinct.values())[:_MATERIALS]


def _runs(numbers: Sequence[int]) -> list[list[int]]:
    """Return increasing numbers as runs without gaps, each as [first, last]."""
    runs: list[list[int]] = []
    for number in numbers:
        if runs and runs[-1][1] == number - 1:
            runs[-1][1] = number
        else:
            runs.append([number, number])
    return runs
