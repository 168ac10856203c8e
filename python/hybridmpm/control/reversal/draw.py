"""Cases drawn from a seed, for training and for tests."""

from collections.abc import Callable

import numpy as np

from hybridmpm import scenarios
from hybridmpm._support.arguments import whole
from hybridmpm.control.reversal.case import (
    DEFAULT_CAP,
    DEFAULT_FRAMES,
    KINDS,
    STARTS,
    Kind,
    ReversedCase,
    Start,
    reversed_case,
)
from hybridmpm.mpm import Substeps
from hybridmpm.scene import Scene

MAX_DRAWN_FRAMES = 5_000
"""Largest number of frames of a drawn case; control starts at most twice as many frames into the scene."""
SHORTEST_ARROW = 0.12
"""Shortest arrow that is drawn [m]; shorter ones have no room for a head, so ovals stand for them."""
_SALT = 2**22
"""Number that the generator of a case gets besides the seed."""


def reversed_from_seed(
    scenario: str | Scene,
    seed: int,
    *,
    frames: int = DEFAULT_FRAMES,
    start: Start | None = None,
    kind: Kind | None = None,
    cap: float = DEFAULT_CAP,
    substeps: Substeps = "reference",
    r_p: float = 1.0,
    on_frame: Callable[[], object] = lambda: None,
) -> ReversedCase:
    """Draw the scene of a seed, and when control starts; return the case.

    Control starts between T and 2 T frames into the scene, so that the fluid is on its way or in its first
    splash, and as a rule not yet at rest.

    Parameters
    ----------
    scenario : str or Scene
        Name of a scenario whose scene is drawn, or a scene that was drawn from the seed by other means.
    seed : int
        Seed of scene and case. By convention seeds below 10**6 are for training, those from 10**6 on for
        validation, those from 1.1 * 10**6 on for tests.
    start, kind : optional
        As in `reversed_case`; drawn from the seed if absent. A fluid whose centre of mass comes less far than
        12 cm is not given an arrow.
    frames, cap, substeps, r_p, on_frame
        As in `reversed_case`.

    Raises
    ------
    UnknownScenarioError
        No scenario has this name.
    ConfigError, SketchError, SimulationError
        As `reversed_case`.
    """
    frames = whole("frames", frames, 2, MAX_DRAWN_FRAMES)
    scene = scenario if isinstance(scenario, Scene) else scenarios.get(scenario, seed)
    rng = np.random.default_rng([_SALT, seed])
    control_frame = frames + int(rng.integers(frames, endpoint=True))
    # All are drawn whatever was given, so that a choice does not change the others.
    drawn_start, drawn_kind = STARTS[rng.integers(len(STARTS))], KINDS[rng.integers(len(KINDS))]
    return reversed_case(
        scene,
        control_frame=control_frame,
        frames=frames,
        start=drawn_start if start is None else start,
        kind=drawn_kind if kind is None else kind,
        shortest_arrow=SHORTEST_ARROW if kind is None else None,
        cap=cap,
        substeps=substeps,
        r_p=r_p,
        seed=seed,
        on_frame=on_frame,
    )
