"""The picture of the jet's map: estimate, truth and error side by side, and a profile across the
jet.
"""

from typing import Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle
from numpy.typing import NDArray

from ..runtime.drawing import BLACK, ESTIMATE, SERIES, TRUTH, new_figure, room_above, styled

Array = NDArray[np.float64]


@styled()
def draw_map(
    x: Array,
    y: Array,
    estimate: Array,
    truth: Array,
    profile_y: Array,
    profile: Array,
    profile_truth: Array,
    calm: Array,
    *,
    inside: NDArray[np.bool_],
    correlations: tuple[float, float],
) -> Figure:
    """Draw the maps and the profile.

    Args:
        x: distances (n,) m of the map.
        y: offsets (m,) m of the map.
        estimate: estimated wrench (seeds, 6, n, m), N and Nm, one map a flight.
        truth: the plant's, likewise.
        profile_y: offsets (k,) m of the profile.
        profile: its estimated wrench (seeds, k, 6).
        profile_truth: the plant's, likewise.
        calm: the mean jet's (k, 6) on a level vehicle at rest.
        inside: which points (n, m) count as jet.
        correlations: of estimate and truth there, of f_x and of tau_z.
    """
    figure = new_figure(8.0)
    grid = figure.subplots(3, 3, height_ratios=[1, 1, 1.05])
    means = estimate.mean(axis=0), truth.mean(axis=0)
    error = np.sqrt(np.mean((estimate - truth) ** 2, axis=0))
    for row, axis, factor, unit, name in (
        (0, 0, 1.0, "N", "force $f_x$"),
        (1, 5, 1e3, "mNm", r"torque $\tau_z$"),
    ):
        limit = 1.05 * factor * max(float(np.abs(values[axis]).max()) for values in means)
        for axes, wrench, kind in zip(grid[row], means, ("estimated", "true"), strict=False):
            axes.set_title(f"{name} ({unit}), {kind}")
            colours = {"cmap": "viridis" if row == 0 else "RdBu_r", "vmax": limit}
            colours["vmin"] = 0.0 if row == 0 else -limit
            _heat(axes, x, y, factor * wrench[axis], inside, **colours)
            if row == 0:
                arrows = {"angles": "xy", "scale": 2.2, "width": 0.008, "pivot": "tail"}
                axes.quiver(*np.meshgrid(x, y), wrench[0].T, wrench[1].T, color="white", **arrows)
        axes, largest = grid[row, 2], 1.5e3 * float(error[axis].max())
        axes.set_title(f"RMS error, {name.split()[1]} (m{unit.removeprefix('m')})")
        _heat(axes, x, y, 1e3 * error[axis], inside, cmap="Oranges", vmin=0.0, vmax=largest)
        lines = [factor * flown[..., axis] for flown in (profile, profile_truth, calm)]
        _profile(grid[2, row], f"{name.split()[1]} ({unit})", profile_y, *lines)
    _agreement(grid[2, 2], estimate, truth, inside, correlations)
    figure.suptitle(
        f"A fan's jet felt by a hovering quadrotor: 5 s a point, mean of {len(estimate)} flights.\n"
        "Outlined: where the jet is (mean force above 0.05 N)"
    )
    return figure


def _heat(
    axes: Any,
    x: Array,
    y: Array,
    values: Array,
    inside: NDArray[np.bool_],
    **colours: Any,
) -> None:
    """Draw a map (n, m), a cell a point; outline the jet's cells."""
    mesh = axes.pcolormesh(x, y, values.T, shading="nearest", **colours)
    axes.figure.colorbar(mesh, ax=axes, shrink=0.8)
    size = x[1] - x[0], y[1] - y[0]
    for i, j in np.argwhere(inside):
        corner = (x[i] - size[0] / 2, y[j] - size[1] / 2)
        axes.add_patch(Rectangle(corner, *size, fill=False, ec="0.55", lw=0.6))
    axes.add_patch(Rectangle((0.0, -0.45), 0.22, 0.9, color="0.35"))
    arrow = {"arrowstyle": "->", "color": "0.35", "lw": 1.5}
    axes.annotate("", (0.68, 0.0), (0.28, 0.0), arrowprops=arrow)
    axes.text(0.0, -0.55, "fan", va="top")
    axes.set(xlim=(-0.1, 4.27), ylim=(-1.77, 1.77), aspect="equal")
    axes.set(xlabel="x (m), away from the fan", ylabel="y (m)")


def _profile(axes: Any, label: str, y: Array, estimate: Array, truth: Array, calm: Array) -> None:
    """Draw a profile: mean and spread over the flights beside the truth."""
    mean, spread = estimate.mean(axis=0), estimate.std(axis=0)
    band = {"color": ESTIMATE, "alpha": 0.2, "lw": 0}
    axes.fill_between(y, mean - spread, mean + spread, label="± std over flights", **band)
    axes.plot(y, calm, color=TRUTH, lw=3, label="mean jet")
    axes.plot(y, truth.mean(axis=0), "--", color=BLACK, lw=1.2, label="true")
    axes.plot(y, mean, "o-", color=ESTIMATE, ms=3.5, lw=1, label="estimated")
    axes.axhline(0, color="black", lw=0.5)
    axes.axvline(0, color="black", lw=0.5)
    room_above(axes, 0.5)
    axes.legend(loc="upper left")
    axes.set(title=f"across, at x = 2.3 m: {label}", xlabel="y (m)", ylabel=label)


def _agreement(
    axes: Any,
    estimate: Array,
    truth: Array,
    inside: NDArray[np.bool_],
    correlations: tuple[float, float],
) -> None:
    """Draw estimate against truth at the jet's points, each quantity as a share of its largest."""
    for axis, name, colour, correlation in zip(
        (0, 5), ("$f_x$", r"$\tau_z$"), SERIES, correlations, strict=False
    ):
        largest = float(np.abs(truth[:, axis]).max())
        x, y = (wrench[:, axis, inside].ravel() / largest for wrench in (truth, estimate))
        label = f"{name}, correlation {correlation:.3f}"
        axes.plot(x, y, ".", color=colour, ms=5, alpha=0.6, label=label)
    axes.plot([-1.1, 1.1], [-1.1, 1.1], color="black", lw=0.7)
    room_above(axes, 0.3)
    axes.legend(loc="upper left")
    axes.set_title("in the jet, shares of the largest")
    axes.set(xlabel="true", ylabel="estimated")
