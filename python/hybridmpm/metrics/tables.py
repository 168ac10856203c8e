"""Means and standard errors over scenes, and paired differences over scenes that two methods share."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from hybridmpm._support.arguments import float64
from hybridmpm.errors import ConfigError


@dataclass(frozen=True, kw_only=True)
class Estimate:
    """A mean over samples and its standard error, in the unit of the samples."""

    mean: float
    standard_error: float | None
    """Sample standard deviation over sqrt(count); None for a single sample."""
    count: int
    """Number of samples."""

    @classmethod
    def of(cls, samples: Sequence[float]) -> "Estimate":
        """Estimate the mean of samples; raises `ConfigError` where there are none or one is not finite."""
        values = float64("samples", samples)
        if values.ndim != 1 or len(values) == 0 or not np.isfinite(values).all():
            raise ConfigError("samples must be one or more finite numbers")
        error = float(values.std(ddof=1) / np.sqrt(len(values))) if len(values) > 1 else None
        return cls(mean=float(values.mean()), standard_error=error, count=len(values))

    def __str__(self) -> str:
        spread = "" if self.standard_error is None else f" ± {self.standard_error:.2g}"
        return f"{self.mean:.3g}{spread}"


@dataclass
class ErrorTable:
    """Errors of several methods on scenes that they may share.

    A row is a method, a column is a measure. `add` the errors of one scene after the other; then `rows` gives
    the table for a file, `text` for a screen.
    """

    _samples: dict[str, dict[str, dict[str, float]]] = field(default_factory=dict, repr=False)
    """Errors by method, measure and scene."""

    def add(self, method: str, scene: str, errors: Mapping[str, float]) -> None:
        """Add the errors of a method in a scene, by measure.

        Raises
        ------
        ConfigError
            The table already has the error of this method, measure and scene, or an error is not finite.
        """
        columns = self._samples.setdefault(method, {})
        for measure, error in errors.items():
            if not np.isfinite(error):
                raise ConfigError(f"{measure} of {method} in {scene} must be finite, got {error}")
            if scene in columns.setdefault(measure, {}):
                raise ConfigError(f"the table has {measure} of {method} in {scene} already")
            columns[measure][scene] = float(error)

    @property
    def methods(self) -> list[str]:
        """Methods in the order of their first entry."""
        return list(self._samples)

    @property
    def measures(self) -> list[str]:
        """Measures in the order of their first entry."""
        return list(dict.fromkeys(measure for columns in self._samples.values() for measure in columns))

    def estimate(self, method: str, measure: str) -> Estimate:
        """Return the mean error of a method over its scenes; raises `ConfigError` where there is no entry."""
        return Estimate.of(list(self._entry(method, measure).values()))

    def difference(self, method: str, reference: str, measure: str) -> Estimate:
        """Return the mean of the method's error minus the reference's, over the scenes that both have.

        Raises
        ------
        ConfigError
            The methods share no scene, or one of them has no such measure.
        """
        mine, theirs = self._entry(method, measure), self._entry(reference, measure)
        shared = [scene for scene in mine if scene in theirs]
        if not shared:
            raise ConfigError(f"{method} and {reference} share no scene of {measure}")
        return Estimate.of([mine[scene] - theirs[scene] for scene in shared])

    def rows(self, reference: str | None = None) -> list[dict[str, Any]]:
        """Return a flat dictionary for each method.

        Each measure fills the keys `MEASURE` (mean), `MEASURE_se` (standard error) and `MEASURE_n` (number of
        scenes). With a `reference` it also fills `MEASURE_difference` and `MEASURE_difference_se`, which are
        None for the reference itself.
        """
        rows = []
        for method, columns in self._samples.items():
            row: dict[str, Any] = {"method": method}
            for measure in columns:
                mean = self.estimate(method, measure)
                row |= {measure: mean.mean, f"{measure}_se": mean.standard_error, f"{measure}_n": mean.count}
                if reference is not None:
                    apart = None if method == reference else self.difference(method, reference, measure)
                    row[f"{measure}_difference"] = apart and apart.mean
                    row[f"{measure}_difference_se"] = apart and apart.standard_error
            rows.append(row)
        return rows

    def text(self) -> str:
        """Return the means and standard errors as text, one line for each method."""
        head = ["method", *self.measures]
        lines = [
            [method, *(str(self.estimate(method, m)) if m in columns else "-" for m in self.measures)]
            for method, columns in self._samples.items()
        ]
        widths = [max(map(len, column)) for column in zip(head, *lines, strict=True)]
        return "\n".join(
            "  ".join(cell.rjust(width) for cell, width in zip(line, widths, strict=True))
            for line in [head, *lines]
        )

    def _entry(self, method: str, measure: str) -> dict[str, float]:
        try:
            return self._samples[method][measure]
        except KeyError:
            raise ConfigError(f"the table has no {measure} of {method}") from None
