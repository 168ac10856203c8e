"""Who takes part: the library's methods, the oracle, the filled sketch, and methods of others."""

import importlib
import re
from dataclasses import dataclass

from hybridmpm.control import METHODS, ControlNet, Method
from hybridmpm.errors import ConfigError

FILLED = "filled"
"""No run: the particles are where the sketch wants them, evenly placed by optimal matching."""
ORACLE = "oracle"
"""The reversed forces themselves, which no sketch tells; in the reversed family only."""
CONSTANT = "constant"
"""The paper's baseline, against which all others are held."""
NAMES = (*METHODS, ORACLE, FILLED)
"""Names of the entrants of the library."""
_FEW_STEPS = re.compile(r"controlnet-(\d{1,2})")
"""Name of `controlnet` with another number of evaluations than its own."""


@dataclass(frozen=True, eq=False)
class Entrant:
    """A column of the benchmark."""

    name: str
    method: Method | None
    """What finds the law; None for the oracle, which each case brings along, and for the filled sketch."""

    def enters(self, family: str) -> bool:
        """Tell whether the entrant takes part in a family."""
        return self.name != ORACLE or family == "reversed"


def entrant(name: str) -> Entrant:
    """Return an entrant by its name, or by `MODULE:ATTRIBUTE` for a method of one's own.

    `controlnet-4` is `controlnet` with four evaluations of its network for each frame.

    The attribute is an object with the surface of `hybridmpm.control.Method`, or a class or function that
    makes one without arguments.

    Raises
    ------
    ConfigError
        There is no such name, module or attribute, or the attribute is no method.
    """
    if name in NAMES:
        return Entrant(name, METHODS.get(name))
    if (steps := _FEW_STEPS.fullmatch(name)) is not None:
        return Entrant(name, ControlNet(steps=int(steps[1])))
    module_name, colon, attribute = name.partition(":")
    if not (colon and module_name and attribute):
        raise ConfigError(
            f"method must be one of {', '.join(NAMES)} or MODULE:ATTRIBUTE for a method of your own, "
            f"got {name!r}"
        )
    try:
        module = importlib.import_module(module_name)
    except ImportError as error:
        raise ConfigError(
            f"{name}: the module {module_name} cannot be imported ({error}); is its folder on PYTHONPATH?"
        ) from error
    if not hasattr(module, attribute):
        raise ConfigError(f"{name}: the module {module_name} has no attribute {attribute}")
    found = getattr(module, attribute)
    if not hasattr(found, "name") or isinstance(found, type):
        found = _made(name, found)
    return Entrant(_own_name(name, found), found)


def _made(name: str, maker: object) -> object:
    if not callable(maker):
        raise ConfigError(f"{name} must be a method or make one when it is called, got {maker!r}")
    try:
        return maker()
    except Exception as error:
        raise ConfigError(f"{name} could not be made without arguments: {_told(error)}") from error


def _own_name(name: str, found: object) -> str:
    own = getattr(found, "name", None)
    if not callable(getattr(found, "plan", None)) or not isinstance(own, str) or not own:
        raise ConfigError(
            f"{name} must have a text `name` and a function `plan(simulator, task)` that returns a law, as "
            f"hybridmpm.control.Method says; got {found!r}"
        )
    if own in NAMES:
        raise ConfigError(f"{name}: the name {own!r} is taken by a method of the library; choose another one")
    return own


def broken(entrant_name: str, case: str, error: Exception) -> ConfigError:
    """Return the error that tells of a method which failed by a fault of its own."""
    return ConfigError(
        f"the method {entrant_name} is broken, in {case}: {_told(error)}. plan(simulator, task) must return "
        "a law, whose force(simulator, index) returns None, (D,) or (N, D) in m/s^2"
    )


def _told(error: Exception) -> str:
    return f"{type(error).__name__}: {error}"
