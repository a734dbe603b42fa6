"""The pictures of the leaderboard: every controller's interval, and a few in short."""

from collections.abc import Sequence
from pathlib import Path

from matplotlib.figure import Figure

from windwrench.evaluation.pictures import COLOURS
from windwrench.runtime.page_files import write_png
from windwrench.studies.learning.scores import Row

_LEARNED = {
    "sac": "#1b7f5c",
    "sac-wide": "#7fc8a9",
    "sac-fast": "#0d3b2a",
    "td3": "#8d5a97",
    "ppo": "#bc6c25",
    "recurrent-ppo": "#5b3a1e",
    "imitation": "#3a6ea5",
    "imitation-wide": "#8fb8de",
    "recurrent-imitation": "#c1121f",
    "recurrent-imitation-wide": "#f28482",
}
_SUMMARY = (  # the two ends, and the best known of each kind
    "oracle",
    "limit",
    "recurrent-imitation",
    "tracker-tuned",
    "sac",
    "lead",
    "admittance",
)


def colour(name: str) -> str:
    """Return a controller's colour, the same in every picture."""
    law = name.split("-tuned")[0]
    return _LEARNED.get(name) or COLOURS.get(law, "#555555")


def draw_intervals(rows: Sequence[Row], path: Path) -> None:
    """Draw every controller's mean RMSE with its interval and its seeds, a panel for each world."""
    worlds = list(dict.fromkeys(row.world for row in rows))
    figure = Figure(figsize=(11, 0.6 + 3.4 * -(-len(worlds) // 2)), layout="constrained")
    panels = figure.subplots(-(-len(worlds) // 2), 2, squeeze=False).ravel()
    for axes in panels[len(worlds) :]:
        axes.set_visible(False)
    for axes, world in zip(panels, worlds, strict=False):
        some = [row for row in rows if row.world == world and row.name != "hover"]
        for i, row in enumerate(some):
            axes.plot(
                row.interval,
                [i, i],
                color=colour(row.name),
                lw=5,
                alpha=0.35,
                solid_capstyle="butt",
            )
            axes.plot(row.rmse_m, i, "o", color=colour(row.name), ms=6)
            if row.seeds > 1:
                axes.plot(row.by_seed, [i] * row.seeds, "|", color="black", ms=7, mew=0.8)
        axes.set_yticks(range(len(some)), [row.name for row in some], fontsize=8)
        axes.invert_yaxis()
        axes.set_xlim(left=0)
        axes.set_title(world, loc="left", fontsize=11)
        axes.set_xlabel("RMSE (m): mean, 95 % interval, seeds")
        axes.grid(axis="x", lw=0.4)
        axes.spines[["top", "right"]].set_visible(False)
    write_png(figure, path)


def draw_summary(rows: Sequence[Row], path: Path) -> None:
    """Draw the mean RMSE of a few controllers with its interval, to be read where it is small."""
    figure = Figure(figsize=(7, 4.4), layout="constrained")
    axes = figure.subplots()
    names = [name for name in _SUMMARY if any(row.name == name for row in rows)]
    for world, hue, shift in (("base", "#3a6ea5", -0.15), ("fast", "#d9822b", 0.15)):
        some = {row.name: row for row in rows if row.world == world}
        for i, name in enumerate(names):
            if name not in some:
                continue
            row, y = some[name], i + shift
            axes.plot(row.interval, [y, y], color=hue, lw=6, alpha=0.4, solid_capstyle="butt")
            axes.plot(row.rmse_m, y, "o", color=hue, ms=9, label=None if i else f"{world} fans")
    axes.set_yticks(range(len(names)), names, fontsize=15)
    axes.invert_yaxis()
    axes.set_xlim(left=0)
    axes.tick_params(axis="x", labelsize=13)
    axes.set_xlabel("RMSE (m), mean and 95 % interval", fontsize=14)
    axes.grid(axis="x", lw=0.4)
    axes.legend(frameon=False, fontsize=14, loc="upper right")
    axes.spines[["top", "right"]].set_visible(False)
    write_png(figure, path)
