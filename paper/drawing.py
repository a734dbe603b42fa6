"""The style that all figures share, and parts that several figures draw."""

from collections.abc import Sequence
from typing import Any

import matplotlib

COLOURS = ("#d1495b", "#30638e", "#edae49", "#2a9d8f", "#8d5a97")
BLACK, GREY = "#222222", "#9a9a9a"
# a decorator of what draws a figure
styled = matplotlib.rc_context(
    {
        "axes.spines.right": False,
        "axes.spines.top": False,
        "axes.titlelocation": "left",
        "axes.titlesize": 10,
        "figure.constrained_layout.use": True,
        "figure.constrained_layout.w_pad": 0.08,
        "figure.titlesize": 11,
        "legend.fontsize": 8,
        "legend.frameon": False,
        "legend.title_fontsize": 8,
    }
)


def only_ticks(axis: Any, values: Sequence[float], **style: Any) -> None:
    """Put ticks at these values of an axis alone, with their shortest numbers."""
    axis.set_ticks(values, [f"{value:g}" for value in values], **style)
    axis.set_ticks([], minor=True)
