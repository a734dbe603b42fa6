"""The leaderboard's numbers, from the study's result files."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .statistics import (
    interquartile_mean,
    mean,
    paired_wins,
    probability_of_improvement,
    relative_change,
    stratified_bootstrap,
)

Array = NDArray[np.float64]
Result = Mapping[str, Any]
Interval = tuple[float, float]
REFERENCES = ("hover", "oracle")


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
class Row:
    """One controller in one world. ``change`` is relative to a rival's mean RMSE: -0.1 is ten per
    cent less error.
    """

    world: str
    name: str
    group: str
    seeds: int
    episodes: int
    rmse_m: float
    interval: Interval  # 95 %, over seeds and episodes
    by_seed: tuple[float, ...]
    median_m: float
    lost_fraction: float
    score: float
    rival: str  # the admittance law with the gains that are best in this very world
    change: float
    change_interval: Interval
    wins: float
    improvement: float
    ratio_rival: str
    ratio_change: float
    ratio_interval: Interval


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
        x for x in lines if x.group == "designed" and x.name.startswith(law) and world in x.rmse
    ]
    return min(some, key=lambda x: float(x.rmse[world].mean()), default=None)


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
        admittance, ratio = best_of(lines, "admittance", world), best_of(lines, "ratio", world)
        if admittance is None or ratio is None:
            continue
        a, r = admittance.rmse[world], ratio.rmse[world]
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
                    interval=stratified_bootstrap(mean, x, tasks=True),
                    by_seed=tuple(x.mean(axis=1).tolist()),
                    median_m=float(np.median(x)),
                    lost_fraction=float(line.lost[world].mean()),
                    score=(hover - float(x.mean())) / (hover - oracle),
                    rival=admittance.name,
                    change=float(relative_change(x, a)),
                    change_interval=stratified_bootstrap(relative_change, x, a, tasks=True),
                    wins=float(paired_wins(x, a)),
                    improvement=float(probability_of_improvement(-x, -a)),
                    ratio_rival=ratio.name,
                    ratio_change=float(relative_change(x, r)),
                    ratio_interval=stratified_bootstrap(relative_change, x, r, tasks=True),
                )
            )
        rows.extend(sorted(some, key=lambda row: row.rmse_m))
    return rows


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


def aggregate(lines: Sequence[Line], worlds: Sequence[str]) -> list[tuple[str, float, Interval]]:
    """Return name, interquartile mean of the normalised score over all worlds, and its interval;
    best first.

    The interval is over training seeds, stratified by episode; a law that was designed has one run,
    and episodes vary.
    """
    found = []
    for line in lines:
        scores = None if line.group == "ablation" else normalised(line, lines, worlds)
        if scores is not None:
            interval = stratified_bootstrap(interquartile_mean, scores, tasks=len(scores) == 1)
            found.append((line.name, float(interquartile_mean(scores)), interval))
    return sorted(found, key=lambda one: -one[1])
