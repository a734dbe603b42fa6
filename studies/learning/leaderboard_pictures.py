"""The pictures of the leaderboard: learning curves, intervals, performance
profiles, and tracking.
"""

from collections.abc import Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from windwrench.evaluation.episodes import FIRST_TEST_SEED, fly_episode
from windwrench.evaluation.pictures import COLOURS
from windwrench.evaluation.statistics import hierarchical_bootstrap, performance_profile
from windwrench.evaluation.tasks import make_pilot
from windwrench.runtime.page_files import write_png
from windwrench.studies.learning.scores import Line, Result, Row, normalised
from windwrench.training.training_envs import make_training_env

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
_TRACKED = (
    "hover",
    "admittance-tuned-fast",
    "lead-tuned-fast",
    "tracker-tuned-fast",
    "tracker-informed",
    "limit",
    "oracle",
)
_SUMMARY = (  # the two ends, and the best known of each kind
    "oracle",
    "limit",
    "recurrent-imitation",
    "tracker-tuned",
    "sac",
    "lead",
    "admittance",
)
_THOUSANDS = (5, 10, 20, 50, 100, 200, 400)
_WORLD, _SEED = "fast", FIRST_TEST_SEED + 3  # of the tracking picture


def colour(name: str) -> str:
    """Return a controller's colour, the same in every picture."""
    law = name.split("-tuned")[0]
    return _LEARNED.get(name) or COLOURS.get(law, "#555555")


def draw_curves(results: Sequence[Result], lines: Sequence[Line], path: Path) -> None:
    """Draw the validation RMSE over training: the mean over seeds, and the range from the best to
    the worst.
    """
    figure = Figure(figsize=(10, 4.2), layout="constrained")
    names = [x.name for x in lines if x.group == "learned"]
    worlds = list(dict.fromkeys(r["scenario"] for r in results if r["group"] == "learned"))
    for axes, world in zip(
        np.atleast_1d(figure.subplots(1, max(len(worlds), 1))), worlds, strict=True
    ):
        for name in names:
            runs = [
                r["training"]
                for r in results
                if r["name"] == name and r["scenario"] == world and "training" in r
            ]
            length = min((len(t["steps"]) for t in runs), default=0)
            if length == 0:
                continue
            steps = np.array(runs[0]["steps"][:length]) / 1000
            rmse = np.array([t["rmse_m"][:length] for t in runs])
            axes.plot(
                steps,
                rmse.mean(axis=0),
                color=colour(name),
                lw=2,
                label=f"{name} ({len(runs)} seeds)",
            )
            axes.fill_between(
                steps, rmse.min(axis=0), rmse.max(axis=0), color=colour(name), alpha=0.18, lw=0
            )
        axes.set_xscale("log")
        axes.set_xticks(_THOUSANDS, map(str, _THOUSANDS))
        axes.minorticks_off()
        axes.set_xlim(4, 450)
        axes.set_title(f"trained on {world}", loc="left", fontsize=11)
        axes.set_xlabel("decisions flown in training (thousands)")
        axes.set_ylabel("RMSE on validation episodes (m)")
        axes.set_ylim(0.1, 0.5)
        axes.legend(frameon=False, fontsize=8)
        axes.spines[["top", "right"]].set_visible(False)
    _save(figure, path)


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
    _save(figure, path)


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
    _save(figure, path)


def draw_profiles(lines: Sequence[Line], worlds: Sequence[str], path: Path) -> None:
    """Draw performance profiles: the share of all episodes with a score above a threshold, with 95
    % bands.
    """
    figure = Figure(figsize=(9, 4.6), layout="constrained")
    axes = figure.subplots()
    thresholds = np.linspace(0.0, 1.2, 121)
    for line in lines:
        shown = line.group == "learned" or line.name in (
            "admittance",
            "ratio",
            "lead",
            "tracker",
            "limit",
            "oracle",
        )
        scores = normalised(line, lines, worlds) if shown else None
        if scores is None:
            continue
        axes.plot(
            thresholds,
            performance_profile(scores, thresholds),
            color=colour(line.name),
            lw=2,
            label=line.name,
        )
        band = np.array(
            [
                hierarchical_bootstrap(
                    partial(_share_above, t), scores, resamples=200, blocks=len(worlds)
                )
                for t in thresholds[::6]
            ]
        )
        axes.fill_between(
            thresholds[::6], band[:, 0], band[:, 1], color=colour(line.name), alpha=0.18, lw=0
        )
    axes.axvline(1.0, color="black", lw=0.6, ls=":")
    axes.set_xlabel(
        "score between the mean of hover (0) and that of the oracle (1), of the same world"
    )
    axes.set_ylabel("share of episodes above it")
    axes.set_title(f"performance profiles over {', '.join(worlds)}", loc="left", fontsize=10)
    axes.legend(frameon=False, fontsize=8, loc="lower left")
    axes.spines[["top", "right"]].set_visible(False)
    _save(figure, path)


def draw_tracking(policies: Mapping[str, Path], path: Path) -> None:
    """Draw one test episode as each controller flies it: fan and vehicle over
    time, a panel each.
    """
    pilots: dict[str, Any] = {name: make_pilot(name) for name in _TRACKED if _known(name)}
    pilots |= {name: make_pilot(str(file)) for name, file in policies.items()}
    world: Any = make_training_env(_WORLD)
    columns = 3
    figure = Figure(figsize=(11, 0.5 + 2.2 * -(-len(pilots) // columns)), layout="constrained")
    panels = figure.subplots(
        -(-len(pilots) // columns), columns, sharex=True, sharey=True, squeeze=False
    ).ravel()
    for axes in panels[len(pilots) :]:
        axes.set_visible(False)
    for axes, (name, pilot) in zip(panels, pilots.items(), strict=False):
        episode: Any = fly_episode(world, pilot, _SEED)
        axes.fill_between(
            episode.time, episode.fan_y - 0.45, episode.fan_y + 0.45, color="#cfe5f5", lw=0
        )
        axes.plot(episode.time, episode.fan_y, "--", color="#222222", lw=1.2, label="fan")
        axes.plot(episode.time, episode.y, color=colour(name), lw=2, label="vehicle")
        axes.set_title(
            f"{name}: {episode.rmse:.3f} m" + (", lost" if episode.lost else ""),
            loc="left",
            fontsize=9,
        )
        axes.spines[["top", "right"]].set_visible(False)
    panels[0].legend(frameon=False, fontsize=8)
    for axes in panels[::columns]:
        axes.set_ylabel("y (m)")
    for axes in panels[: len(pilots)][-columns:]:
        axes.set_xlabel("time (s)")
        axes.tick_params(labelbottom=True)
    figure.suptitle(
        f"the same test episode of {_WORLD} (seed {_SEED}), RMSE of the offset", fontsize=10
    )
    _save(figure, path)


def _share_above(threshold: float, scores: np.ndarray) -> Any:
    return performance_profile(scores, threshold)[..., 0]


def _known(name: str) -> bool:
    from windwrench.controllers import CONTROLLERS

    return name in CONTROLLERS


def _save(figure: Figure, path: Path) -> None:
    write_png(figure, path)
