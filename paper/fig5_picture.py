"""The picture of Fig. 5: estimates over time as in the paper, and who errs how
much less than whom.
"""

from collections.abc import Mapping, Sequence
from itertools import product
from typing import Any

import numpy as np
from matplotlib.figure import Figure, SubFigure

from ..envs.plant import TICK
from ..runtime.drawing import ESTIMATE, HELD_OUT, SERIES, new_figure, only_ticks, styled
from .fig5_estimators import ERRORS
from .fig5_flights import FLIGHTS, NOISES, Array

_NOISE_COLOURS = {"low": SERIES[0], "high": SERIES[1]}
_MARKERS = {"hover": "o", "yawing": "^"}
_KINDS = tuple(product(NOISES, FLIGHTS))
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
        for (i, label), (k, (noise, flight)) in product(enumerate(labels), enumerate(_KINDS)):
            value, low, high = ratios[plant, flight, noise, label, error]
            y, colour = i + 0.17 * (k - 1.5), _NOISE_COLOURS[noise]
            axes.plot([low, high], [y, y], color=colour, lw=1.8)
            axes.plot(value, y, _MARKERS[flight], color=colour, ms=5)
        axes.set_ylim(len(labels) - 0.45, -0.55)
        only_ticks(axes.xaxis, [v for v in (0.1, 0.2, 0.5, 1, 2, 5, 10) if lowest < v < highest])
        title = error.replace("_", ", ") + (" state" if "steady" in error else "")
        axes.set_title(title, loc="center")
        axes.grid(axis="x", color="0.9", lw=0.6)
        axes.set_axisbelow(True)
    panels[0].set_yticks(range(len(labels)), labels)
    for noise, flight in _KINDS:
        label = f"{noise} noise, {flight}"
        panels[-1].plot([], [], _MARKERS[flight], color=_NOISE_COLOURS[noise], label=label)
    figure.legend(*panels[-1].get_legend_handles_labels(), loc="outside lower center", ncols=4)
