"""Pictures of flown episodes and of a leaderboard."""

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from ..runtime.whole_files import replaced
from .benchmark import Results, Row, short_names
from .episodes import DECISIONS, Array, Episode

COLOURS = {
    "hover": "#8c8c8c",
    "admittance": "#d1495b",
    "ratio": "#edae49",
    "lead": "#f2811d",
    "admittance-pid": "#a4243b",
    "tracker": "#3d5a80",
    "tracker-informed": "#98c1d9",
    "limit": "#293241",
    "oracle": "#30638e",
}
_OTHERS = ("#2a9d8f", "#8d5a97", "#6a994e", "#bc6c25", "#00798c", "#5f0f40")
_JET = "#cfe5f5"


def colour_of(name: str, index: int = 0) -> str:
    """Return a controller's colour, the same in every picture."""
    return COLOURS.get(name, _OTHERS[index % len(_OTHERS)])


def draw_episode(episode: Episode, title: str, path: Path) -> None:
    """Draw one episode in the manner of the paper's Fig. 7: fan and vehicle, torque, force, command
    over time.
    """
    figure = Figure(figsize=(9, 8.5), layout="constrained")
    top, torque, force, command = figure.subplots(
        4, 1, sharex=True, height_ratios=[2.2, 1.2, 1.2, 0.9]
    )
    t = episode.time
    top.fill_between(
        t, episode.fan_y - 0.45, episode.fan_y + 0.45, color=_JET, label="width of the fan"
    )
    top.plot(t, episode.fan_y, "--", color="#222222", lw=1.5, label="fan")
    top.plot(t, episode.y, color=COLOURS["admittance"], lw=2, label="vehicle")
    end = "lost" if episode.lost else "never lost"
    top.set_title(
        f"{title}: RMSE {episode.rmse:.3f} m, {end} (fan: {episode.motion}, seed {episode.seed})"
    )
    top.set_ylabel("y (m)")
    top.legend(loc="upper left", ncols=3, frameon=False)
    low, high = top.get_ylim()
    top.set_ylim(low, high + 0.18 * (high - low))
    for axes, true, estimated, label in (
        (torque, episode.torque[:, 2], episode.observation[:, 5], r"torque $\tau_z$ (Nm)"),
        (force, episode.force[:, 0], episode.observation[:, 0], "force $f_x$ (N)"),
    ):
        axes.plot(t, true, color="#9a9a9a", lw=1, label="true")
        axes.plot(t, estimated, color=COLOURS["oracle"], lw=1.8, label="estimated")
        axes.axhline(0, color="black", lw=0.5)
        axes.set_ylabel(label)
        axes.legend(loc="upper left", ncols=2, frameon=False)
        low, high = axes.get_ylim()
        axes.set_ylim(low, high + 0.25 * (high - low))
    command.step(t, episode.command, where="post", color="#444444")
    command.axhline(0, color="black", lw=0.5)
    command.set_ylabel("command (m/s)")
    command.set_xlabel("time (s)")
    for axes in (top, torque, force, command):
        axes.spines[["top", "right"]].set_visible(False)
    with replaced(path) as partial:
        figure.savefig(partial, dpi=120, format="png")


def draw_task_episode(columns: Mapping[str, Array], title: str, path: Path) -> None:
    """Draw one episode of a task: the error, and the true and the estimated force, over time.

    Args:
        columns: ``t`` s, ``error`` m, ``fx`` to ``fz`` and ``true_fx`` to ``true_fz`` N, (n,) each.
        title: of the picture.
        path: of the PNG.
    """
    figure = Figure(figsize=(9, 7.5), layout="constrained")
    top, *forces = figure.subplots(4, 1, sharex=True, height_ratios=[1.6, 1, 1, 1])
    t = columns["t"]
    top.plot(t, columns["error"], color=COLOURS["admittance"], lw=2)
    top.set_title(title)
    top.set_ylabel("error (m)")
    top.set_ylim(bottom=0)
    for axes, name in zip(forces, ("fx", "fy", "fz"), strict=True):
        axes.plot(t, columns[f"true_{name}"], color="#9a9a9a", lw=1, label="true")
        axes.plot(t, columns[name], color=COLOURS["oracle"], lw=1.8, label="estimated")
        axes.axhline(0, color="black", lw=0.5)
        axes.set_ylabel(f"force ${name[0]}_{name[1]}$ (N)")
    forces[0].legend(loc="upper left", ncols=2, frameon=False)
    forces[-1].set_xlabel("time (s)")
    for axes in (top, *forces):
        axes.spines[["top", "right"]].set_visible(False)
    with replaced(path) as partial:
        figure.savefig(partial, dpi=120, format="png")


def draw_leaderboard(rows: Sequence[Row], results: Results, path: Path) -> None:
    """Draw every episode's RMSE and the mean with its interval, and one episode's paths, a scenario
    a row.
    """
    scenarios = list(dict.fromkeys(row.scenario for row in rows))
    figure = Figure(figsize=(11, 1.0 + 3.0 * len(scenarios)), layout="constrained")
    grid = figure.subplots(len(scenarios), 2, squeeze=False, width_ratios=[1.25, 1])
    for (left, right), scenario in zip(grid, scenarios, strict=True):
        some = [row for row in rows if row.scenario == scenario]
        names = [row.controller for row in some]
        for i, row in enumerate(some):
            values = np.array([e.rmse for e in results[row.controller, scenario]])
            jitter = np.random.default_rng(0).uniform(-0.24, 0.24, len(values))
            colour = colour_of(row.controller, i)
            left.scatter(values, i + jitter, s=11, color=colour, alpha=0.4, lw=0)
            left.plot(
                row.rmse_ci95_m, [i, i], color="black", lw=2.2, solid_capstyle="butt", zorder=4
            )
            left.plot(row.rmse_m, i, "o", color=colour, mec="black", ms=8, zorder=5)
            left.annotate(
                f"{row.rmse_m:.3f} m",
                (1.01, i),
                xycoords=("axes fraction", "data"),
                va="center",
                fontsize=9,
            )
        shown = short_names(names)
        left.set_yticks(range(len(some)), [shown[name] for name in names])
        left.invert_yaxis()
        left.set_xlim(left=0)
        left.set_title(
            f"{scenario}: RMSE of each episode, mean, 95 % interval", loc="left", fontsize=10
        )
        left.set_xlabel("RMSE of the offset (m)")
        middle = np.argsort([e.rmse for e in results["admittance", scenario]])[
            len(results["admittance", scenario]) // 2
        ]
        for i, name in enumerate(names):
            episode = results[name, scenario][middle]
            right.plot(episode.time, episode.y, color=colour_of(name, i), lw=1.6, label=shown[name])
        longest = max(
            (results[name, scenario][middle] for name in names), key=lambda e: len(e.time)
        )
        right.plot(longest.time, longest.fan_y, "--", color="black", lw=1.3, label="fan")
        right.set_xlim(0, DECISIONS * 0.08)
        right.set_title("the admittance controller's median episode", loc="left", fontsize=10)
        right.set_xlabel("time (s)")
        right.set_ylabel("y (m)")
        right.legend(frameon=False, fontsize=8, ncols=2)
        for axes in (left, right):
            axes.spines[["top", "right"]].set_visible(False)
    with replaced(path) as partial:
        figure.savefig(partial, dpi=120, format="png")
