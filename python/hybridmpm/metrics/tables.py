"""Mean and standard error over scenes, and paired differences where methods share them."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from hybridmpm.errors import ConfigError


@dataclass(frozen=True, kw_only=True)
class Estimate:
    """A mean over `count` samples and its standard error, in the unit of the samples."""

    mean: float
    standard_error: float | None
    """Sample standard deviation over sqrt(count); None of a single sample, which has none."""
    count: int

    @classmethod
    def of(cls, samples: Sequence[float]) -> "Estimate":
        """Estimate from samples; raises `ConfigError` where there are none or one is not finite."""
        values = np.asarray(samples, dtype=np.float64)
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

    A row is a method, a column a measure. `add` the errors of one scene after the other, then take `rows` for
    files or `text` for a screen.
    """

    _samples: dict[str, dict[str, dict[str, float]]] = field(default_factory=dict, repr=False)
    """By method, measure and scene."""

    def add(self, method: str, scene: str, errors: Mapping[str, float]) -> None:
        """Enter the errors of a method in a scene, by measure.

        Raises
        ------
        ConfigError
            The table has this scene of this method and measure, or an error is not finite.
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
        """In the order of their first entry."""
        return list(self._samples)

    @property
    def measures(self) -> list[str]:
        """In the order of their first entry."""
        return list(dict.fromkeys(measure for columns in self._samples.values() for measure in columns))

    def estimate(self, method: str, measure: str) -> Estimate:
        """Mean over the method's scenes; raises `ConfigError` where it has no such entry."""
        return Estimate.of(list(self._entry(method, measure).values()))

    def difference(self, method: str, reference: str, measure: str) -> Estimate:
        """Mean over the scenes that both have, of the method's error minus the reference's.

        Raises
        ------
        ConfigError
            They share no scene, or have no such measure.
        """
        mine, theirs = self._entry(method, measure), self._entry(reference, measure)
        shared = [scene for scene in mine if scene in theirs]
        if not shared:
            raise ConfigError(f"{method} and {reference} share no scene of {measure}")
        return Estimate.of([mine[scene] - theirs[scene] for scene in shared])

    def rows(self, reference: str | None = None) -> list[dict[str, Any]]:
        """One flat object a method.

        Each measure fills the fields `MEASURE`, `MEASURE_se` and `MEASURE_n`; with a `reference` also
        `MEASURE_difference` and `MEASURE_difference_se`, None for the reference itself.
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
        """Lay out the means and standard errors, one method a line."""
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
