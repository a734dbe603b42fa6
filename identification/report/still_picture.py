"""All plots of a diagnosis's page in one still picture, for browsers that run no scripts."""

import base64
import math
from collections.abc import Sequence

from ...runtime.page_files import png_of
from .plot_numbers import Plot

_COLUMNS = 3
_COLOURS = {"before": "#b4512b", "after": "#1d6fa5", "mean": "#202020"}


def still_picture(plots: Sequence[Plot]) -> str:
    """Return the address (``data:``) of a PNG of some plots, those of one row side by side."""
    from matplotlib.figure import Figure

    rows = math.ceil(len(plots) / _COLUMNS)
    figure = Figure(figsize=(10.0, 2.1 * rows), layout="constrained")
    for place, plot in enumerate(plots, 1):
        axes = figure.add_subplot(rows, _COLUMNS, place)
        axes.set_title(" ".join(filter(None, (plot.caption, plot.title, plot.readout))), fontsize=8)
        axes.set_xlabel(plot.axis, fontsize=7)
        axes.tick_params(labelsize=7)
        dots = "mean" in plot.lines  # a signature is a cloud of points with its mean
        for name, (x, y) in plot.lines.items():
            style = "." if dots and name != "mean" else "-"
            axes.plot(x, y, style, color=_COLOURS[name], linewidth=0.7, markersize=2.0)
        if plot.packed["key"].startswith("frequency"):
            axes.set_yscale("log")
    return f"data:image/png;base64,{base64.b64encode(png_of(figure)).decode()}"
