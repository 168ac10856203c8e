"""Calibration of plans: errors of each candidate, and times of the machine; checked records in JSON."""

from typing import Annotated, Literal

from pydantic import Field

from hybridmpm.scene.fields import Range, Record

VERSION = 1
"""Version of the format of calibration files."""

_Figure = Annotated[float, Range(0, 1e9)]
_Whole = Annotated[int, Field(ge=0)]

MEASURES = {
    "grid_rmse": "error",
    "grid_nrmse": "grid_nrmse",
    "grid_node_error": "grid_node_error",
    "transport": "transport",
    "kinetic_energy": "kinetic_energy",
    "centroid": "centroid",
}
"""Measures of the error, and their fields in the rows of `python -m hybridmpm_lab tradeoff`."""


class MethodErrors(Record):
    """Errors of a candidate in scenes of a scenario, counted over 200 frames from the first impact on."""

    scenario: str
    name: str = Field(description="Name of the candidate, or 'jitter': the truth against other jitter.")
    scenes: _Whole = Field(description="Number of scenes.")
    means: dict[str, _Figure] = Field(description="Mean error by measure.")
    standard_errors: dict[str, _Figure] = Field(description="Their standard errors.")


class MaterialTimes(Record):
    """Time of MPM for one material in one dimension, on one thread.

    A frame of n particles that fill c cells of the grid, with k obstacles, takes in s substeps
    s (substep + obstacle_substep k + particle_substep n + obstacle_particle_substep k n + cell_substep c)
    + frame + particle n. Showing all N particles adds upsample + upsample_coarse n + upsample_shown N
    + upsample_obstacle k N, for each frame shown.
    """

    material: Literal["water", "sand"]
    dim: Literal[2, 3]
    substep: _Figure = Field(description="[us]")
    particle_substep: _Figure = Field(description="[us]")
    cell_substep: _Figure = Field(description="[us]")
    obstacle_substep: _Figure = Field(description="[us]")
    obstacle_particle_substep: _Figure = Field(description="[us]")
    frame: _Figure = Field(description="[us]")
    particle: _Figure = Field(description="[us]")
    upsample: _Figure = Field(description="[us]")
    upsample_coarse: _Figure = Field(description="[us]")
    upsample_shown: _Figure = Field(description="[us]")
    upsample_obstacle: _Figure = Field(description="[us]")
    speed: Annotated[float, Range(0, 100, open_low=True)] = Field(
        description="Largest speed of particles in mid-splash over that of matter that falls onto the floor."
    )


class NetworkTimes(Record):
    """Time of a network on one thread: a frame of n particles takes frame + particle n."""

    model: str
    dim: Literal[2, 3]
    frame: _Figure = Field(description="[us]")
    particle: _Figure = Field(description="[us]")


class Ratio(Record):
    """Time of a candidate over that of another one."""

    material: Literal["water", "sand"]
    dim: Literal[2, 3]
    name: str
    base: str
    ratio: Annotated[float, Range(0, 1e6, open_low=True)]


class MachineTimes(Record):
    """Time of a machine for each kind of work."""

    version: int
    solver_version: int
    machine: str = Field(description="Model of the processor.")
    date: str
    materials: tuple[MaterialTimes, ...]
    networks: tuple[NetworkTimes, ...]
    ratios: tuple[Ratio, ...]


class Calibration(Record):
    """Errors, which do not depend on the machine, and times, which do."""

    version: int
    solver_version: int
    commit: str | None = Field(description="Commit on which the errors were measured.")
    errors: tuple[MethodErrors, ...]
    deviations: dict[str, _Figure] = Field(
        description="By measure: the error stays below its mean and so many of its standard deviations over "
        "the scenes in 90 % of other scenes."
    )
    times: MachineTimes
