"""A tiny data set that the tests of `hybridmpm.data` share."""

from pathlib import Path
from typing import Any

import pytest

from hybridmpm import data

DROPS: dict[str, Any] = {
    "name": "drops",
    "dim": 2,
    "resolution": 64,
    "bodies": [
        {
            "shape": "ball",
            "material": {"choice": ["water", "sand"]},
            "center": [{"uniform": [0.3, 0.7]}, 0.5],
            "radius": {"uniform": [0.04, 0.06]},
        }
    ],
    "obstacles": [{"shape": "segment", "start": [0.3, 0.2], "end": [0.6, 0.3], "thickness": 0.04}],
}

SOME_TOO_STIFF: dict[str, Any] = {
    **DROPS,
    "bodies": [
        {**DROPS["bodies"][0], "material": {"kind": "sand", "youngs_modulus": {"choice": [1e6, 1e11]}}}
    ],
}
"""With 20 substeps a frame: far too few for the stiff sand, more than enough for the other."""


@pytest.fixture(scope="session")
def drops() -> data.Recipe:
    """Return a recipe of about 100 particles over a ramp for 8 frames, with a force."""
    return data.Recipe(template=data.SceneTemplate(DROPS), frames=8, force=5.0)


@pytest.fixture(scope="session")
def made(tmp_path_factory: pytest.TempPathFactory, drops: data.Recipe) -> Path:
    """Return the folder of a data set of 4 + 1 + 1 trajectories; not to be written to."""
    folder = tmp_path_factory.mktemp("data") / "drops"
    planned = data.plan(drops, folder, data.Seeds(train=4, valid=1, test=1))
    assert data.generate(planned, executor=data.Threads(2)).made == 6
    return folder


def trajectories(folder: Path, split: str = "train", form: str = "hybridmpm") -> list[data.Trajectory]:
    """Read a split whole."""
    return list(data.FORMATS[form].read(folder, split, None))
