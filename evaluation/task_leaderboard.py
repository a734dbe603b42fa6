"""Leaderboards of the tasks beside ``FanTracking``: laws, policies and kinds of policies, scored
between hover (0) and oracle (1).
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from ..controllers.task_laws import TASK_LAWS
from ..controllers.task_policy import shipped_task_policies
from ..runtime.whole_files import replaced
from .statistics import (
    hierarchical_bootstrap,
    hierarchical_draws,
    holm,
    interval_of,
    mean,
    paired_wins,
    probability_of_improvement,
    relative_change,
    sign_probability,
)
from .task_benchmark import TASKS, TaskEpisode, TaskResults, wanted_laws

_RESAMPLES = 4_000
_ENDS = ("hover", "oracle")  # of the score
_CLEAR = 0.05  # p-value, corrected


@dataclass(frozen=True)
class TaskRow:
    """One line of a task's leaderboard: a law, a policy, or all policies of a kind."""

    task: str
    controller: str
    scenario: str
    episodes: int  # of each policy
    seed: int
    rmse_m: float  # mean over episodes
    rmse_ci95_m: tuple[float, float]  # over policies and episodes, as all intervals
    median_rmse_m: float
    lost_fraction: float
    score: float  # (hover - this) / (hover - oracle), of the means
    wins_over_admittance: float  # null where the task has no admittance law
    rival: str  # the law of ``wins_over_rival``
    wins_over_rival: float  # share of the paired episodes with a smaller RMSE
    change_over_rival: float  # of the mean RMSE
    change_ci95: tuple[float, float]
    improvement_over_rival: float  # probability of improvement
    best_law: str  # the designed law with the smallest mean RMSE in this scenario, of those flown
    change_over_best: float
    change_over_best_ci95: tuple[float, float]
    p_over_best: (
        float | None
    )  # of no change, corrected (Holm); null for laws, and for policies of a kind
    policies: int  # that this row counts together
    most_lost_fraction: float  # of the policy that loses most


def task_leaderboard(
    task: str, results: TaskResults, controllers: Sequence[str], seed: int
) -> list[TaskRow]:
    """Return the leaderboard's rows, scenario by scenario, best first.

    Policies of one kind that come with the kit (``sac-0``, ``sac-1``) have a row each, and one as a
    kind (``sac``), whose intervals speak of other training seeds, too.
    """
    names = list(dict.fromkeys(controllers))
    kinds = _kinds(task, names)
    rows: list[TaskRow] = []
    for scenario in dict.fromkeys(s for _, s in results):
        flown = {
            name: [results[each, scenario] for each in kinds.get(name, [name])]
            for name in [*wanted_laws(task, names), *kinds]
        }
        some = [_row(task, scenario, seed, name, flown) for name in [*names, *kinds]]
        rows.extend(sorted(some, key=lambda row: row.rmse_m))
    return _corrected(rows)


def _kinds(task: str, names: Sequence[str]) -> dict[str, list[str]]:
    """Return the kinds of which two or more policies that come with the kit are named."""
    found: dict[str, list[str]] = {}
    for name in names:
        if name in shipped_task_policies(task):
            found.setdefault(name.rpartition("-")[0], []).append(name)
    return {kind: each for kind, each in found.items() if len(each) > 1}


