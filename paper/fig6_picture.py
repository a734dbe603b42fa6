"""The picture of the jet's map: estimate, truth and error side by side, and a profile across the
jet.
"""

from typing import Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle
from numpy.typing import NDArray

Array = NDArray[np.float64]
_ESTIMATE, _TRUTH = "#d1495b", "#222222"


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
    figure = Figure(figsize=(13, 10.8), layout="constrained")
    grid = figure.subplots(3, 3, height_ratios=[1, 1, 1.05])
    means = estimate.mean(axis=0), truth.mean(axis=0)
    error = np.sqrt(np.mean((estimate - truth) ** 2, axis=0))
    for row, axis, factor, unit, style, name in (
        (0, 0, 1.0, "N", "{:.2f}", "force $f_x$"),
        (1, 5, 1e3, "mNm", "{:.0f}", r"torque $\tau_z$"),
    ):
        limit = 1.05 * factor * max(float(np.abs(values[axis]).max()) for values in means)
        for axes, wrench, title in zip(grid[row], means, ("estimated", "true"), strict=False):
            _heat(
                axes,
                x,
                y,
                factor * wrench[axis],
                inside,
                f"{name} ({unit}), {title}",
                style,
                cmap="viridis" if row == 0 else "RdBu_r",
                vmin=0.0 if row == 0 else -limit,
                vmax=limit,
            )
            if row == 0:
                axes.quiver(
                    *np.meshgrid(x, y),
                    wrench[0].T,
                    wrench[1].T,
                    color="white",
                    angles="xy",
                    scale=2.2,
                    width=0.008,
                    pivot="tail",
                )
        _heat(
            grid[row, 2],
            x,
            y,
            1e3 * error[axis],
            inside,
            f"RMS error of a flight's {name} (m{unit.removeprefix('m')})",
            "{:.0f}" if row == 0 else "{:.1f}",
            cmap="Oranges",
            vmin=0.0,
            vmax=1.5e3 * float(error[axis].max()),
        )
    _profile(
        grid[2, 0], profile_y, profile[:, :, 0], profile_truth[:, :, 0], calm[:, 0], "$f_x$ (N)"
    )
    _profile(
        grid[2, 1],
        profile_y,
        1e3 * profile[:, :, 5],
        1e3 * profile_truth[:, :, 5],
        1e3 * calm[:, 5],
        r"$\tau_z$ (mNm)",
    )
    _agreement(grid[2, 2], estimate, truth, inside, correlations)
    figure.suptitle(
        f"A fan's jet felt by a hovering quadrotor: 5 s a point, mean of {len(estimate)} flights. "
        "Outlined: where the jet is (mean force above 0.05 N)",
        fontsize=11,
    )
    return figure


def _heat(
    axes: Any,
    x: Array,
    y: Array,
    values: Array,
    inside: NDArray[np.bool_],
    title: str,
    style: str,
    **colours: Any,
) -> None:
    """Draw a map (n, m), a cell a point, with its numbers."""
    mesh = axes.pcolormesh(x, y, values.T, shading="nearest", **colours)
    _label_cells(axes, x, y, values, inside, mesh, style)
    axes.add_patch(Rectangle((0.0, -0.45), 0.22, 0.9, color="0.35"))
    axes.annotate(
        "", (0.68, 0.0), (0.28, 0.0), arrowprops={"arrowstyle": "->", "color": "0.35", "lw": 1.5}
    )
    axes.text(0.11, 0.0, "fan", rotation=90, color="white", ha="center", va="center", fontsize=8)
    axes.set_xlim(-0.1, 4.27)
    axes.set_ylim(-1.77, 1.77)
    axes.set_aspect("equal")
    axes.set_title(title, fontsize=10, loc="left")
    axes.set_xlabel("x (m), away from the fan")
    axes.set_ylabel("y (m)")
    axes.spines[["top", "right"]].set_visible(False)


def _label_cells(
    axes: Any, x: Array, y: Array, values: Array, inside: NDArray[np.bool_], mesh: Any, style: str
) -> None:
    """Write each value into its cell, legibly on its colour, and outline the jet's cells."""
    dx, dy = x[1] - x[0], y[1] - y[0]
    for i in range(len(x)):
        for j in range(len(y)):
            red, green, blue, _ = mesh.cmap(mesh.norm(values[i, j]))
            dark = 0.3 * red + 0.6 * green + 0.1 * blue < 0.55
            text = style.format(values[i, j])
            text = text.replace("-", "") if float(text) == 0 else text  # no negative zero
            axes.text(
                x[i],
                y[j] - 0.13,
                text,
                ha="center",
                va="center",
                fontsize=6.5,
                color="white" if dark else "black",
            )
            if inside[i, j]:
                axes.add_patch(
                    Rectangle((x[i] - dx / 2, y[j] - dy / 2), dx, dy, fill=False, ec="0.55", lw=0.6)
                )


def _profile(axes: Any, y: Array, estimate: Array, truth: Array, calm: Array, label: str) -> None:
    """Draw a profile: mean and spread over the flights beside the truth."""
    mean, spread = estimate.mean(axis=0), estimate.std(axis=0)
    axes.fill_between(
        y,
        mean - spread,
        mean + spread,
        color=_ESTIMATE,
        alpha=0.2,
        lw=0,
        label="± std over flights",
    )
    axes.plot(y, calm, color="0.6", lw=3, label="mean jet")
    axes.plot(y, truth.mean(axis=0), "--", color=_TRUTH, lw=1.2, label="true")
    axes.plot(y, mean, "o-", color=_ESTIMATE, ms=3.5, lw=1, label="estimated")
    axes.axhline(0, color="black", lw=0.5)
    axes.axvline(0, color="black", lw=0.5)
    axes.set_title(f"across the jet at x = 2.3 m: {label}", fontsize=10, loc="left")
    axes.set_xlabel("y (m)")
    axes.set_ylabel(label)
    axes.legend(frameon=False, fontsize=7.5, loc="upper left")
    axes.spines[["top", "right"]].set_visible(False)


def _agreement(
    axes: Any,
    estimate: Array,
    truth: Array,
    inside: NDArray[np.bool_],
    correlations: tuple[float, float],
) -> None:
    """Draw estimate against truth at the jet's points, each quantity as a share of its largest."""
    for axis, name, colour, correlation in (
        (0, "$f_x$", "#30638e", correlations[0]),
        (5, r"$\tau_z$", "#edae49", correlations[1]),
    ):
        largest = float(np.abs(truth[:, axis]).max())
        axes.plot(
            truth[:, axis, inside].ravel() / largest,
            estimate[:, axis, inside].ravel() / largest,
            ".",
            color=colour,
            ms=5,
            alpha=0.6,
            label=f"{name}, correlation {correlation:.3f}",
        )
    axes.plot([-1.1, 1.1], [-1.1, 1.1], color="black", lw=0.7)
    axes.set_title("every hover in the jet, as shares of the largest", fontsize=10, loc="left")
    axes.set_xlabel("true")
    axes.set_ylabel("estimated")
    axes.legend(frameon=False, fontsize=8, loc="upper left")
    axes.spines[["top", "right"]].set_visible(False)
