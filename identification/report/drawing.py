"""A still picture of a plot: lines, dots and ticks in pixels, which the page's template writes as
an SVG element. Colours are the page's CSS classes, so the picture follows the light or dark scheme.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]

WIDTH = 340  # pixels, about that of a telephone: a wider column enlarges the picture
_LEFT, _RIGHT, _TOP, _FOOT = 40, 8, 8, 16  # margins with the ticks' numbers
_FEW_DECADES = 2.0  # between an axis's ends: powers of ten are then too few to read a number off


@dataclass(frozen=True, eq=False)
class DrawnLine:
    """A series of points (n,), joined by a line or drawn as dots."""

    style: str  # CSS classes: before, after or ink, and dots
    x: Array
    y: Array


@dataclass(frozen=True)
class Drawing:
    """A plot in pixels, y downwards."""

    height: int
    left: int
    right: int
    top: int
    bottom: int
    lines: list[tuple[str, str]]  # CSS classes and path
    x_ticks: list[tuple[float, str]]  # place and text
    y_ticks: list[tuple[float, str]]
    blocks: list[tuple[float, float]]  # left edge and width
    marks: list[tuple[float, str]]  # place of a vertical line, and its text
    width: int = WIDTH


def draw(
    lines: Sequence[DrawnLine],
    height: int,
    x_range: tuple[float, float] | None = None,
    y_range: tuple[float, float] | None = None,
    logarithmic: bool = False,
    blocks: Sequence[tuple[float, float]] = (),
    marks: Sequence[tuple[float, str]] = (),
) -> Drawing:
    """Return a drawing of lines.

    Args:
        lines: what is drawn.
        height: pixels.
        x_range: of the horizontal axis; None: that of the lines.
        y_range: of the vertical axis, likewise.
        logarithmic: whether the vertical axis is.
        blocks: ranges of x that are shaded.
        marks: places in x with a vertical line, each with a text.
    """
    right, bottom = WIDTH - _RIGHT, height - _FOOT
    x_range = x_range or _range_of([line.x for line in lines])
    y_range = y_range or _range_of([line.y for line in lines])
    low = max(y_range[0], 1e-5 * y_range[1], 1e-12) if logarithmic else y_range[0]
    first, last = np.log10([low, max(y_range[1], low)]) if logarithmic else y_range
    start, width, tall = x_range[0], (x_range[1] - x_range[0]) or 1.0, (last - first) or 1.0

    def across(x: ArrayLike) -> Array:
        return np.round(_LEFT + (np.asarray(x) - start) / width * (right - _LEFT), 1)

    def down(y: ArrayLike) -> Array:
        level = np.log10(np.maximum(y, low)) if logarithmic else np.asarray(y)
        return np.round(bottom - (level - first) / tall * (bottom - _TOP), 1)

    def path(line: DrawnLine) -> str:
        points = list(zip(across(line.x).tolist(), down(line.y).tolist(), strict=True))
        if "dots" in line.style:
            return "".join(f"M{x:g} {y:g}h0" for x, y in points)
        return "M" + "L".join(f"{x:g} {y:g}" for x, y in points) if points else ""

    return Drawing(
        height,
        _LEFT,
        right,
        _TOP,
        bottom,
        [(line.style, path(line)) for line in lines],
        _ticks(x_range[0], x_range[1], False, across),
        _ticks(low, y_range[1], logarithmic, down),
        [(float(across(a)), float(across(b) - across(a))) for a, b in np.reshape(blocks, (-1, 2))],
        [(float(across(x)), text) for x, text in marks],
    )


def _range_of(series: Sequence[Array]) -> tuple[float, float]:
    every = np.concatenate(series)
    edge = 0.03 * float(np.ptp(every)) if len(every) else 0.0
    return (float(every.min()) - edge, float(every.max()) + edge) if len(every) else (0.0, 1.0)


def _ticks(
    low: float, high: float, logarithmic: bool, place: Callable[[ArrayLike], Array]
) -> list[tuple[float, str]]:
    """Return places and texts of round numbers from ``low`` to ``high``."""
    from matplotlib.ticker import LogLocator, MaxNLocator  # takes a third of a second

    few = logarithmic and high < 10.0**_FEW_DECADES * low
    locator = (
        LogLocator(subs=(1.0, 2.0, 5.0) if few else (1.0,))
        if logarithmic
        else MaxNLocator(6, steps=[1, 2, 5, 10])
    )
    slack = 1e-6 * (high - low)
    inside = [v for v in locator.tick_values(low, high) if low - slack <= v <= high + slack]
    return [(float(place(v)), f"{float(f'{v:.9g}'):g}".replace("-", "−")) for v in inside]
