"""The picture of Fig. 4: the step over time at both noise levels, and the curves to choose a tuning
from.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

Array = NDArray[np.float64]

_TUNINGS = ("#edae49", "#d1495b", "#30638e")
_NOISES = ("#2a9d8f", "#8d5a97")
_SPAN = (5.5, 14.0)  # s


@dataclass(frozen=True)
class Step:
    """The response at one tuning and one noise level, over all seeds."""

    noise: tuple[float, float]  # m, rad
    actuator: bool  # with the unmodelled actuator noise
    tuned: float  # s
    time: Array  # (n,) s
    force: Array  # (n,) N along z, mean of the flights
    torque: Array  # (n,) Nm about the pitch axis, mean
    lateral: Array  # (n,) N, size of the mean lateral force that the mass makes
    # (n, 3) N along z, Nm about the pitch axis, N lateral: the thread's true pull, mean of the
    # flights
    pull: Array
    rise: tuple[float, float]  # s, of force and torque
    rise_error: tuple[float, float]  # s, their standard errors over the flights; NaN for one flight
    peak: float  # N, of ``lateral`` in the transient
    peak_error: float  # N, its standard error
    # N, of the mean of the flights with the mass as they are, with what is left of their noise
    unpaired_peak: float
    # N, largest lateral force in the transient beyond the thread's true pull as the filter would
    # show it
    made_up: float
    std: tuple[float, float]  # N, Nm, of a hover without the mass
    worst_lateral: float  # N, largest lateral estimate of any flight in the transient
    calm_lateral: float  # N, the same of the flights without the mass


def draw(steps: Sequence[Step], shown: Sequence[float], bound: float) -> Figure:
    """Draw force, torque and lateral force (rows) over time at each noise level, and the sweep's
    three curves beside.

    Args:
        steps: of every noise level, with and without actuator noise, and tuning.
        shown: tuned rise times that are drawn over time, s.
        bound: on the lateral force, N.
    """
    figure = Figure(figsize=(13.5, 8.2), layout="constrained")
    grid = figure.subplots(3, 3, width_ratios=[1, 1, 1.05])
    noises = list(dict.fromkeys(step.noise for step in steps))
    labels = {noise: f"{noise[0] * 1e3:g} mm, {noise[1] * 1e3:g} mrad" for noise in noises}
    for column, noise in enumerate(noises):
        some = [
            step for step in steps if step.noise == noise and step.actuator and step.tuned in shown
        ]
        for row, (name, unit) in enumerate(
            (("force z", "N"), ("pitch torque", "mNm"), ("lateral force of the mass", "N"))
        ):
            axes = grid[row, column]
            scale = 1e3 if unit == "mNm" else 1.0
            # the truth of the middle tuning: the flights differ a little
            for step in some[len(some) // 2 :][:1]:
                axes.plot(
                    step.time,
                    step.pull[:, row] * scale,
                    color="#a0a0a0",
                    lw=1,
                    label="true pull of the thread",
                )
            for step, colour in zip(some, _TUNINGS, strict=False):
                values = (step.force, step.torque, step.lateral)[row]
                text = f"tuned to {step.tuned:g} s"
                if row < 2:
                    text += f": {step.rise[row]:.2f} s"
                axes.plot(step.time, values * scale, color=colour, lw=1.8, label=text)
            axes.axvline(7.0, color="black", lw=0.6, ls=":")
            axes.set_xlim(*_SPAN)
            axes.set_ylabel(f"{name} ({unit})" if column == 0 else "")
            axes.legend(
                frameon=False,
                fontsize=8,
                loc=("upper right", "lower right", "upper right")[row],
                title="rise time" if row < 2 else None,
                title_fontsize=8,
            )
            if row == 2:
                axes.axhline(bound, color="black", lw=0.8, ls="--")
                axes.annotate(
                    "allowed", (_SPAN[0], bound), (3, 3), textcoords="offset points", fontsize=8
                )
                axes.set_xlabel("time (s)")
            else:
                axes.tick_params(labelbottom=False)
        grid[0, column].set_title(
            f"53 g hung on at 7 s; pose noise {labels[noise]}", loc="left", fontsize=10
        )
    for row in range(2):
        _share_limits(grid[row, :2])
    _share_limits(grid[2, :2])
    for axes in grid[2, :2]:
        axes.set_ylim(0, 1.55 * axes.get_ylim()[1])  # room for the names above the bound
    _draw_choice(grid[:, 2], steps, labels, bound)
    for axes in grid.flat:
        axes.spines[["top", "right"]].set_visible(False)
    return figure


def _share_limits(row: Sequence[Any]) -> None:
    low, high = min(axes.get_ylim()[0] for axes in row), max(axes.get_ylim()[1] for axes in row)
    for axes in row:
        axes.set_ylim(low, high)


def _draw_choice(
    column: Sequence[Any],
    steps: Sequence[Step],
    labels: dict[tuple[float, float], str],
    bound: float,
) -> None:
    """Draw standard deviation of force and torque, and the lateral transient, over
    the rise time.
    """
    for row, axes in enumerate(column):
        for colour, (noise, label) in zip(_NOISES, labels.items(), strict=True):
            for actuator in (True, False):
                some = [step for step in steps if step.noise == noise and step.actuator == actuator]
                rise = [step.rise[min(row, 1)] if row < 2 else step.tuned for step in some]
                values = [(step.std[0] * 1e3, step.std[1] * 1e3, step.peak)[row] for step in some]
                axes.plot(
                    rise,
                    values,
                    "o-" if actuator else "o--",
                    ms=4,
                    lw=1.6 if actuator else 1.2,
                    color=colour,
                    mfc=colour if actuator else "white",
                    label=label + (", actuator noise" if actuator else ", rotors as told"),
                )
        axes.set_xscale("log")
        ticks = (0.25, 0.5, 1.0, 2.0, 3.0)
        axes.set_xticks(ticks, [f"{tick:g}" for tick in ticks])
        axes.minorticks_off()
        axes.set_ylabel(
            ("std of force z (mN)", "std of pitch torque (mNm)", "peak lateral force (N)")[row]
        )
        if row < 2:
            axes.set_yscale("log")
            axes.set_yticks(
                *(
                    ((2, 5, 10, 20, 50), ("2", "5", "10", "20", "50"))
                    if row == 0
                    else ((0.1, 0.3, 1, 3, 10), ("0.1", "0.3", "1", "3", "10"))
                )
            )
            axes.minorticks_off()
    column[0].set_title("choosing a tuning: noise against rise time", loc="left", fontsize=10)
    column[0].set_xlabel("rise time of the force, measured (s)")
    column[1].set_xlabel("rise time of the torque, measured (s)")
    column[2].set_xlabel("rise time tuned for (s)")
    column[2].axhline(bound, color="black", lw=0.8, ls="--")
    column[2].set_ylim(0, None)
    column[0].legend(frameon=False, fontsize=8)
