"""The picture of the jet's map: estimate, truth and error side by side, and a profile across the
jet.
"""

from typing import Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle
from numpy.typing import NDArray

from .drawing import BLACK, COLOURS, styled

Array = NDArray[np.float64]


@styled
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
    figure = Figure(figsize=(13, 10.8))
    grid = figure.subplots(3, 3, height_ratios=[1, 1, 1.05])
    means = estimate.mean(axis=0), truth.mean(axis=0)
    error = np.sqrt(np.mean((estimate - truth) ** 2, axis=0))
    for row, axis, factor, unit, style, name in (
        (0, 0, 1.0, "N", "{:.2f}", "force $f_x$"),
        (1, 5, 1e3, "mNm", "{:.0f}", r"torque $\tau_z$"),
    ):
        limit = 1.05 * factor * max(float(np.abs(values[axis]).max()) for values in means)
        for axes, wrench, kind in zip(grid[row], means, ("estimated", "true"), strict=False):
            axes.set_title(f"{name} ({unit}), {kind}")
            colours = {"cmap": "viridis" if row == 0 else "RdBu_r", "vmax": limit}
            colours["vmin"] = 0.0 if row == 0 else -limit
            _heat(axes, x, y, factor * wrench[axis], inside, style, **colours)
            if row == 0:
                arrows = {"angles": "xy", "scale": 2.2, "width": 0.008, "pivot": "tail"}
                axes.quiver(*np.meshgrid(x, y), wrench[0].T, wrench[1].T, color="white", **arrows)
        axes, largest = grid[row, 2], 1.5e3 * float(error[axis].max())
        axes.set_title(f"RMS error of a flight's {name} (m{unit.removeprefix('m')})")
        style = "{:.0f}" if row == 0 else "{:.1f}"
        _heat(axes, x, y, 1e3 * error[axis], inside, style, cmap="Oranges", vmin=0.0, vmax=largest)
        lines = [factor * flown[..., axis] for flown in (profile, profile_truth, calm)]
        _profile(grid[2, row], f"{name.split()[1]} ({unit})", profile_y, *lines)
    _agreement(grid[2, 2], estimate, truth, inside, correlations)
    figure.suptitle(
        f"A fan's jet felt by a hovering quadrotor: 5 s a point, mean of {len(estimate)} flights. "
        "Outlined: where the jet is (mean force above 0.05 N)"
    )
    return figure


def _heat(
    axes: Any,
    x: Array,
    y: Array,
    values: Array,
    inside: NDArray[np.bool_],
    style: str,
    **colours: Any,
) -> None:
    """Draw a map (n, m), a cell a point, with its numbers, legible on their colours; outline the
    jet's cells.
    """
    mesh = axes.pcolormesh(x, y, values.T, shading="nearest", **colours)
    brightness = mesh.cmap(mesh.norm(values))[..., :3] @ [0.3, 0.6, 0.1]
    size = x[1] - x[0], y[1] - y[0]
    for (i, j), value in np.ndenumerate(values):
        text = style.format(value)
        text = text.replace("-", "") if float(text) == 0 else text  # no negative zero
        colour = "white" if brightness[i, j] < 0.55 else "black"
        axes.text(x[i], y[j] - 0.13, text, ha="center", va="center", fontsize=6.5, color=colour)
        if inside[i, j]:
            corner = (x[i] - size[0] / 2, y[j] - size[1] / 2)
            axes.add_patch(Rectangle(corner, *size, fill=False, ec="0.55", lw=0.6))
    axes.add_patch(Rectangle((0.0, -0.45), 0.22, 0.9, color="0.35"))
    arrow = {"arrowstyle": "->", "color": "0.35", "lw": 1.5}
    axes.annotate("", (0.68, 0.0), (0.28, 0.0), arrowprops=arrow)
    axes.text(0.11, 0.0, "fan", rotation=90, color="white", ha="center", va="center", fontsize=8)
    axes.set(xlim=(-0.1, 4.27), ylim=(-1.77, 1.77), aspect="equal")
    axes.set(xlabel="x (m), away from the fan", ylabel="y (m)")


def _profile(axes: Any, label: str, y: Array, estimate: Array, truth: Array, calm: Array) -> None:
    """Draw a profile: mean and spread over the flights beside the truth."""
    mean, spread = estimate.mean(axis=0), estimate.std(axis=0)
    band = {"color": COLOURS[0], "alpha": 0.2, "lw": 0}
    axes.fill_between(y, mean - spread, mean + spread, label="± std over flights", **band)
    axes.plot(y, calm, color="0.6", lw=3, label="mean jet")
    axes.plot(y, truth.mean(axis=0), "--", color=BLACK, lw=1.2, label="true")
    axes.plot(y, mean, "o-", color=COLOURS[0], ms=3.5, lw=1, label="estimated")
    axes.axhline(0, color="black", lw=0.5)
    axes.axvline(0, color="black", lw=0.5)
    axes.legend(loc="upper left")
    axes.set(title=f"across the jet at x = 2.3 m: {label}", xlabel="y (m)", ylabel=label)


def _agreement(
    axes: Any,
    estimate: Array,
    truth: Array,
    inside: NDArray[np.bool_],
    correlations: tuple[float, float],
) -> None:
    """Draw estimate against truth at the jet's points, each quantity as a share of its largest."""
    for axis, name, colour, correlation in zip(
        (0, 5), ("$f_x$", r"$\tau_z$"), COLOURS[1:], correlations, strict=False
    ):
        largest = float(np.abs(truth[:, axis]).max())
        x, y = (wrench[:, axis, inside].ravel() / largest for wrench in (truth, estimate))
        label = f"{name}, correlation {correlation:.3f}"
        axes.plot(x, y, ".", color=colour, ms=5, alpha=0.6, label=label)
    axes.plot([-1.1, 1.1], [-1.1, 1.1], color="black", lw=0.7)
    axes.legend(loc="upper left")
    axes.set_title("every hover in the jet, as shares of the largest")
    axes.set(xlabel="true", ylabel="estimated")
