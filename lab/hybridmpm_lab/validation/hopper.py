"""Sand leaves a bin through a slot in its floor: Q ~ (D - k dx)^1.5 (Beverloo et al. 1961, in plane flow)."""

import numpy as np

from hybridmpm.mpm import MpmSolver
from hybridmpm.scene import Box, BoxObstacle, Sand, Scene, Walls
from hybridmpm.scene.scene import ADVISED_LOSS
from hybridmpm_lab.validation.case import Check, Curve, Panel, Result

WIDTHS = (4, 6, 8, 12, 16)
"""Widths of the slot [cells]."""
MOST_LOST = 1.5
"""Accepted k: cells of the slot through which nothing flows [-]."""
_RESOLUTION = 128
_ANGLE = 35.0
_FLOOR, _THICKNESS, _TOP = 0.46, 0.04, 0.92  # lower face and thickness of the floor, top of the sand [m]
_LEFT, _RIGHT = 0.3, 0.7  # walls [m]
_START, _FRAMES = 120, 120  # frames before the flow is taken, and those of the mean


def run(widths: tuple[int, ...] = WIDTHS) -> Result:
    """Let a bin run out through slots of some widths [cells], with and without deviations that are kept."""
    checks: list[Check] = []
    curves: list[Curve] = []
    x = np.array(widths, dtype=np.float64)
    for colour, loss in enumerate((ADVISED_LOSS, None)):
        flows = np.array([flow(width, loss) for width in widths])
        # A straight line: its zero is k.
        roots = (flows / np.sqrt(9.81 / _RESOLUTION**3)) ** (2 / 3)
        slope, height = np.polyfit(x, roots, 1)
        lost = float(-height / slope)
        kind = "APIC" if loss is None else f"loss {loss:g}/s"
        misfit = float(np.abs(roots / (slope * (x - lost)) - 1).max())
        if loss is None:
            checks += (
                Check.reported(f"k, {kind}", lost, f"<= {MOST_LOST:g}"),
                Check.reported(f"C, {kind}", float(slope**1.5)),
            )
        else:
            checks += (
                Check.between(f"k, {kind}", lost, (0.0, MOST_LOST)),
                Check.at_most(f"largest distance from the line, {kind}", misfit, 0.1),
                Check.reported(f"C in Q = C sqrt(g) (D - k dx)^1.5, {kind}", float(slope**1.5), "1.0 to 1.4"),
            )
        curves += (
            Curve(x, roots, kind, colour, "o"),
            Curve([lost, x[-1]], [0.0, slope * (x[-1] - lost)], colour=colour),
        )
    panel = Panel(
        "Hopper",
        "width D [cells]",
        "(Q / sqrt(g dx^3))^(2/3)",
        curves,
        {"xlim": (0, None), "ylim": (0, None)},
    )
    return Result(checks, [panel])


def flow(width: int, loss: float | None) -> float:
    """Return the area of sand that leaves through a slot of so many cells in a second [m^2/s]."""
    side, top = width / _RESOLUTION / 2, _FLOOR + _THICKNESS
    scene = Scene(
        dim=2,
        resolution=_RESOLUTION,
        walls=Walls(lower=(_LEFT, 0.05), upper=(_RIGHT, 0.95)),
        bodies=[Box(material=Sand(friction_angle=_ANGLE), lower=(_LEFT, top), upper=(_RIGHT, _TOP))],
        obstacles=[
            BoxObstacle(lower=(0.0, _FLOOR), upper=(0.5 - side, top)),
            BoxObstacle(lower=(0.5 + side, _FLOOR), upper=(1.0, top)),
        ],
        transfer_loss=loss,
    )
    solver = MpmSolver(scene)
    area = (_RIGHT - _LEFT) * (_TOP - top)

    def inside() -> float:
        return float((solver.positions[:, 1] > _FLOOR + _THICKNESS / 2).mean()) * area

    solver.advance(_START)
    before = inside()
    solver.advance(_FRAMES)
    return (before - inside()) / (_FRAMES * scene.frame_dt)
