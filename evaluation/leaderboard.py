"""The leaderboard of a task: controllers, and kinds of policies, ranked by their error after 3 s
and scored between hover (0) and oracle (1).
"""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ..controllers.registry import STANDARD_TASK
from ..runtime.arrays import Array
from .benchmark import Results
from .episodes import Episode
from .statistics import (
    hierarchical_bootstrap,
    hierarchical_draws,
    holm,
    interquartile_mean,
    interval_of,
    mean,
    paired_wins,
    probability_of_improvement,
    relative_change,
    sign_probability,
)
from .tasks import task_of

_RESAMPLES = 4_000
SETTLED, RETURN = "rmse_settled_m", "return_mean"  # figures that rank
_NONE = math.nan, math.nan


@dataclass(frozen=True)
class Standing:
    """One line of a leaderboard: a law, a policy, or all policies of a kind.

    Score, wins, changes and probabilities belong to the ranking figure. The remaining time of a
    lost episode counts at 2.5 m, so one loss may dominate a mean and its interval. The
    interquartile mean leaves out the best and the worst quarter of the episodes.
    """

    controller: str
    scenario: str
    episodes: int  # for each policy
    seed: int
    rmse_m: float  # over whole episodes, mean over episodes; null where the task states no error
    rmse_ci95_m: tuple[float, float]  # over episodes; of a kind, over policies and episodes
    median_rmse_m: float
    lost_fraction: float
    score: float  # (hover - this) / (hover - oracle), of the means
    wins_over_admittance: float  # null where the task has no admittance law
    task: str
    rival: str  # the law of ``wins_over_rival``
    wins_over_rival: float  # share of the paired episodes that are better; a tie is half
    change_over_rival: float  # in mean RMSE after 3 s; null if the return ranks
    change_ci95: tuple[float, float]  # over policies and episodes
    improvement_over_rival: float  # probability of improvement
    best_law: str  # the best designed law in this scenario, of those flown
    change_over_best: float
    change_over_best_ci95: tuple[float, float]
    # probability of no change, corrected (Holm); null for laws, and for policies of a kind
    p_over_best: float | None
    policies: int  # counted together in this row
    most_lost_fraction: float  # the policy's with most losses
    # (rival - this) / (rival - limit), of the means: share of the way from the rival to the best
    # possible by the measurements; null where ``limit`` does not fly
    share_of_limit: float
    ranked_by: str  # ``rmse_settled_m``, or where the task states no error ``return_mean``
    rmse_settled_m: float  # after 3 s, mean over episodes
    rmse_settled_ci95_m: tuple[float, float]
    rmse_transient_m: float  # before 3 s
    iqm_rmse_m: float  # interquartile mean of the RMSE after 3 s, over policies and episodes
    iqm_ci95_m: tuple[float, float]
    improvement_ci95: tuple[float, float]  # bounds of ``improvement_over_rival``
    return_mean: float
    return_ci95: tuple[float, float]
    command_activity: float  # as ``Episode.command_activity``, mean over episodes
    saturated_fraction: float  # share of decisions with a command at its bound
    lost_episodes: int  # by all policies
    uses_truth: bool  # whether it read ``info``'s truth or a preview in any episode


def leaderboard(
    results: Results, controllers: Sequence[str], seed: int, task: str = STANDARD_TASK
) -> list[Standing]:
    """Return the leaderboard's rows, scenario by scenario, best first.

    The kit's policies of one kind (``sac-0``, ``sac-1``) have a row each, and one as a kind
    (``sac``). The kind's intervals are for other training seeds, too.
    """
    names, flown_task = list(dict.fromkeys(controllers)), task_of(task)
    kinds: dict[str, list[str]] = {}
    for name in names:
        if name in flown_task.policies():
            kinds.setdefault(name.rpartition("-")[0], []).append(name)
    kinds = {kind: each for kind, each in kinds.items() if len(each) > 1}
    rows: list[Standing] = []
    for scenario in dict.fromkeys(s for _, s in results):
        flown = {
            name: [results[each, scenario] for each in kinds.get(name, [name])]
            for name in [*flown_task.references(names), *kinds]
            if name in kinds or (name, scenario) in results
        }
        some = [_row(task, scenario, seed, name, flown) for name in [*names, *kinds]]
        rows.extend(sorted(some, key=lambda row: row.rmse_settled_m))
        if rows[-1].ranked_by == RETURN:
            rows[-len(some) :] = sorted(some, key=lambda row: -row.return_mean)
    return _corrected(rows)


Flown = Mapping[str, Sequence[Sequence[Episode]]]


def flights_of(row: Standing, results: Results) -> list[list[Episode]]:
    """Return the episodes of each policy in a row."""
    return [
        flown
        for (name, scenario), flown in results.items()
        if scenario == row.scenario
        and (name if row.policies == 1 else name.rpartition("-")[0]) == row.controller
    ]


