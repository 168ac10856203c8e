"""The methods by name."""

from hybridmpm._support.suggestions import did_you_mean
from hybridmpm.control.methods.analytic import Analytic
from hybridmpm.control.methods.constant import Constant
from hybridmpm.control.methods.controlnet import ControlNet
from hybridmpm.control.methods.learned.plan import Learned
from hybridmpm.control.methods.method import Method
from hybridmpm.control.methods.none import NoControl
from hybridmpm.errors import ConfigError

METHODS: dict[str, Method] = {
    method.name: method for method in (NoControl(), Constant(), Analytic(), Learned(), ControlNet())
}
"""Methods of the library by name."""


def chosen(method: str | Method) -> tuple[Method, str]:
    """Return the method to use, and why.

    Parameters
    ----------
    method : str or Method
        "auto", a name of `METHODS`, or a method of one's own.

    Raises
    ------
    ConfigError
        There is no such method.
    """
    if isinstance(method, str):
        if method == "auto":
            return METHODS[
                "analytic"
            ], "guidance from the actual state takes the least force and plans at once"
        if method not in METHODS:
            near = did_you_mean(method, ("auto", *METHODS))
            raise ConfigError(f"method must be auto, {', '.join(METHODS)} or a Method, got {method!r}{near}")
        return METHODS[method], "chosen by the caller"
    if not callable(getattr(method, "plan", None)):
        raise ConfigError(f"method must be a name or have the function plan, got {method!r}")
    return method, "chosen by the caller"
