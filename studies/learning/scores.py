"""The numbers of the study's leaderboard, from its result files."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from windwrench.evaluation.statistics import (
    hierarchical_bootstrap,
    hierarchical_draws,
    interquartile_mean,
    interval_of,
    mean,
    paired_wins,
    probability_of_improvement,
    relative_change,
    sign_probability,
)

Array = NDArray[np.float64]
Result = Mapping[str, Any]
Interval = tuple[float, float]
REFERENCES = ("hover", "oracle")
# laws that every controller is compared with, each with its best gains; two must have flown
NEEDED = ("admittance", "ratio")
RIVALS = (*NEEDED, "lead", "tracker")
_CLAIM_RESAMPLES = 4_000  # enough for a p-value that is corrected for a hundred claims


@dataclass(frozen=True)
class Line:
    """All that is known of one controller: RMSE (seeds, episodes) in m and losses,
    world by world.
    """

    name: str
    group: str
    trained_on: str
    rmse: dict[str, Array]
    lost: dict[str, Array]


@dataclass(frozen=True)
class Comparison:
    """One controller against a rival. ``change`` is relative to the rival's mean RMSE: -0.1 is ten
    per cent less error.
    """

    rival: str
    change: float
    interval: Interval  # 95 %, over policies and episodes, as all of them
    p: float  # two-sided, of no change
    wins: float  # paired episodes with a smaller RMSE
    improvement: float  # probability of improvement
    improvement_interval: Interval


@dataclass(frozen=True)
class Row:
    """One controller in one world."""

    world: str
    name: str
    group: str
    seeds: int
    episodes: int
    rmse_m: float
    interval: Interval  # 95 %, over policies and episodes
    by_seed: tuple[float, ...]
    median_m: float
    lost_fraction: float
    lost_interval: Interval
    score: float  # 0: hover, 1: oracle
    share: float | None  # of the way from the admittance law to the limit, where that has flown
    against: dict[str, Comparison]  # by law: with the gains that are best in this very world


def lines_of(results: Sequence[Result], plan: Mapping[str, Any]) -> list[Line]:
    """Return the controllers of the study, those of which something is known, in
    the plan's order.
    """
    episodes = plan["episodes"]
    names = [*plan["designed"], *plan["learned"]]
    if plan["ablation"]:
        names += [plan["ablation"]["reference"], *plan["ablation"]["changes"]]
    lines = []
    for name in names:
        some = sorted(
            (r for r in results if r["name"] == name),
            key=lambda r: -1 if r["seed"] is None else r["seed"],
        )
        rmse: dict[str, Array] = {}
        lost: dict[str, Array] = {}
        for world in plan["worlds"]:
            flown = [
                s
                for r in some
                if len((s := r["scores"].get(world, {})).get("rmse_m", ())) >= episodes
            ]
            if flown:
                rmse[world] = np.array([s["rmse_m"][:episodes] for s in flown], dtype=np.float64)
                lost[world] = np.array([s["lost"][:episodes] for s in flown], dtype=np.float64)
        if rmse:
            lines.append(Line(name, some[0]["group"], some[0].get("scenario", ""), rmse, lost))
    return lines


def best_of(lines: Sequence[Line], law: str, world: str) -> Line | None:
    """Return the law with the gains, tuned or as it comes, that have the smallest mean RMSE in this
    very world.

    The choice looks at the test episodes, which favours the law and nobody else.
    """
    some = [
        x
        for x in lines
        if x.group == "designed"
        and (x.name == law or x.name.startswith(f"{law}-tuned"))
        and world in x.rmse
    ]
    return min(some, key=lambda x: float(x.rmse[world].mean()), default=None)


def compare(x: Array, rival: Line, world: str) -> Comparison:
    """Return how errors (seeds, episodes) in a world compare with a rival's."""
    y = rival.rmse[world]
    draws = hierarchical_draws(relative_change, x, y, resamples=_CLAIM_RESAMPLES)
    return Comparison(
        rival=rival.name,
        change=float(relative_change(x, y)),
        interval=interval_of(draws),
        p=sign_probability(draws),
        wins=float(paired_wins(x, y)),
        improvement=float(probability_of_improvement(-x, -y)),
        improvement_interval=hierarchical_bootstrap(probability_of_improvement, -x, -y),
    )


