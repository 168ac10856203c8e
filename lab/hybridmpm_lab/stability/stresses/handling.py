"""Stresses of handling: forces, sleep, snapshots, and for the hybrid its network and its handoffs."""

import numpy as np
import numpy.typing as npt

from hybridmpm.mpm import Sleep
from hybridmpm.simulator import Simulator
from hybridmpm_lab.stability.corruptions import CORRUPTIONS, Corrupted, pushed
from hybridmpm_lab.stability.stresses.trial import (
    EVERYWHERE,
    FRAMES,
    Stress,
    Trial,
    block,
    scene,
    vector,
)

_REST = 400
"""Frames after which the block lies still."""


def _spikes(of: str, dim: int) -> tuple[Trial, ...]:
    def trial(size: float) -> Trial:
        def force(simulator: Simulator) -> tuple[float, ...] | None:
            return vector(dim, size) if simulator.frame == FRAMES // 4 else None

        return Trial(
            level=f"{size:g} m/s^2 for a frame",
            scene=scene(dim, block(of, dim)),
            frames=2 * FRAMES,
            force=force,
        )

    return trial(1e2), trial(1e3), trial(5e3)


def _pulled(of: str, dim: int) -> tuple[Trial, ...]:
    """Pull the halves of a block apart, and then press them together again."""

    def trial(size: float) -> Trial:
        def force(simulator: Simulator) -> npt.NDArray[np.float32] | None:
            turn = {0: 1.0, 1: -1.0}.get((simulator.frame - 40) // 60)
            if turn is None:
                return None
            x = simulator.positions
            push = np.zeros_like(x)
            push[:, 0] = turn * size * np.sign(x[:, 0] - 0.5)
            return push

        return Trial(
            level=f"{size:g} m/s^2",
            scene=scene(dim, block(of, dim, height=0.0)),
            frames=FRAMES,
            force=force,
        )

    return trial(5.0), trial(20.0), trial(80.0)


def _asleep(of: str, dim: int) -> tuple[Trial, ...]:
    def trial(size: float) -> Trial:
        def force(simulator: Simulator) -> tuple[float, ...] | None:
            return vector(dim, size) if _REST <= simulator.frame < _REST + 40 else None

        return Trial(
            level=f"{size:g} m/s^2",
            scene=scene(dim, block(of, dim, height=0.0)),
            frames=FRAMES,
            force=force,
            mpm={"sleep": Sleep()},
        )

    return trial(0.5), trial(5.0), trial(50.0)


def _resumed(of: str, dim: int) -> tuple[Trial, ...]:
    return tuple(
        Trial(
            level=f"at frame {frame}",
            scene=scene(dim, block(of, dim, velocity=vector(dim, 2.0))),
            frames=FRAMES // 2,
            resume_at=frame,
        )
        for frame in (60, 120, 200)
    )


def _handed_over(of: str, dim: int) -> tuple[Trial, ...]:
    return tuple(
        Trial(
            level=f"every {steps} steps" if steps > 1 else "at every step",
            scene=scene(dim, block(of, dim)),
            frames=FRAMES,
            hand_over_every=steps,
        )
        for steps in (8, 2, 1)
    )


def _biased(of: str, dim: int) -> tuple[Trial, ...]:
    def trial(size: float) -> Trial:
        return Trial(
            level=f"{size:g} m/s^2",
            scene=scene(dim, block(of, dim)),
            frames=FRAMES,
            spoil=lambda network, of: Corrupted(network, pushed(size), of),
        )

    return trial(0.5), trial(5.0), trial(50.0)


def _broken(of: str, dim: int) -> tuple[Trial, ...]:
    def trial(kind: str) -> Trial:
        return Trial(
            level=kind,
            scene=scene(dim, block(of, dim)),
            frames=FRAMES,
            spoil=lambda network, of: Corrupted(network, CORRUPTIONS[kind], of),
        )

    return trial("random"), trial("constant"), trial("nan")


HANDLING = (
    Stress(
        name="force spike",
        text="one frame of a large force at the end of the fall",
        trials=_spikes,
        settings=EVERYWHERE,
    ),
    Stress(name="pulled apart", text="halves are pulled apart and pressed together", trials=_pulled),
    Stress(name="asleep", text="matter that fell asleep is pushed for 40 frames", trials=_asleep),
    Stress(name="resumed", text="a snapshot of a splash is gone on from", trials=_resumed),
    Stress(
        name="handoff",
        text="network and MPM take turns whatever the guards say",
        trials=_handed_over,
        methods=("hybrid",),
    ),
    Stress(
        name="biased network",
        text="all answers of the network are pushed aside",
        trials=_biased,
        methods=("hybrid",),
    ),
    Stress(
        name="broken network",
        text="the network answers noise, one place for all, or NaN",
        trials=_broken,
        methods=("hybrid",),
    ),
)
"""Stresses by what is done from outside, or to the network."""
