"""The leaderboard of a task: controllers, and kinds of policies, scored between hover (0) and
oracle (1).
"""

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path

import numpy as np

from ..controllers.registry import STANDARD_TASK
from ..runtime.page_files import write_text
from .benchmark import Results
from .episodes import Episode
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
from .tasks import TASKS, short_names

_RESAMPLES = 4_000
_CLEAR = 0.05  # p-value, corrected


@dataclass(frozen=True)
class Standing:
    """One line of a leaderboard: a law, a policy, or all policies of a kind."""

    controller: str
    scenario: str
    episodes: int  # of each policy
    seed: int
    rmse_m: float  # mean over episodes
    rmse_ci95_m: tuple[float, float]  # over episodes; of a kind, over policies and episodes
    median_rmse_m: float
    lost_fraction: float
    score: float  # (hover - this) / (hover - oracle), of the means
    wins_over_admittance: float  # null where the task has no admittance law
    task: str
    rival: str  # the law of ``wins_over_rival``
    wins_over_rival: float  # share of the paired episodes with a smaller RMSE; a tie is half
    change_over_rival: float  # of the mean RMSE
    change_ci95: tuple[float, float]  # over policies and episodes
    improvement_over_rival: float  # probability of improvement
    best_law: str  # the designed law with the smallest mean RMSE in this scenario, of those flown
    change_over_best: float
    change_over_best_ci95: tuple[float, float]
    # of no change, corrected (Holm); null for laws, and for policies of a kind
    p_over_best: float | None
    policies: int  # counted together in this row
    most_lost_fraction: float  # of the policy with most losses
    # (rival - this) / (rival - limit), of the means: share of the way from the rival to the best
    # possible by the measurements; null where ``limit`` does not fly
    share_of_limit: float = math.nan


def leaderboard(
    results: Results, controllers: Sequence[str], seed: int, task: str = STANDARD_TASK
) -> list[Standing]:
    """Return the leaderboard's rows, scenario by scenario, best first.

    The kit's policies of one kind (``sac-0``, ``sac-1``) have a row each, and one as a kind
    (``sac``). The kind's intervals are for other training seeds, too.
    """
    names, known = list(dict.fromkeys(controllers)), TASKS[task]
    kinds: dict[str, list[str]] = {}
    for name in names:
        if name in known.policies():
            kinds.setdefault(name.rpartition("-")[0], []).append(name)
    kinds = {kind: each for kind, each in kinds.items() if len(each) > 1}
    rows: list[Standing] = []
    for scenario in dict.fromkeys(s for _, s in results):
        flown = {
            name: [results[each, scenario] for each in kinds.get(name, [name])]
            for name in [*known.references(names), *kinds]
            if name in kinds or (name, scenario) in results
        }
        some = [_row(task, scenario, seed, name, flown) for name in [*names, *kinds]]
        rows.extend(sorted(some, key=lambda row: row.rmse_m))
    return _corrected(rows)


def _row(
    task: str,
    scenario: str,
    seed: int,
    name: str,
    flown: Mapping[str, Sequence[Sequence[Episode]]],
) -> Standing:
    """Return the row of a law, a policy or a kind; ``flown`` holds the episodes of each policy."""
    known = TASKS[task]
    rmse = {law: np.array([[e.rmse for e in one] for one in of]) for law, of in flown.items()}
    means = {law: float(of.mean()) for law, of in rmse.items()}
    designed = [law for law in known.laws if law in rmse and law not in ("hover", *known.bounds)]
    best = min(designed, key=means.__getitem__)
    rival, x = known.rival, rmse[name]
    over_rival, over_best = (
        hierarchical_draws(relative_change, x, rmse[law], resamples=_RESAMPLES)
        for law in (rival, best)
    )
    interval = known.interval if len(x) == 1 else hierarchical_bootstrap
    wins = float(paired_wins(x, rmse[rival]))
    lost = [float(np.mean([e.lost for e in one])) for one in flown[name]]
    return Standing(
        controller=name,
        scenario=scenario,
        episodes=x.shape[1],
        seed=seed,
        rmse_m=means[name],
        rmse_ci95_m=interval(mean, x, resamples=_RESAMPLES),
        median_rmse_m=float(np.median(x)),
        lost_fraction=float(np.mean(lost)),
        score=_share(means["hover"], means[name], means["oracle"]),
        wins_over_admittance=wins if rival == "admittance" else math.nan,
        task=task,
        rival=rival,
        wins_over_rival=wins,
        change_over_rival=float(relative_change(x, rmse[rival])),
        change_ci95=interval_of(over_rival),
        improvement_over_rival=float(probability_of_improvement(-x, -rmse[rival])),
        best_law=best,
        change_over_best=float(relative_change(x, rmse[best])),
        change_over_best_ci95=interval_of(over_best),
        p_over_best=None if name in known.laws else sign_probability(over_best),
        policies=len(x),
        most_lost_fraction=max(lost),
        share_of_limit=_share(means[rival], means[name], means.get("limit", math.nan)),
    )


