"""Calibrations: the one of the library, and the times of this machine in a file of the user."""

import os
import warnings
from functools import cache
from pathlib import Path
from typing import TypeVar

from pydantic import BaseModel, ValidationError

from hybridmpm import _core
from hybridmpm._support.machine import cpu_model
from hybridmpm.errors import DataError
from hybridmpm.planner.calibration import VERSION, Calibration, MachineTimes
from hybridmpm.scene.plain_data import from_json

SHIPPED = Path(__file__).with_name("calibration.json")
_VARIABLE = "HYBRIDMPM_CALIBRATION"


class CalibrationWarning(UserWarning):
    """The user's calibration is damaged or does not fit, so the times of the library are used.

    Plans are made, but their times are those of another machine.
    """


_Read = TypeVar("_Read", bound=BaseModel)


def user_file() -> Path:
    """Return the file of this user's times: HYBRIDMPM_CALIBRATION, or one in the user's folder of caches."""
    named = os.environ.get(_VARIABLE)
    if named:
        return Path(named)
    cache_home = os.environ.get("XDG_CACHE_HOME") or "~/.cache"
    return Path(cache_home).expanduser() / "hybridmpm" / "calibration.json"


@cache
def shipped() -> Calibration:
    """Read the calibration that comes with the library.

    Raises
    ------
    DataError
        The file is missing or damaged; the message names it.
    """
    return _read(SHIPPED, Calibration, "install the library anew")


def read_times(path: Path) -> MachineTimes:
    """Read a file that `hybridmpm calibrate` wrote.

    Raises
    ------
    DataError
        The file is missing, damaged, incomplete, of another version, machine or solver; the message says
        which, and what to do.
    """
    remedy = f"make it anew by: hybridmpm calibrate --out {path}"
    times = _read(path, MachineTimes, remedy)
    there = {"version": times.version, "solver version": times.solver_version, "machine": times.machine}
    here = {"version": VERSION, "solver version": _core.SOLVER_VERSION, "machine": cpu_model()}
    for name, value in here.items():
        if there[name] != value:
            raise DataError(
                f"calibration {path} was made for {name} {there[name]}, this machine has {value}; {remedy}"
            )
    there_are = {(one.material, one.dim) for one in times.materials}
    lacking = [
        f"{kind} in {dim}D" for dim in (2, 3) for kind in ("water", "sand") if (kind, dim) not in there_are
    ]
    if lacking:
        raise DataError(f"{path} is incomplete: it lacks {', '.join(lacking)}; {remedy}")
    return times


def present(path: Path | None = None) -> tuple[Calibration, str]:
    """Return the calibration for plans, and a sentence on the origin of its times.

    Parameters
    ----------
    path : Path, optional
        File of times; if absent, the user's file where it exists and fits, else the library's times.

    Raises
    ------
    DataError
        The file named is missing, damaged, or of another machine or solver.

    Warns
    -----
    CalibrationWarning
        The user's file is damaged or does not fit; the times of the library are used.
    """
    base = shipped()
    if path is not None:
        return base.model_copy(update={"times": read_times(path)}), f"times of {path}"
    mine = user_file()
    if mine.exists():
        try:
            return base.model_copy(update={"times": read_times(mine)}), f"times of {mine}"
        except DataError as error:
            warnings.warn(
                f"{error}; until then plans use the times of the library",
                CalibrationWarning,
                stacklevel=4,
            )
    if base.times.machine == cpu_model():
        return base, f"times of the library, from the same processor ({base.times.machine})"
    return base, (
        f"times of the library, from another processor ({base.times.machine}): "
        "`hybridmpm calibrate` measures those of this one"
    )


def _read(path: Path, kind: type[_Read], remedy: str) -> _Read:
    try:
        return kind.model_validate(from_json(path.read_bytes()))
    except (OSError, ValueError, ValidationError) as error:
        text = " ".join(str(error).split())
        raise DataError(f"{path} is missing or damaged: {text[:300]}; {remedy}") from None
