"""Steering a fluid by a freehand sketch: reading sketches, and finding the force that follows a sketch.

`parse_png` and `parse_strokes` turn a sketch into an `Arrow` or an `Ellipse`; `follow` turns one of these
into a `ControlledTrajectory`.
"""

from hybridmpm.control.constant import MAX_ACCELERATION, ControlledTrajectory, follow
from hybridmpm.control.sketch.raster import parse_png
from hybridmpm.control.sketch.render import render_png
from hybridmpm.control.sketch.sketch import Arrow, Ellipse, Sketch
from hybridmpm.control.sketch.strokes import Stroke, classify_stroke, parse_strokes

__all__ = [
    "MAX_ACCELERATION",
    "Arrow",
    "ControlledTrajectory",
    "Ellipse",
    "Sketch",
    "Stroke",
    "classify_stroke",
    "follow",
    "parse_png",
    "parse_strokes",
    "render_png",
]