def _share(start: float, here: float, end: float) -> float:
    """Return the share of the way from one RMSE to a smaller one; not a number without a way."""
    return (start - here) / (start - end) if start > end else math.nan


def _corrected(rows: Sequence[Standing]) -> list[Standing]:
    """Return the rows with p-values corrected (Holm) for all rows on a page."""
    claims = {id(row): row.p_over_best for row in shown(rows) if row.p_over_best is not None}
    p = dict(zip(claims, holm(list(claims.values())).tolist(), strict=True))
    return [replace(row, p_over_best=p.get(id(row))) for row in rows]


def write_leaderboard(rows: Sequence[Standing], folder: Path) -> Path:
    """Write the rows as ``leaderboard.json``, at once or not at all; return its path.

    A number without a meaning is null.
    """
    path = folder / "leaderboard.json"
    data = [
        {key: None if value != value else value for key, value in asdict(row).items()}
        for row in rows
    ]
    write_text(json.dumps(data, indent=1, allow_nan=False) + "\n", path)
    return path


def shown(rows: Sequence[Standing]) -> list[Standing]:
    """Return the rows without single policies of a kind with its own row."""
    kinds = {row.controller for row in rows if row.policies > 1}
    return [row for row in rows if row.controller.rpartition("-")[0] not in kinds]


def summary(rows: Sequence[Standing]) -> str:
    """Return the rows in words, a scenario a line: losses first, then the policies better or worse
    than the best designed law at a corrected p-value below 0.05.
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
            f"* **{scenario}**, {some[0].episodes} episodes each. Terminated: {told}. Against the "
            f"best designed law there, `{some[0].best_law}`: clearly worse {_listed(worse)}; "
            f"clearly better {_listed(better)}."
        )
    return "\n".join(lines) + "\n" if lines else ""


def _listed(rows: Sequence[Standing]) -> str:
    return (
        ", ".join(
            f"`{row.controller}` {_told(row.change_over_best, row.change_over_best_ci95)}"
            for row in rows
        )
        or "none"
    )


def _lost(row: Standing) -> str:
    told = f"{100 * row.lost_fraction:.1f} %"
    if row.most_lost_fraction > row.lost_fraction:
        told += f" (most {100 * row.most_lost_fraction:.1f} %)"
    return told


def table(rows: Sequence[Standing]) -> dict[str, list[str]]:
    """Return the rows as columns of text by their titles: policies as kinds."""
    rows = shown(rows)
    names = short_names([row.controller for row in rows])
    columns: dict[str, list[str]] = {}
    for row in rows:
        low, high = row.rmse_ci95_m
        p, designed = row.p_over_best, row.controller in TASKS[row.task].laws
        cells = {
            "scenario": row.scenario,
            "law": names[row.controller],
            "policies": "-" if designed else str(row.policies),
            "RMSE (m), 95 %": f"{row.rmse_m:.3f} ({low:.3f}-{high:.3f})",
            "median": f"{row.median_rmse_m:.3f}",
            "terminated": _lost(row),
            "score": f"{row.score:.2f}",
            "wins": f"{100 * row.wins_over_rival:.0f} %",
            "P": f"{row.improvement_over_rival:.2f}",
            f"against {row.rival}, 95 %": _told(row.change_over_rival, row.change_ci95),
            "against the best law, 95 %": _told(row.change_over_best, row.change_over_best_ci95),
            "p": "-" if p is None else f"{p:.3f}",
        }
        if not math.isnan(row.share_of_limit):
            cells["to the limit"] = f"{100 * row.share_of_limit:.0f} %"
        for title, text in cells.items():
            columns.setdefault(title, []).append(text)
    return columns


def markdown(rows: Sequence[Standing]) -> str:
    """Return the rows as a table for a page."""
    columns = table(rows)
    left = ("scenario", "law", "RMSE", "against")
    rule = ["-" if title.startswith(left) else "-:" for title in columns]
    lines = [list(columns), rule, *zip(*columns.values(), strict=True)] if columns else []
    return "".join(f"| {' | '.join(line)} |\n" for line in lines)


def _told(change: float, interval: tuple[float, float]) -> str:
    return f"{100 * change:+.0f} % ({100 * interval[0]:+.0f} to {100 * interval[1]:+.0f})"