def _row(
    task: str,
    scenario: str,
    seed: int,
    name: str,
    flown: Mapping[str, Sequence[Sequence[TaskEpisode]]],
) -> TaskRow:
    """Return the row of a law, a policy or a kind, of episodes of each policy of all of them."""
    rmse = {law: np.array([[e.rmse for e in one] for one in of]) for law, of in flown.items()}
    designed = [law for law in TASK_LAWS[task] if law in rmse and law not in _ENDS]
    best = min(designed, key=lambda law: float(rmse[law].mean()))
    rival, x = TASKS[task].rival, rmse[name]
    span = float(rmse["hover"].mean() - rmse["oracle"].mean())
    over_rival, over_best = (
        hierarchical_draws(relative_change, x, rmse[law], resamples=_RESAMPLES)
        for law in (rival, best)
    )
    wins = float(paired_wins(x, rmse[rival]))
    lost = [float(np.mean([e.lost for e in one])) for one in flown[name]]
    return TaskRow(
        task=task,
        controller=name,
        scenario=scenario,
        episodes=x.shape[1],
        seed=seed,
        rmse_m=float(x.mean()),
        rmse_ci95_m=hierarchical_bootstrap(mean, x, resamples=_RESAMPLES),
        median_rmse_m=float(np.median(x)),
        lost_fraction=float(np.mean(lost)),
        score=float(rmse["hover"].mean() - x.mean()) / span if span > 0 else math.nan,
        wins_over_admittance=wins if rival == "admittance" else math.nan,
        rival=rival,
        wins_over_rival=wins,
        change_over_rival=float(relative_change(x, rmse[rival])),
        change_ci95=interval_of(over_rival),
        improvement_over_rival=float(probability_of_improvement(-x, -rmse[rival])),
        best_law=best,
        change_over_best=float(relative_change(x, rmse[best])),
        change_over_best_ci95=interval_of(over_best),
        p_over_best=None if name in TASK_LAWS[task] else sign_probability(over_best),
        policies=len(x),
        most_lost_fraction=max(lost),
    )


def _corrected(rows: Sequence[TaskRow]) -> list[TaskRow]:
    """Return the rows with p-values corrected (Holm) for all that a page shows of them."""
    claims = {id(row): row.p_over_best for row in shown(rows) if row.p_over_best is not None}
    p = dict(zip(claims, holm(list(claims.values())).tolist(), strict=True))
    return [replace(row, p_over_best=p.get(id(row))) for row in rows]


def shown(rows: Sequence[TaskRow]) -> list[TaskRow]:
    """Return the rows without policies that the row of their kind counts."""
    kinds = {row.controller for row in rows if row.policies > 1}
    return [row for row in rows if row.controller.rpartition("-")[0] not in kinds]


def summary(rows: Sequence[TaskRow]) -> str:
    """Return what the rows say as a list, a scenario a line: losses first, then which policies are
    better or worse than the best designed law at a corrected p-value below 0.05.
    """
    lines = []
    for scenario in dict.fromkeys(row.scenario for row in rows):
        some = [row for row in shown(rows) if row.scenario == scenario]
        lost: dict[str, list[str]] = {}
        for row in sorted(some, key=lambda row: -row.lost_fraction):
            lost.setdefault(_lost(row), []).append(f"`{row.controller}`")
        parts = [
            f"{', '.join(names)} {'none' if told == '0.0 %' else told}"
            for told, names in lost.items()
        ]
        told = "; ".join(parts) if len(lost) > 1 else f"all {next(iter(lost))}"
        if list(lost) == ["0.0 %"]:
            told = "nothing"
        judged = [row for row in some if row.p_over_best is not None and row.p_over_best < _CLEAR]
        better = [row for row in judged if row.change_over_best < 0]
        worse = [row for row in judged if row.change_over_best > 0]
        lines.append(
            f"* **{scenario}**, {some[0].episodes} episodes each. Lost: {told}. Against the best "
            f"designed law there, `{some[0].best_law}`: clearly worse {_listed(worse)}; clearly "
            f"better {_listed(better)}."
        )
    return "\n".join(lines) + "\n" if lines else ""


def _listed(rows: Sequence[TaskRow]) -> str:
    return (
        ", ".join(
            f"`{row.controller}` {_told(row.change_over_best, row.change_over_best_ci95)}"
            for row in rows
        )
        or "none"
    )


def _lost(row: TaskRow) -> str:
    told = f"{100 * row.lost_fraction:.1f} %"
    if row.most_lost_fraction > row.lost_fraction:
        told += f" (most {100 * row.most_lost_fraction:.1f} %)"
    return told


