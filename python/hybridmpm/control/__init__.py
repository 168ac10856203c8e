"""Steering a fluid by a freehand sketch, and by hand.

`parse_png` and `parse_strokes` turn a sketch into an `Arrow` or an `Ellipse`. A `Shape` is any closed
outline, which `shape_of_text`, `shape_of_picture` and `shape_of_path` make, and a `Solid` any closed surface
in 3D. `prepare` returns the effort of following one, and `prepare_keyframes` that of several in turn.
`follow` lets a simulator follow them, frame by frame. `push` is a local force, `pull` holds a rigid body.
`reversed_case` makes an example of control whose true end is known, and `Oracle` follows it by the forces
that lead there.
"""

from hybridmpm.control.follow import ControlledFrame, Following, follow, resume
from hybridmpm.control.goal.goal import Goal, Needs, Obstruction
from hybridmpm.control.goal.region import Figure, Fill, Oval, Silhouette
from hybridmpm.control.goal.who import Who
from hybridmpm.control.guidance import DEFAULT_CAP, MAX_CAP, Guidance, SketchOptions, prepare
from hybridmpm.control.keyframes import (
    MAX_KEYFRAMES,
    Keyframe,
    Led,
    Leg,
    Sequence,
    plan_motion,
    prepare_keyframes,
    restored,
)
from hybridmpm.control.laws import Law
from hybridmpm.control.methods.choice import METHODS
from hybridmpm.control.methods.controlnet import ControlNet
from hybridmpm.control.methods.learned.plan import Learned
from hybridmpm.control.methods.method import FallBack, Method, Task
from hybridmpm.control.methods.oracle import Oracle
from hybridmpm.control.pull import Pull, pull
from hybridmpm.control.push import Push, push
from hybridmpm.control.reversal import ReversedCase, reversed_case, reversed_from_seed
from hybridmpm.control.sketch.raster import parse_png
from hybridmpm.control.sketch.render import render_png
from hybridmpm.control.sketch.sketch import (
    MAX_OUTLINES,
    MAX_POINTS,
    Arrow,
    Ellipse,
    Shape,
    Sketch,
    StrokeSketch,
    check_in_world,
)
from hybridmpm.control.sketch.solid import Solid
from hybridmpm.control.sketch.strokes import Stroke, classify_stroke, parse_strokes
from hybridmpm.control.sketch.tracing import shape_of_path, shape_of_picture, shape_of_text
from hybridmpm.control.trajectory import ControlledTrajectory, SketchResult
from hybridmpm.scene.meshes import MAX_TRIANGLES

__all__ = [
    "DEFAULT_CAP",
    "MAX_CAP",
    "MAX_KEYFRAMES",
    "MAX_OUTLINES",
    "MAX_POINTS",
    "MAX_TRIANGLES",
    "METHODS",
    "Arrow",
    "ControlNet",
    "ControlledFrame",
    "ControlledTrajectory",
    "Ellipse",
    "FallBack",
    "Figure",
    "Fill",
    "Following",
    "Goal",
    "Guidance",
    "Keyframe",
    "Law",
    "Learned",
    "Led",
    "Leg",
    "Method",
    "Needs",
    "Obstruction",
    "Oracle",
    "Oval",
    "Pull",
    "Push",
    "ReversedCase",
    "Sequence",
    "Shape",
    "Silhouette",
    "Sketch",
    "SketchOptions",
    "SketchResult",
    "Solid",
    "Stroke",
    "StrokeSketch",
    "Task",
    "Who",
    "check_in_world",
    "classify_stroke",
    "follow",
    "parse_png",
    "parse_strokes",
    "plan_motion",
    "prepare",
    "prepare_keyframes",
    "pull",
    "push",
    "render_png",
    "restored",
    "resume",
    "reversed_case",
    "reversed_from_seed",
    "shape_of_path",
    "shape_of_picture",
    "shape_of_text",
]