def rows_of(
    results: Sequence[Result], plan: Mapping[str, Any], ablation: bool = False
) -> list[Row]:
    """Return the rows of the leaderboard, or of the ablations, world by world, best first."""
    lines = lines_of(results, plan)
    by_name = {x.name: x for x in lines}
    rows = []
    for world in plan["worlds"]:
        if any(name not in by_name or world not in by_name[name].rmse for name in REFERENCES):
            continue
        hover, oracle = (float(by_name[name].rmse[world].mean()) for name in REFERENCES)
        rivals = {law: best_of(lines, law, world) for law in RIVALS}
        if any(rivals[law] is None for law in NEEDED):
            continue
        some = []
        for line in lines:
            if world not in line.rmse or (line.group == "ablation") is not ablation:
                continue
            x = line.rmse[world]
            some.append(
                Row(
                    world=world,
                    name=line.name,
                    group=line.group,
                    seeds=len(x),
                    episodes=x.shape[1],
                    rmse_m=float(x.mean()),
                    interval=hierarchical_bootstrap(mean, x),
                    by_seed=tuple(x.mean(axis=1).tolist()),
                    median_m=float(np.median(x)),
                    lost_fraction=float(line.lost[world].mean()),
                    lost_interval=hierarchical_bootstrap(mean, line.lost[world]),
                    score=(hover - float(x.mean())) / (hover - oracle),
                    share=_share(by_name, world, float(x.mean())),
                    against={
                        law: compare(x, rival, world)
                        for law, rival in rivals.items()
                        if rival is not None
                    },
                )
            )
        rows.extend(sorted(some, key=lambda row: row.rmse_m))
    return rows


def _share(by_name: Mapping[str, Line], world: str, rmse: float) -> float | None:
    ends = [by_name[n].rmse.get(world) if n in by_name else None for n in ("admittance", "limit")]
    if ends[0] is None or ends[1] is None:
        return None
    start, end = (float(x.mean()) for x in ends if x is not None)
    return (start - rmse) / (start - end) if start > end else None


def normalised(line: Line, lines: Sequence[Line], worlds: Sequence[str]) -> Array | None:
    """Return scores (seeds, worlds * episodes) between hover (0) and oracle (1) of each world; None
    where one is missing.
    """
    by_name = {x.name: x for x in lines}
    if any(
        world not in line.rmse or any(world not in by_name[n].rmse for n in REFERENCES)
        for world in worlds
    ):
        return None
    columns = []
    for world in worlds:
        hover, oracle = (float(by_name[n].rmse[world].mean()) for n in REFERENCES)
        columns.append((hover - line.rmse[world]) / (hover - oracle))
    seeds = min(len(c) for c in columns)
    return np.concatenate([c[:seeds] for c in columns], axis=1)


@dataclass(frozen=True)
class Aggregate:
    """One controller over several worlds: mean of its scores, none of them left out."""

    name: str
    seeds: int
    score: float
    interval: Interval  # 95 %, over policies and episodes
    middle: float  # interquartile mean, of the middle half of the scores
    middle_interval: Interval
    lost: float  # share of all episodes
    lost_interval: Interval


def aggregate(lines: Sequence[Line], worlds: Sequence[str]) -> list[Aggregate]:
    """Return what controllers reach over all worlds, best mean score first; the interquartile mean,
    which does not see a lost episode, stands beside it, not in its place.
    """
    found = []
    for line in lines:
        scores = None if line.group == "ablation" else normalised(line, lines, worlds)
        if scores is None:
            continue
        lost = np.concatenate([line.lost[w][: len(scores)] for w in worlds], axis=1)
        blocks = len(worlds)
        found.append(
            Aggregate(
                name=line.name,
                seeds=len(scores),
                score=float(mean(scores)),
                interval=hierarchical_bootstrap(mean, scores, blocks=blocks),
                middle=float(interquartile_mean(scores)),
                middle_interval=hierarchical_bootstrap(interquartile_mean, scores, blocks=blocks),
                lost=float(lost.mean()),
                lost_interval=hierarchical_bootstrap(mean, lost, blocks=blocks),
            )
        )
    return sorted(found, key=lambda one: -one.score)
