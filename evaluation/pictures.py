"""Pictures of flown episodes and of a leaderboard."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ..runtime.drawing import (
    BLACK,
    ESTIMATE,
    GREY,
    JET,
    MOST_ROWS,
    SERIES,
    TRUTH,
    new_figure,
    room_above,
    styled,
)
from ..runtime.page_files import write_png
from .benchmark import Results
from .episodes import Episode
from .leaderboard import SETTLED, Standing, figures, flights_of, shown
from .tables import in_mm
from .tasks import short_names

# fixed in every picture; other controllers take turns
COLOURS = {"hover": GREY, "admittance": SERIES[1], "limit": BLACK, "oracle": SERIES[0]}
_OTHERS = (*SERIES[2:], "#5f0f40", "#6a994e", "#8c564b", "#e08dac", "#3d405b")


@styled()
def draw_episode(episode: Episode, title: str, path: Path) -> None:
    """Draw an episode over time. In the jet of a fan on one path: fan and vehicle, torque, force
    and command, as the paper's Fig. 7; in other tasks: the error and the three forces. Without an
    error of the task: the actions, and up to three numbers of the observation.
    """
    t, estimate = episode.time, episode.estimate
    true = np.hstack([episode.force, episode.torque])
    wrench = (
        ((5, r"torque $\tau_z$ (Nm)"), (0, "force $f_x$ (N)"))
        if episode.in_jet
        else tuple((i, f"force $f_{axis}$ (N)") for i, axis in enumerate("xyz"))
    )
    figure = new_figure(7.0)
    top, *others = figure.subplots(4, 1, sharex=True, height_ratios=[2, 1, 1, 1])
    end = "terminated" if episode.lost else "not terminated"
    details = ", ".join(filter(None, (episode.motion, f"seed {episode.seed}")))
    figure_text = f"return {episode.total_reward:.4g}"
    if len(episode.error):
        figure_text = f"RMSE after 3 s {episode.rmse_settled:.3g} m"
    top.set_title(f"{title}: {figure_text}, {end} ({details})")
    if episode.in_jet:
        fan, command = episode.fan_y, others.pop()
        top.fill_between(t, fan - 0.45, fan + 0.45, color=JET, label="width of the fan")
        top.plot(t, fan, "--", color=BLACK, lw=1.5, label="fan")
        top.plot(t, episode.y, color=COLOURS["admittance"], lw=2, label="vehicle")
        top.set_ylabel("y (m)")
        _legend(top, 3)
        command.step(t, episode.command, where="post", color=BLACK)
        command.axhline(0, color=BLACK, lw=0.5)
        command.set_ylabel("command (m/s)")
    elif len(episode.error):
        top.plot(t, episode.error, color=COLOURS["admittance"], lw=2)
        top.set_ylabel("error (m)")
        top.set_ylim(bottom=0)
    else:
        top.step(t, episode.action, where="post")
        top.set_ylabel("action, -1 to 1")
        for i, (axes, seen) in enumerate(zip(others, episode.observation.T, strict=False)):
            axes.plot(t, seen, color=ESTIMATE)
            axes.set_ylabel(f"observation {i}")
        others.clear()
    for axes, (i, label) in zip(others, wrench, strict=False):
        axes.plot(t, true[:, i], color=TRUTH, lw=1, label="true")
        axes.plot(t, estimate[:, i], color=ESTIMATE, lw=1.6, label="estimated")
        axes.axhline(0, color=BLACK, lw=0.5)
        axes.set_ylabel(label)
        _legend(axes, 2)
    figure.axes[-1].set_xlabel("time (s)")
    write_png(figure, path)


def _legend(axes: Any, columns: int) -> None:
    room_above(axes)
    axes.legend(loc="upper left", ncols=columns)


@styled()
def draw_leaderboard(rows: Sequence[Standing], results: Results, path: Path) -> None:
    """Draw a scenario a row: the RMSE after 3 s of every episode and the mean with its interval,
    and the rival's median episode. A kind has the episodes of all policies, and the first one's
    path. In tasks without an error, the return replaces the RMSE.
    """
    rows = shown(rows)
    scenarios = list(dict.fromkeys(row.scenario for row in rows))
    names = short_names(list(dict.fromkeys(row.controller for row in rows)))
    colours = {name: COLOURS.get(name, _OTHERS[i % len(_OTHERS)]) for i, name in enumerate(names)}
    figure = new_figure(len(scenarios) * (1.4 + 0.24 * min(len(names), MOST_ROWS)))
    grid = figure.subplots(len(scenarios), 2, squeeze=False, width_ratios=[1.25, 1])
    for (left, right), scenario in zip(grid, scenarios, strict=True):
        all_of_it = [row for row in rows if row.scenario == scenario]
        some = all_of_it[:MOST_ROWS]
        flights = {name: each for (name, world), each in results.items() if world == scenario}
        rival, by_error = flights[some[0].rival], some[0].ranked_by == SETTLED
        figure_name = "rmse_settled" if by_error else "total_reward"
        middle = int(np.argsort(figures([rival], figure_name)[0])[len(rival) // 2])
        for i, row in enumerate(some):
            flown = flights_of(row, results)
            values = figures(flown, figure_name).ravel()
            shown_mean = row.rmse_settled_m if by_error else row.return_mean
            mean_text = f"{in_mm(shown_mean)} mm" if by_error else f"{shown_mean:.4g}"
            jitter = np.random.default_rng(0).uniform(-0.24, 0.24, len(values))
            colour = colours[row.controller]
            left.scatter(values, i + jitter, s=11, color=colour, alpha=0.4, lw=0)
            if by_error:
                ends = row.rmse_settled_ci95_m
                left.plot(ends, [i, i], color=BLACK, lw=2.2, solid_capstyle="butt", zorder=4)
            left.plot(shown_mean, i, "o", color=colour, mec=BLACK, ms=8, zorder=5)
            lost = f", {row.lost_episodes} terminated" if row.lost_episodes else ""
            beside, text = ("axes fraction", "data"), f"{mean_text}{lost}"
            left.annotate(text, (1.01, i), xycoords=beside, va="center")
            episode = flown[0][middle]
            way = episode.y if episode.in_jet else episode.error
            right.plot(episode.time[: len(way)], way, color=colour)
        longest = max((each[middle] for each in flights.values()), key=lambda e: len(e.time))
        right.plot(longest.time, longest.fan_y, "--", color=BLACK, lw=1.3)
        left.set_yticks(range(len(some)), [names[row.controller] for row in some])
        left.invert_yaxis()
        if by_error:
            left.set_xlim(left=0)
        of = f", the best {len(some)} of {len(all_of_it)}" if some != all_of_it else ""
        what, interval = ("RMSE after 3 s", ", 95 % interval") if by_error else ("return", "")
        left.set_title(f"{scenario}{of}: {what} of each episode, mean{interval}")
        left.set_xlabel(f"{what}{' (m)' * by_error}")
        y_label = "y (m), fan dashed" if longest.in_jet else "error (m)"
        right.set_title(f"median episode of {some[0].rival}")
        right.set_xlabel("time (s)")
        right.set_ylabel(y_label)
    write_png(figure, path)
