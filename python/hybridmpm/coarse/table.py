"""The table of fitted coarse levels that comes with the library; `python -m hybridmpm_lab fit` writes it."""

from functools import cache
from pathlib import Path
from typing import Annotated, Literal

from pydantic import Field, ValidationError

from hybridmpm.errors import DataError
from hybridmpm.scene.fields import Range, Record

FILE = Path(__file__).with_name("levels.json")

_Positive = Annotated[float, Range(0, 1e9, open_low=True)]


class HeldOut(Record):
    """Errors of a coarse level on scenes that it was not fitted to; means with their standard errors."""

    scenario: str
    first_seed: int = Field(description="Seed of the first scene; the others follow.")
    scenes: int = Field(description="Number of scenes.")
    error: float = Field(description="grid_rmse, mean of 20 states in the 200 frames after the first impact.")
    error_se: float
    unfitted: float = Field(description="The same error with the constants of MpmSolver(r_p, show_all=True).")
    fitted_minus_unfitted_se: float = Field(description="Standard error of the paired difference.")
    transport: float = Field(description="Sliced Wasserstein distance [m], mean of frames 100 and 200.")
    transport_few: float = Field(description="The same of the coarse particles, by MpmSolver(r_p).")
    density: float = Field(
        description="99th percentile of the density at shown particles over that at rest, largest of the "
        "scenes."
    )
    substeps: float = Field(description="Substeps of a frame.")
    redone: int = Field(description="Frames that had to be done again at the safe step.")


class FittedLevel(Record):
    """Constants of a coarse level for a material in a dimension, with the search and held-out errors."""

    material: Literal["water", "sand"]
    dim: Literal[2, 3]
    name: str = Field(description="Name of the level, its r_p as a fraction.")
    r_p: Annotated[float, Range(0, 1, open_low=True)]
    particles_per_cell: _Positive = Field(description="Merged particles in a cell of the coarse grid.")
    modulus: Annotated[float, Range(0, 1, open_low=True)] = Field(
        description="Factor on the elastic moduli, before depth requires more."
    )
    cfl: Annotated[float, Range(0, 1, open_low=True)]
    affine_share: Annotated[float, Range(0, 1)]
    relaxation: Annotated[float, Range(0, 8, "cells")]
    seeds: tuple[int, ...] = Field(description="Seeds of the training scenes.")
    trials: int = Field(description="Number of settings that the latest search tried.")
    fastest: _Positive = Field(description="Largest speed of an impact in the scenario [m/s].")
    held_out: tuple[HeldOut, ...]


class CoarseTable(Record):
    """All fitted levels, and the version of the solver that they were fitted to."""

    solver_version: int
    price: _Positive = Field(
        description="Exponent p of the objective, error * time^p: half the time is worth an error larger by "
        "a factor of 2^p."
    )
    largest_compression: Annotated[float, Range(0, 1, open_low=True)] = Field(
        description="Compression of matter at rest [-] up to which moduli are lowered."
    )
    entries: tuple[FittedLevel, ...]

    def find(self, material: str, dim: int, name: str) -> FittedLevel | None:
        """Return the entry of a material in a dimension; None without a fit."""
        of_name = (one for one in self.entries if one.name == name)
        return next((one for one in of_name if (one.material, one.dim) == (material, dim)), None)

    @property
    def ratios(self) -> dict[str, float]:
        """Ratios r_p of the coarse levels by name, ascending."""
        found = {one.name: one.r_p for one in self.entries}
        return dict(sorted(found.items(), key=lambda item: item[1]))


@cache
def coarse_table(path: Path = FILE) -> CoarseTable:
    """Read the table of fitted levels.

    Raises
    ------
    DataError
        The file is missing or damaged; the message names it.
    """
    try:
        return CoarseTable.model_validate_json(path.read_text(encoding="utf-8"))
    except (OSError, ValidationError) as error:
        text = " ".join(str(error).split())
        raise DataError(f"{path} is missing or damaged: {text}; install the library anew") from None
