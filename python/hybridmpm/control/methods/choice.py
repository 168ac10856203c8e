"""The methods by name."""

from hybridmpm._support.suggestions import did_you_mean
from hybridmpm.control.goal.goal import Goal
from hybridmpm.control.methods.analytic import Analytic
from hybridmpm.control.methods.constant import Constant
from hybridmpm.control.methods.controlnet import ControlNet
from hybridmpm.control.methods.learned.network import TransportNetwork
from hybridmpm.control.methods.learned.plan import Learned
from hybridmpm.control.methods.learned.serving import serving
from hybridmpm.control.methods.method import FallBack, Method
from hybridmpm.control.methods.none import NoControl
from hybridmpm.errors import ConfigError
from hybridmpm.scene import Scene
from hybridmpm.scene.particle_types import SAND, WATER

METHODS: dict[str, Method] = {
    method.name: method for method in (NoControl(), Constant(), Analytic(), Learned(), ControlNet())
}
"""Methods of the library by name."""


_WON = {
    2: ("water", "sand", "sand and water", "water among obstacles", "sand among obstacles"),
    3: ("water", "sand"),
}
"""Fluids over which learned plans won by dimension, for arrows and for ovals that guidance cannot fill, in
reversed cases of 50 validation seeds.

In 2D their errors over those of guidance are 0.70 to 0.80 for arrows, and 0.71 to 0.86 for such ovals. In 3D
those over the better of guidance and backcast are 0.80, 0.85, 0.81 and 0.96. The last gain is small because
that error saturates; by transport distance the ratio is 0.34. Narrower ovals are absent because guidance can
fill them."""
_FLUIDS = {WATER: "water", SAND: "sand"}


def chosen(method: str | Method, scene: Scene, goal: Goal) -> tuple[Method, str]:
    """Return the method to use for a goal in a scene, and why.

    Parameters
    ----------
    method : str or Method
        "auto", a name of `METHODS`, or a method of one's own.
    scene : Scene
    goal : Goal

    Raises
    ------
    ConfigError
        There is no such method.
    """
    if isinstance(method, str):
        if method == "auto":
            return _best(scene, goal)
        if method not in METHODS:
            near = did_you_mean(method, ("auto", *METHODS))
            raise ConfigError(f"method must be auto, {', '.join(METHODS)} or a Method, got {method!r}{near}")
        return METHODS[method], "chosen by the caller"
    if not callable(getattr(method, "plan", None)):
        raise ConfigError(f"method must be a name or have the function plan, got {method!r}")
    return method, "chosen by the caller"


def _best(scene: Scene, goal: Goal) -> tuple[Method, str]:
    """Return the learned plan for the kinds of goals on which it won, else guidance, and why."""
    fluids = sorted(_FLUIDS.get(one, "another") for one in set(goal.cloud.types.tolist()))
    kind = "wide oval" if goal.sketch.kind == "ellipse" and goal.is_torn else goal.noun
    among = " among obstacles" if scene.obstacles else ""
    has_won = " and ".join(fluids) + among in _WON[scene.dim] and kind in {"arrow", "wide oval"}
    # What goes round obstacles as a thread, or in its shape, only guidance leads there.
    if has_won and not goal.cloud.partial and not (scene.obstacles and goal.bent):
        try:
            serving(TransportNetwork, None, scene)
        except FallBack:
            pass
        else:
            why = "the learned plan led back nearer than guidance on validation seeds"
            return METHODS["learned"], f"for {kind}s in {scene.dim}D{among} {why}"
    return METHODS["analytic"], "guidance from the actual state takes the least force and plans at once"
