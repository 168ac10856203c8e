"""Water leaves a tank through a slot in its floor (Torricelli): the discharge coefficient."""

import math

from hybridmpm.mpm import MpmSolver
from hybridmpm.scene import Box, BoxObstacle, Scene, Walls, Water
from hybridmpm.scene.scene import ADVISED_LOSS
from hybridmpm_lab.validation.case import Check, Curve, Panel, Result

WIDTHS = (1, 2, 4, 8)
"""Widths of the slot [cells]; the narrowest is only reported."""
SUBSTEPS: tuple[int | None, ...] = (None, 24, 96)
"""Substeps of a frame; None is the solver's own choice."""
BAND = (0.55, 0.8)
"""Discharge coefficients of sharp-edged slots and short tubes [-]."""
BETWEEN = 0.37
"""Place of the middle of more slots [cells beyond a node]; all substeps are tried with it on a node."""
_RESOLUTION = 128
_FLOOR, _THICKNESS, _DEPTH = 0.4, 0.04, 0.4  # lower face and thickness of the floor, depth of the water [m]
_LEFT, _RIGHT = 0.2, 0.8  # walls [m]
_START, _FRAMES = 100, 40  # frames before the flow is taken, and those of the mean


def run(widths: tuple[int, ...] = WIDTHS, substeps: tuple[int | None, ...] = SUBSTEPS) -> Result:
    """Let a tank run out through slots of some widths [cells], with and without deviations that are kept."""
    checks: list[Check] = []
    curves = [Curve([0, max(widths) + 1], [share] * 2, style="--") for share in BAND]
    for colour, loss in enumerate((ADVISED_LOSS, None)):
        for count in substeps:
            shares = [discharge(width, loss, count) for width in widths]
            steps = "default" if count is None else str(count)
            kind = "APIC" if loss is None else f"loss {loss:g}/s"
            found = [(width, "", share) for width, share in zip(widths, shares, strict=True)]
            if count is None:
                place = f" {BETWEEN:g} beyond a node"
                found += [(width, place, discharge(width, loss, count, BETWEEN)) for width in widths]
            for width, place, share in found:
                name = f"discharge coefficient, {width} cells{place}, {kind}, {steps} substeps"
                judged = loss is not None and width > 1
                checks.append(
                    Check.between(name, share, BAND) if judged else Check.reported(name, share, "0.55 to 0.8")
                )
            style = "-" if count is None else "--" if count == substeps[1] else ":"
            curves.append(Curve(widths, shares, f"{kind}, {steps} substeps", colour, style))
    limits = {"ylim": (0, 1), "xlim": (0, max(widths) + 1)}
    return Result(checks, [Panel("Slot", "width [cells]", "discharge coefficient", curves, limits, 2)])


def discharge(width: int, loss: float | None, substeps: int | None, place: float = 0.0) -> float:
    """Return the flow through a slot of so many cells, over its width and the speed sqrt(2 g h) [-].

    `place` is that of its middle beyond a node [cells].
    """
    side, middle = width / _RESOLUTION / 2, 0.5 + place / _RESOLUTION
    top = _FLOOR + _THICKNESS
    scene = Scene(
        dim=2,
        resolution=_RESOLUTION,
        walls=Walls(lower=(_LEFT, 0.05), upper=(_RIGHT, 0.95)),
        bodies=[Box(material=Water(), lower=(_LEFT, top), upper=(_RIGHT, top + _DEPTH))],
        obstacles=[
            BoxObstacle(lower=(0.0, _FLOOR), upper=(middle - side, top)),
            BoxObstacle(lower=(middle + side, _FLOOR), upper=(1.0, top)),
        ],
        transfer_loss=loss,
    )
    solver = MpmSolver(scene) if substeps is None else MpmSolver(scene, substeps=substeps)

    def depth() -> float:
        return float((solver.positions[:, 1] > _FLOOR + _THICKNESS / 2).mean()) * _DEPTH

    solver.advance(_START)
    before = depth()
    solver.advance(_FRAMES)
    flow = (before - depth()) * (_RIGHT - _LEFT) / (_FRAMES * scene.frame_dt)
    return flow / (2 * side * math.sqrt(-2 * scene.gravity[1] * before))
