"""The house style of pictures: one width, readable letters, and a meaning for each colour.

A page shows a picture 750 px wide, where the smallest letters, of 8 pt, are 9 px.
"""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from matplotlib.figure import Figure

WIDTH = 9.0  # in
MOST_ROWS = 12  # panels, or names, below each other
BLACK, GREY, PALE = "#222222", "#8c8c8c", "#d9d9d9"
# those of a report's page
BEFORE, AFTER, HELD_OUT = "#c95400", "#0068a8", "#e6edda"
ESTIMATE, TRUTH, JET = AFTER, GREY, "#cfe5f5"
# axes x, y, z, rotors, and whatever else stands side by side
SERIES = (AFTER, BEFORE, "#007f5f", "#8d5a97", "#c9950c", "#56b4e9")
_STYLE: dict[Any, Any] = {
    "axes.axisbelow": True,
    "axes.labelsize": 8.5,
    "axes.spines.right": False,
    "axes.spines.top": False,
    "axes.titlelocation": "left",
    "axes.titlesize": 9.0,
    "figure.constrained_layout.use": True,
    "figure.titlesize": 9.5,
    "font.size": 8.5,
    "grid.alpha": 0.3,
    "legend.edgecolor": "none",
    "legend.fontsize": 8.0,
    "legend.title_fontsize": 8.0,
    "lines.linewidth": 1.2,
    "xtick.labelsize": 8.0,
    "ytick.labelsize": 8.0,
}


@contextmanager
def styled() -> Iterator[None]:
    """Draw in the house style within; also a decorator of drawing functions."""
    # matplotlib takes half a second to import, and most of the kit never draws
    from cycler import cycler
    from matplotlib import rc_context

    with rc_context({**_STYLE, "axes.prop_cycle": cycler(color=SERIES)}):
        yield


def new_figure(height: float) -> "Figure":
    """Return an empty figure of the house's width and a height (in)."""
    from matplotlib.figure import Figure

    return Figure(figsize=(WIDTH, height))


def room_above(axes: Any, share: float = 0.25) -> None:
    """Leave a share of the height above the curves, for a legend."""
    low, high = axes.get_ylim()
    axes.set_ylim(low, high + share * (high - low))


def only_ticks(axis: Any, values: Sequence[float], **style: Any) -> None:
    """Put ticks at these values of an axis alone, with their shortest numbers."""
    axis.set_ticks(values, [f"{value:g}" for value in values], **style)
    axis.set_ticks([], minor=True)
