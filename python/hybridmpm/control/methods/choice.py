"""The methods by name, and the rule by which "auto" chooses among them."""

from hybridmpm._support.suggestions import did_you_mean
from hybridmpm.control.goal.goal import Goal
from hybridmpm.control.goal.needs import Needs
from hybridmpm.control.methods.analytic import Analytic
from hybridmpm.control.methods.backcast import Backcast
from hybridmpm.control.methods.constant import Constant
from hybridmpm.control.methods.controlnet import ControlNet
from hybridmpm.control.methods.learned.plan import Learned
from hybridmpm.control.methods.method import Method
from hybridmpm.control.methods.none import NoControl
from hybridmpm.control.methods.shooting import Shooting
from hybridmpm.errors import ConfigError

METHODS: dict[str, Method] = {
    method.name: method
    for method in (NoControl(), Constant(), Analytic(), Backcast(), Shooting(), Learned(), ControlNet())
}
"""Methods of the library by name."""

_TIGHT = 0.7
"""Share of the cap from which on a need counts as near to it."""


def chosen(method: str | Method, goal: Goal, needs: Needs, budget: float | None) -> tuple[Method, str]:
    """Return the method to use, and why.

    Parameters
    ----------
    method : str or Method
        "auto", a name of `METHODS`, or a method of one's own.
    goal : Goal
    needs : Needs
    budget : float, optional
        Time that may be spent on a search [s].

    Raises
    ------
    ConfigError
        There is no such method.
    """
    if isinstance(method, str):
        if method == "auto":
            return _by_rule(goal, needs, budget)
        if method not in METHODS:
            near = did_you_mean(method, ("auto", *METHODS))
            raise ConfigError(f"method must be auto, {', '.join(METHODS)} or a Method, got {method!r}{near}")
        return METHODS[method], "asked for"
    if not callable(getattr(method, "plan", None)):
        raise ConfigError(f"method must be a name or have the function plan, got {method!r}")
    return method, "asked for"


def _by_rule(goal: Goal, needs: Needs, budget: float | None) -> tuple[Method, str]:
    """Search only where the analytic plan may fall short, and where there is time for it."""
    tight = needs.acceleration > _TIGHT * needs.cap
    if budget is not None and (tight or goal.leads_around):
        why = f"{needs.acceleration:.1f} g come near to the cap" if tight else "obstacles are in the way"
        return METHODS["shooting"], f"{why}, and there are {budget:g} s to search in"
    return METHODS["analytic"], "guidance from the actual state takes the least force and plans at once"
