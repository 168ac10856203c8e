"""Digests of eight scenes: whoever changes the bits has to say so.

    python tests/golden/digests.py            prints them
    python tests/golden/digests.py --write    takes them as the new truth of the present `SOLVER_VERSION`

Other bits are another truth, so new digests need a new `SOLVER_VERSION` in rust/mpm/src/version.rs: its
number tells snapshots, data sets and networks of the older solver.

The core computes with IEEE operations of one width and its own exponential and logarithm, so the bits are
those of any processor, with AVX2 or without.
"""

import hashlib
import json
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from hybridmpm import SOLVER_VERSION, BallObstacle, Box, MpmSolver, Scene, SegmentObstacle, scenarios

FILE = Path(__file__).with_suffix(".json")
FRAMES = 80
SEED = 3


def scenes() -> dict[str, Scene]:
    """One of each scenario, and one with an elastic body, water and obstacles of both contacts."""
    drawn = {name: scenarios.get(name, SEED) for name in scenarios.NAMES}
    bodies = (
        Box(material="elastic", lower=(0.3, 0.6), upper=(0.45, 0.75), velocity=(1.0, -1.0)),
        Box(material="water", lower=(0.5, 0.4), upper=(0.7, 0.6), velocity=(-1.0, 0.0)),
    )
    obstacles = (
        BallObstacle(center=(0.4, 0.3), radius=0.06, contact="sticky"),
        SegmentObstacle(start=(0.5, 0.2), end=(0.8, 0.3), thickness=0.05, friction=0.3),
    )
    return {**drawn, "elastic_and_obstacles": Scene(dim=2, bodies=bodies, obstacles=obstacles)}


def digest(scene: Scene, threads: int = 1) -> dict[str, int | str]:
    """Return the number of particles, and the SHA-256 of their state after `FRAMES` frames."""
    solver = MpmSolver(scene, substeps="reference", threads=threads)
    solver.advance(FRAMES)
    state = solver.positions.astype("<f4").tobytes() + solver.velocities.astype("<f4").tobytes()
    return {"particles": solver.particle_count, "sha256": hashlib.sha256(state).hexdigest()}


def committed() -> dict[str, Any]:
    """Return the committed truth: `solver_version`, and `scenes` with the digest of each."""
    return dict(json.loads(FILE.read_text(encoding="utf-8")))


def checked(old: Mapping[str, Any], new: Mapping[str, Any]) -> Mapping[str, Any]:
    """Return the new truth.

    Raises
    ------
    ValueError
        It has other digests than the old one and the same version.
    """
    if old["scenes"] != new["scenes"] and old["solver_version"] == new["solver_version"]:
        raise ValueError(
            f"the bits differ from those of solver version {old['solver_version']}: raise SOLVER_VERSION in "
            "rust/mpm/src/version.rs, say there what has changed, and build anew"
        )
    return new


if __name__ == "__main__":
    found = {
        "solver_version": SOLVER_VERSION,
        "scenes": {name: digest(scene) for name, scene in scenes().items()},
    }
    print(json.dumps(found, indent=1))
    if "--write" in sys.argv:
        try:
            FILE.write_text(json.dumps(checked(committed(), found), indent=1) + "\n", encoding="utf-8")
        except ValueError as refusal:
            sys.exit(f"nothing written: {refusal}")