def markdown(rows: Sequence[TaskRow]) -> str:
    """Return the rows as a table for a page: policies as kinds, losses as a column of their own."""
    if not rows:
        return ""
    lines = [
        f"| scenario | law | policies | RMSE (m), 95 % | median | lost | score | wins | P | "
        f"against {rows[0].rival}, 95 % | against the best law, 95 % | p |",
        "| - | - | -: | - | -: | -: | -: | -: | -: | - | - | -: |",
    ]
    for row in shown(rows):
        low, high = row.rmse_ci95_m
        p = row.p_over_best
        lines.append(
            f"| {row.scenario} | {row.controller} | "
            f"{'-' if row.controller in TASK_LAWS[row.task] else row.policies} | "
            f"{row.rmse_m:.3f} ({low:.3f}-{high:.3f}) | {row.median_rmse_m:.3f} | {_lost(row)} | "
            f"{row.score:.2f} | {100 * row.wins_over_rival:.0f} % | "
            f"{row.improvement_over_rival:.2f} | "
            f"{_told(row.change_over_rival, row.change_ci95)} | "
            f"{_told(row.change_over_best, row.change_over_best_ci95)} | "
            f"{'-' if p is None else f'{p:.3f}'} |"
        )
    return "\n".join(lines) + "\n"


def _told(change: float, interval: tuple[float, float]) -> str:
    return f"{100 * change:+.0f} % ({100 * interval[0]:+.0f} to {100 * interval[1]:+.0f})"


_COLOURS = (
    "#30638e",
    "#2a9d8f",
    "#edae49",
    "#d1495b",
    "#8d5a97",
    "#8c8c8c",
    "#6a994e",
    "#1d1d1d",
)


def draw_task_leaderboard(
    rows: Sequence[TaskRow], results: TaskResults, path: Path, period: float
) -> None:
    """Draw every episode's RMSE, the mean with its interval, and the error over time of the rival's
    median episode, a scenario a row; of a kind, all its policies' episodes, and the first one's
    error.
    """
    rows = shown(rows)
    scenarios = list(dict.fromkeys(row.scenario for row in rows))
    colour = {
        name: _COLOURS[i % len(_COLOURS)]
        for i, name in enumerate(dict.fromkeys(row.controller for row in rows))
    }
    figure = Figure(figsize=(11, 1.0 + 2.8 * len(scenarios)), layout="constrained")
    grid = figure.subplots(len(scenarios), 2, squeeze=False, width_ratios=[1.1, 1])
    for (left, right), scenario in zip(grid, scenarios, strict=True):
        some = [row for row in rows if row.scenario == scenario]
        rival = results[some[0].rival, scenario]
        middle = int(np.argsort([e.rmse for e in rival])[len(rival) // 2])
        for i, row in enumerate(some):
            flown = [
                each
                for (name, world), each in results.items()
                if world == scenario
                and (name if row.policies == 1 else name.rpartition("-")[0]) == row.controller
            ]
            values = np.array([e.rmse for each in flown for e in each])
            jitter = np.random.default_rng(0).uniform(-0.24, 0.24, len(values))
            left.scatter(values, i + jitter, s=11, color=colour[row.controller], alpha=0.4, lw=0)
            left.plot(row.rmse_ci95_m, [i, i], color="black", lw=2.2, solid_capstyle="butt")
            left.plot(row.rmse_m, i, "o", color=colour[row.controller], mec="black", ms=8, zorder=5)
            label = f"{row.rmse_m:.3f} m" + (
                f", {100 * row.lost_fraction:.1f} % lost" if row.lost_fraction else ""
            )
            left.annotate(
                label, (1.01, i), xycoords=("axes fraction", "data"), va="center", fontsize=9
            )
            error = flown[0][middle].error
            right.plot(
                period * (1 + np.arange(len(error))),
                error,
                color=colour[row.controller],
                lw=1.4,
                label=row.controller,
            )
        left.set_yticks(range(len(some)), [row.controller for row in some])
        left.invert_yaxis()
        left.set_xlim(left=0)
        left.set_title(f"{scenario}: RMSE of each episode, mean, 95 %", loc="left", fontsize=10)
        left.set_xlabel("RMSE (m)")
        right.set_title(f"{some[0].rival}'s median episode", loc="left", fontsize=10)
        right.set_xlabel("time (s)")
        right.set_ylabel("error (m)")
        right.set_ylim(bottom=0)
        right.legend(frameon=False, fontsize=8, ncols=3)
        for axes in (left, right):
            axes.spines[["top", "right"]].set_visible(False)
    with replaced(path) as partial:
        figure.savefig(partial, dpi=110, format="png")
