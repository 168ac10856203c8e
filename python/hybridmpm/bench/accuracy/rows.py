"""Fields of rows that several benches of errors share."""

from collections.abc import Mapping
from typing import Any

from hybridmpm.bench.accuracy.latency import Latency
from hybridmpm.bench.accuracy.rollouts import AT, MEASURES
from hybridmpm.metrics import ErrorTable

Fields = dict[str, float | None]


def latency_fields(latency: Latency | None) -> Fields:
    """`ms_per_frame`, `ms_p95` and `ms_per_call` [ms]."""
    if latency is None:
        return dict.fromkeys(("ms_per_frame", "ms_p95", "ms_per_call"))
    return {
        "ms_per_frame": _rounded(latency.median),
        "ms_p95": _rounded(latency.p95),
        "ms_per_call": _rounded(latency.per_call),
    }


def measure_fields(entry: Mapping[str, Any]) -> Fields:
    """Means and standard errors of a row of an `ErrorTable`; None where it has none."""
    names = (field for measure in MEASURES for field in (measure, f"{measure}_se"))
    return {name: _rounded(entry.get(name)) for name in names}


def zero_fields(table: ErrorTable, name: str | None, rival: str | None) -> Fields:
    """Tell what a method does without of the zero network's error.

    Parameters
    ----------
    table : ErrorTable
    name, rival : str, optional
        Of the method and of its zero network; all fields are None without them.

    Returns
    -------
    dict
        `below_zero_40`, the part of the zero network's mean error, and `minus_zero_40`, the mean difference
        on the same scenes, with its standard error; and so on.
    """
    fields: Fields = {}
    for frame in AT:
        measure, apart, share = f"error_{frame}", None, None
        if name and rival and measure in table.measures:
            apart = table.difference(name, rival, measure)
            share = -apart.mean / table.estimate(rival, measure).mean
        fields[f"below_zero_{frame}"] = _rounded(share)
        fields[f"minus_zero_{frame}"] = _rounded(apart.mean if apart else None)
        fields[f"minus_zero_{frame}_se"] = _rounded(apart.standard_error if apart else None)
    return fields


def _rounded(value: float | None) -> float | None:
    return None if value is None else float(f"{value:.4g}")
