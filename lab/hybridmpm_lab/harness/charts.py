"""The common look of all charts."""

import re
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure
from matplotlib.rcsetup import cycler
from matplotlib.ticker import LogLocator, NullFormatter, StrMethodFormatter

from hybridmpm._support.files import replacing

COLOURS = (
    *("#1f6f9f", "#c8553d", "#3a7d44", "#8d6a9f", "#b8860b", "#5c6b73"),
    *("#d1458f", "#2a9d8f", "#7f5539"),
)
"""Colours of lines, in this order. With `MARKERS` in the same order, lines differ also in grey."""

MARKERS = ("o", "s", "^", "D", "v", "P", "X", "<", "*")

_STYLE: Any = {
    "axes.grid": True,
    "axes.spines.right": False,
    "axes.spines.top": False,
    "axes.titlesize": 11,
    "figure.constrained_layout.use": True,
    "font.sans-serif": ["DejaVu Sans"],
    "font.size": 10,
    "grid.alpha": 0.3,
    "savefig.dpi": 120,
    "svg.fonttype": "none",  # text as text: a third of the size of glyphs as outlines
    # Without a fixed salt, SVG ids would differ from run to run for the same data.
    "svg.hashsalt": "hybridmpm",
}


def panels(columns: int = 1, rows: int = 1, *, width: float = 4.5, height: float = 3.4) -> tuple[Figure, Any]:
    """Make a figure of panels of equal size, each `width` by `height` inches.

    Returns
    -------
    Figure, array of Axes
        The figure, and its axes as an array (rows, columns).
    """
    with mpl.rc_context(_STYLE | {"axes.prop_cycle": cycler(color=COLOURS)}):
        figure = Figure(figsize=(width * columns, height * rows))
        axes = figure.subplots(rows, columns, squeeze=False)
    return figure, axes


def plain_log_ticks(axis: Any) -> None:
    """Label a logarithmic axis with plain numbers, at 1, 2 and 5 of each decade, so that none overlap."""
    axis.set_major_locator(LogLocator(subs=(1, 2, 5)))
    axis.set_major_formatter(StrMethodFormatter("{x:g}"))
    axis.set_minor_formatter(NullFormatter())


def entries(axes: Any) -> dict[str, Any]:
    """Return the labelled lines of axes, one or an array, by label, each once."""
    return {
        label: handle
        for panel in np.ravel(axes)
        for handle, label in zip(*panel.get_legend_handles_labels(), strict=True)
    }


def save(figure: Figure, path: Path) -> None:
    """Write the figure in the format that the suffix of `path` names, such as .svg or .png.

    Raises
    ------
    ExportError
        A file could not be written.
    """
    legends = [*figure.legends, *(axes.get_legend() for axes in figure.axes)]
    for legend in filter(None, legends):
        legend.set_frame_on(False)
    with mpl.rc_context(_STYLE):
        # Without a date or a version the same figure has the same bytes.
        metadata = {"Date": None} if path.suffix == ".svg" else {"Software": None}
        with replacing(path) as part:
            figure.savefig(part, metadata=metadata)
            if path.suffix == ".svg":
                part.write_text(_shortened(part.read_text(encoding="utf-8")), encoding="utf-8")


def _shortened(svg: str) -> str:
    """Return an SVG without indents, numbers of groups, and digits behind a hundredth of a point."""
    rounded = re.sub(r'"[^"]*"', lambda value: re.sub(r"(\.\d\d)\d+", r"\1", value[0]), svg)
    bare = re.sub(r'(?<=<g) id="[^"]*_\d+"| transform="rotate\(-0 [^"]*"', "", rounded)
    return re.sub(r"\s*\n\s*", "\n", bare)
