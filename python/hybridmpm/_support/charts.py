"""One look for all charts; matplotlib is needed only here and only when a chart is drawn."""

from pathlib import Path
from typing import TYPE_CHECKING, Any

from hybridmpm._support.files import replacing
from hybridmpm.errors import ConfigError

if TYPE_CHECKING:
    from matplotlib.figure import Figure

COLOURS = ("#1f6f9f", "#c8553d", "#3a7d44", "#8d6a9f", "#b8860b", "#5c6b73")
"""Lines in this order; told apart also in grey and by the colour-blind, with the marker of the same index."""

MARKERS = ("o", "s", "^", "D", "v", "P")

_STYLE: Any = {
    "axes.grid": True,
    "axes.spines.right": False,
    "axes.spines.top": False,
    "axes.titlesize": 11,
    "figure.constrained_layout.use": True,
    "font.size": 10,
    "grid.alpha": 0.3,
    "savefig.dpi": 120,
    # The same data give the same file.
    "svg.hashsalt": "hybridmpm",
}


def panels(
    columns: int = 1, rows: int = 1, *, width: float = 4.5, height: float = 3.4
) -> "tuple[Figure, Any]":
    """Make a figure of equal panels, each `width` by `height` inches.

    Returns
    -------
    Figure, and its axes as an array (rows, columns).

    Raises
    ------
    ConfigError
        matplotlib is not installed.
    """
    try:
        import matplotlib as mpl  # noqa: PLC0415 - an extra
        from cycler import cycler  # noqa: PLC0415
        from matplotlib.figure import Figure  # noqa: PLC0415
    except ImportError:
        raise ConfigError("charts need matplotlib: pip install 'hybridmpm[bench]'") from None
    with mpl.rc_context(_STYLE | {"axes.prop_cycle": cycler(color=COLOURS)}):
        figure = Figure(figsize=(width * columns, height * rows))
        axes = figure.subplots(rows, columns, squeeze=False)
    return figure, axes


def plain_log_ticks(axis: Any) -> None:
    """Label a logarithmic axis at 1, 2 and 5 of each decade with plain numbers, which stay apart."""
    from matplotlib.ticker import LogLocator, NullFormatter, StrMethodFormatter  # noqa: PLC0415 - an extra

    axis.set_major_locator(LogLocator(subs=(1, 2, 5)))
    axis.set_major_formatter(StrMethodFormatter("{x:g}"))
    axis.set_minor_formatter(NullFormatter())


def save(figure: "Figure", path: Path) -> None:
    """Write the figure as SVG and as PNG; the suffix of `path` is replaced by theirs.

    Raises
    ------
    ExportError
        A file could not be written.
    """
    import matplotlib as mpl  # noqa: PLC0415 - an extra

    legends = [*figure.legends, *(axes.get_legend() for axes in figure.axes)]
    for legend in filter(None, legends):
        legend.set_frame_on(False)
    with mpl.rc_context(_STYLE):
        for suffix, metadata in ((".svg", {"Date": None}), (".png", {"Software": None})):
            with replacing(path.with_suffix(suffix)) as part:
                figure.savefig(part, metadata=metadata)
