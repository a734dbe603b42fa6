"""All plots of a diagnosis's page in one still picture, for browsers without scripts."""

import base64
import math
from collections.abc import Sequence
from textwrap import fill

from ...runtime.drawing import AFTER, BEFORE, BLACK, new_figure, styled
from ...runtime.page_files import png_of
from .plot_numbers import Plot

_COLUMNS = 3
_LETTERS = 44  # in a line above a plot
_COLOURS = {"before": BEFORE, "after": AFTER, "mean": BLACK}


@styled()
def still_picture(plots: Sequence[Plot]) -> str:
    """Return the address (``data:``) of a PNG of some plots, row by row."""
    rows = math.ceil(len(plots) / _COLUMNS)
    figure = new_figure(1.9 * rows)
    for place, plot in enumerate(plots, 1):
        axes = figure.add_subplot(rows, _COLUMNS, place)
        told = filter(None, (plot.caption, plot.title, plot.readout))
        axes.set(title=fill(" ".join(told), _LETTERS), xlabel=plot.axis)
        dots = "mean" in plot.lines  # a signature is a cloud of points with its mean
        for name, (x, y) in plot.lines.items():
            style = "." if dots and name != "mean" else "-"
            axes.plot(x, y, style, color=_COLOURS[name], lw=0.7, ms=2.0, label=name)
        axes.locator_params(axis="x", nbins=5)
        if plot.packed["key"].startswith("frequency"):
            axes.set_yscale("log")
    figure.legend(*figure.axes[0].get_legend_handles_labels(), loc="outside upper right", ncols=3)
    return f"data:image/png;base64,{base64.b64encode(png_of(figure)).decode()}"
