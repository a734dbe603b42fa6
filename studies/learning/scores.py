"""The numbers of the study's leaderboard, from its result files."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from windwrench.evaluation.statistics import (
    hierarchical_bootstrap,
    hierarchical_draws,
    interval_of,
    mean,
    relative_change,
)

Array = NDArray[np.float64]
Result = Mapping[str, Any]
Interval = tuple[float, float]
REFERENCES = ("hover", "oracle")
# laws that every controller is compared with, each with its best gains; two must have flown
NEEDED = ("admittance", "ratio")
RIVALS = (*NEEDED, "lead", "tracker")
_CLAIM_RESAMPLES = 4_000


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
                    against={
                        law: compare(x, rival, world)
                        for law, rival in rivals.items()
                        if rival is not None
                    },
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


def overall(lines: Sequence[Line], worlds: Sequence[str]) -> dict[str, tuple[float, Interval]]:
    """Return controllers' mean score over all worlds with its 95 % interval, best first."""
    found = {}
    for line in lines:
        scores = None if line.group == "ablation" else normalised(line, lines, worlds)
        if scores is not None:
            interval = hierarchical_bootstrap(mean, scores, blocks=len(worlds))
            found[line.name] = float(mean(scores)), interval
    return dict(sorted(found.items(), key=lambda one: -one[1][0]))