def figures(flown: Sequence[Sequence[Episode]], name: str) -> Array:
    """Return a property of all episodes (policies, episodes)."""
    return np.array([[getattr(e, name) for e in one] for one in flown], dtype=np.float64)


def ranking_figures(flown: Flown) -> tuple[str, dict[str, Array]]:
    """Return the name of the ranking figure, and its values by controller (policies, episodes);
    less is better.
    """
    rmse = {name: figures(of, "rmse_settled") for name, of in flown.items()}
    if all(np.isfinite(each).all() for each in rmse.values()):
        return SETTLED, rmse
    return RETURN, {name: -figures(of, "total_reward") for name, of in flown.items()}


def _row(task: str, scenario: str, seed: int, name: str, flown: Flown) -> Standing:
    """Return the row of a law, a policy or a kind; ``flown`` holds the episodes of each policy."""
    flown_task, episodes = task_of(task), flown[name]
    by, ranked = ranking_figures(flown)
    means = {law: float(of.mean()) for law, of in ranked.items()}
    ends = [
        law for law in flown_task.laws if law in ranked and law not in ("hover", *flown_task.bounds)
    ]
    rival, x = flown_task.rival, ranked[name]
    best = min(ends or [rival], key=means.__getitem__)
    interval = flown_task.interval if len(x) == 1 else hierarchical_bootstrap
    wins = float(paired_wins(x, ranked[rival]))
    lost = figures(episodes, "lost")

    def average(figure: str) -> float:
        return float(figures(episodes, figure).mean())

    def change(law: str) -> tuple[float, tuple[float, float], float | None]:
        if by == RETURN:
            return math.nan, _NONE, None
        draws = hierarchical_draws(relative_change, x, ranked[law], resamples=_RESAMPLES)
        p = None if name in flown_task.laws else sign_probability(draws)
        return float(relative_change(x, ranked[law])), interval_of(draws), p

    def in_metres(
        statistic: Callable[..., Any], values: Array
    ) -> tuple[float, tuple[float, float]]:
        if by == RETURN:
            return math.nan, _NONE
        return float(statistic(values)), interval(statistic, values, resamples=_RESAMPLES)

    def improvement(a: Any, b: Any) -> Any:
        return probability_of_improvement(-a, -b)

    rmse, returns = figures(episodes, "rmse"), figures(episodes, "total_reward")
    whole, whole_ci = in_metres(mean, rmse)
    settled, settled_ci = in_metres(mean, x)
    iqm, iqm_ci = in_metres(interquartile_mean, x)
    over_rival, over_best = change(rival), change(best)
    better = hierarchical_bootstrap(improvement, x, ranked[rival], resamples=_RESAMPLES)
    return Standing(
        controller=name,
        scenario=scenario,
        episodes=x.shape[1],
        seed=seed,
        rmse_m=whole,
        rmse_ci95_m=whole_ci,
        median_rmse_m=float(np.median(rmse)),
        lost_fraction=float(lost.mean()),
        score=_share(means["hover"], means[name], means.get("oracle", math.nan)),
        wins_over_admittance=wins if rival == "admittance" else math.nan,
        task=task,
        rival=rival,
        wins_over_rival=wins,
        change_over_rival=over_rival[0],
        change_ci95=over_rival[1],
        improvement_over_rival=float(improvement(x, ranked[rival])),
        best_law=best,
        change_over_best=over_best[0],
        change_over_best_ci95=over_best[1],
        p_over_best=over_best[2],
        policies=len(x),
        most_lost_fraction=float(lost.mean(axis=1).max()),
        share_of_limit=_share(means[rival], means[name], means.get("limit", math.nan)),
        ranked_by=by,
        rmse_settled_m=settled,
        rmse_settled_ci95_m=settled_ci,
        rmse_transient_m=average("rmse_transient"),
        iqm_rmse_m=iqm,
        iqm_ci95_m=iqm_ci,
        improvement_ci95=better,
        return_mean=float(returns.mean()),
        return_ci95=interval(mean, returns, resamples=_RESAMPLES),
        command_activity=average("command_activity"),
        saturated_fraction=average("saturated_fraction"),
        lost_episodes=int(lost.sum()),
        uses_truth=average("uses_truth") > 0.0,
    )


def _share(start: float, here: float, end: float) -> float:
    """Return the share of the way from one figure to a better one; not a number without a way."""
    return (start - here) / (start - end) if start > end else math.nan


def _corrected(rows: Sequence[Standing]) -> list[Standing]:
    """Return the rows with p-values corrected (Holm) for all rows on a page."""
    claims = {id(row): row.p_over_best for row in shown(rows) if row.p_over_best is not None}
    p = dict(zip(claims, holm(list(claims.values())).tolist(), strict=True))
    return [replace(row, p_over_best=p.get(id(row))) for row in rows]


def shown(rows: Sequence[Standing]) -> list[Standing]:
    """Return the rows without single policies of a kind with its own row."""
    kinds = {row.controller for row in rows if row.policies > 1}
    return [row for row in rows if row.controller.rpartition("-")[0] not in kinds]
