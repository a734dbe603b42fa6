"""The picture of Fig. 5: estimates over time as in the paper, and who errs how
much less than whom.
"""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure, SubFigure

from ..envs.plant import TICK
from ..runtime.drawing import ESTIMATE, HELD_OUT, SERIES, new_figure, only_ticks, styled
from .fig5_estimators import ERRORS
from .fig5_flights import FLIGHTS, NOISES, Array

_NOISE_COLOURS = {"low": SERIES[0], "high": SERIES[1]}
_MARKERS = {"hover": "o", "yawing": "^"}
_LINES = {
    "observer low": (SERIES[1], "observer, tuned at low noise"),
    "observer anew": (SERIES[4], "observer, re-tuned"),
    "UKF low": (ESTIMATE, "UKF, tuned at low noise"),
}
_PLANT_TITLES = {"exact": "exact plant", "disturbed": "standard plant (unmodelled disturbance)"}


@styled()
def draw(
    ratios: Mapping[tuple[str, str, str, str, str], tuple[float, float, float]],
    labels: Sequence[str],
    truth: Array,
    examples: Mapping[tuple[str, str], Array],
    seeds: int,
) -> Figure:
    """Return the picture.

    Args:
        ratios: (plant, flight, noise, pair, error) -> ratio and its 95 % interval.
        labels: of the pairs, top to bottom.
        truth: (n, 6) wrench of the example flight, N and Nm.
        examples: (noise, estimator) -> states (n, 20) of the example flight.
        seeds: that the ratios are over.
    """
    figure = new_figure(10.5)
    parts: Any = figure.subfigures(3, 1)
    top, middle, bottom = parts
    _draw_examples(top, truth, examples)
    for part, plant in ((middle, "disturbed"), (bottom, "exact")):
        _draw_ratios(part, plant, ratios, labels, seeds)
    return figure


def _draw_examples(
    figure: SubFigure, truth: Array, examples: Mapping[tuple[str, str], Array]
) -> None:
    grid = figure.subplots(2, 2, sharex=True, sharey="row")
    rows = slice(round(6.0 / TICK), round(13.0 / TICK))
    t = TICK * np.arange(len(truth))[rows]
    for column, noise in enumerate(NOISES):
        for axes, true, state, label in (
            (grid[0, column], 2, 18, r"force $f_z$ (N)"),
            (grid[1, column], 3, 13, r"torque $\tau_x$ (Nm)"),
        ):
            for name, (colour, text) in _LINES.items():
                axes.plot(t, examples[noise, name][rows, state], color=colour, lw=1.3, label=text)
            axes.plot(t, truth[rows, true], color="black", lw=1.0, ls="--", label="true")
            if column == 0:
                axes.set_ylabel(label)
        sizes = f"{1e3 * NOISES[noise].sigma_pos_m:g} mm, {NOISES[noise].sigma_att_rad:g} rad"
        grid[0, column].set_title(f"{noise} noise ({sizes}): one hovering flight, exact plant")
        grid[1, column].set_xlabel("time (s)")
    grid[1, 0].legend(loc="lower right")


def _draw_ratios(
    figure: SubFigure,
    plant: str,
    ratios: Mapping[tuple[str, str, str, str, str], tuple[float, float, float]],
    labels: Sequence[str],
    seeds: int,
) -> None:
    shown = [v for (p, *_), value in ratios.items() if p == plant for v in value]
    lowest, highest = min([0.5, *shown]) / 1.1, max([2.0, *shown]) * 1.1
    panels = figure.subplots(1, len(ERRORS), sharey=True)
    figure.suptitle(
        f"Ratio of RMSE, {_PLANT_TITLES[plant]}: in the green the first named errs less "
        f"(95 % intervals, {seeds} seeds)",
        x=0.01,
        ha="left",
    )
    for axes, error in zip(panels, ERRORS, strict=True):
        axes.set_xscale("log")
        axes.set_xlim(lowest, highest)
        axes.axvspan(lowest, 1.0, color=HELD_OUT, lw=0)
        axes.axvline(1.0, color="black", lw=0.9)
        for i, label in enumerate(labels):
            _draw_pair(
                axes,
                i,
                {
                    key[1:3]: value
                    for key, value in ratios.items()
                    if key[0] == plant and key[3:] == (label, error)
                },
            )
        axes.set_ylim(len(labels) - 0.45, -0.55)
        only_ticks(axes.xaxis, [v for v in (0.1, 0.2, 0.5, 1, 2, 5, 10) if lowest < v < highest])
        title = error.replace("_", ", ") + (" state" if "steady" in error else "")
        axes.set_title(title, loc="center")
        axes.grid(axis="x", color="0.9", lw=0.6)
        axes.set_axisbelow(True)
    panels[0].set_yticks(range(len(labels)), labels)
    for noise in NOISES:
        for flight in FLIGHTS:
            panels[-1].plot(
                [],
                [],
                _MARKERS[flight],
                color=_NOISE_COLOURS[noise],
                label=f"{noise} noise, {flight}",
            )
    figure.legend(*panels[-1].get_legend_handles_labels(), loc="outside lower center", ncols=4)


def _draw_pair(
    axes: Axes, row: int, values: Mapping[tuple[str, str], tuple[float, float, float]]
) -> None:
    """Draw a pair's four ratios, (flight, noise) -> ratio and interval, one below the other."""
    for k, (noise, flight) in enumerate((n, f) for n in NOISES for f in FLIGHTS):
        value, low, high = values[flight, noise]
        y = row + 0.17 * (k - 1.5)
        axes.plot([low, high], [y, y], color=_NOISE_COLOURS[noise], lw=1.8)
        axes.plot(value, y, _MARKERS[flight], color=_NOISE_COLOURS[noise], ms=5)
