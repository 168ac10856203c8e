"""`rank_correlations`: whether a value goes with an error, and whether it does so apart from time."""

import numpy as np
import numpy.typing as npt

_LINEAR = 1e-9
"""Deviation of ranks from a line over their number, below which it is rounding."""
_FEWEST = 3
"""Number of points below which every point lies on a line."""

_Doubles = npt.NDArray[np.float64]


def rank_correlations(frame: _Doubles, value: _Doubles, error: _Doubles) -> tuple[float | None, float | None]:
    """Return Spearman's correlation of value and error, and the partial one given the frame.

    Errors grow with time, and so do some values. The partial correlation is that of the ranks after their
    regression on the rank of the frame has been subtracted. It is None where a rank follows from that of the
    frame, and both are None with less than three points or where value or error is constant.

    Parameters
    ----------
    frame, value, error : float64 (K,)
    """
    from scipy.stats import rankdata  # noqa: PLC0415 - an extra

    if len(frame) < _FEWEST or min(np.ptp(value), np.ptp(error)) == 0:
        return None, None
    rank = {name: rankdata(of) for name, of in (("frame", frame), ("value", value), ("error", error))}
    whole = float(np.corrcoef(rank["value"], rank["error"])[0, 1])
    times = np.stack((np.ones(len(frame)), rank["frame"]), axis=1)
    rest = [rank[of] - times @ np.linalg.lstsq(times, rank[of], rcond=None)[0] for of in ("value", "error")]
    if min(np.std(of) for of in rest) < _LINEAR * len(frame):
        return round(whole, 4), None
    return round(whole, 4), round(float(np.corrcoef(rest)[0, 1]), 4)
