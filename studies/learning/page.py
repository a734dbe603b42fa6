"""What the page of the leaderboard shows."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from windwrench.controllers.flight_response import half_response
from windwrench.runtime.errors import InputError
from windwrench.studies.learning.scores import (
    Line,
    Result,
    Row,
    best_of,
    compare,
    lines_of,
    overall,
    rows_of,
)
from windwrench.studies.learning.study import KEPT, Places, load_plan, missing_of, read_results
from windwrench.training.training_envs import TIERS

MAIN = ("base", "fast")
_FIRST_COMMIT, _FIRST_VERSION = "a491f14", "0.1.0"  # of results that state none


def page(places: Places = KEPT, plan: Mapping[str, Any] | None = None) -> dict[str, Any]:
    """Return what the page shows of the results in a folder; default: of those that are kept.

    Raises:
        InputError: the results do not hold hover, oracle, admittance and ratio.
    """
    plan = plan or load_plan()
    results = read_results(places)
    lines, rows = lines_of(results, plan), rows_of(results, plan)
    if not rows:
        raise InputError(
            f"{places.results}: holds no scores of hover, oracle, admittance and ratio; "
            "python -m studies.learning --train --only designed makes them"
        )
    worlds = list(dict.fromkeys(row.world for row in rows))
    plain = [world for world in worlds if plan["worlds"][world] == {"scenario": world}]
    table: dict[str, dict[str, Row]] = {}
    for row in rows:
        table.setdefault(row.name, {})[row.world] = row
    return {
        "plan": plan,
        "commits": [r.get("commit", _FIRST_COMMIT) for r in results],
        "version": max(r.get("version", _FIRST_VERSION) for r in results),
        "rows": table,
        "lines": [line for line in lines if line.group != "ablation"],
        "worlds": worlds,
        "main": [world for world in MAIN if world in worlds],
        "best": {w: _best(rows, w) for w in worlds},
        "overall": overall(lines, plain),
        "plain": plain,
        "wide": list(dict.fromkeys(TIERS["wide"])),
        "half_response": half_response(),
        "target": target(rows),
        "verdicts": [v for world in MAIN if (v := verdict(rows, lines, world))],
        "limits": limits(results, rows, plan),
        "ablations": ablations(results, plan),
        "training": training(results, lines),
        "missing": missing_of(plan, places),
    }


def _get(rows: Sequence[Row], name: str, world: str) -> Row | None:
    return next((row for row in rows if row.name == name and row.world == world), None)


def _best(rows: Sequence[Row], world: str) -> str:
    """Return the controller with the smallest mean RMSE, but for the oracle and the limit."""
    some = [r for r in rows if r.world == world and r.name not in ("oracle", "limit")]
    return min(some, key=lambda row: row.rmse_m).name


def verdict(rows: Sequence[Row], lines: Sequence[Line], world: str) -> dict[str, Any] | None:
    """Return how learned policies do in a world against a tracker, the law ``lead``, and the best
    tracker that knows the family of motions, as whoever learned from these motions does.
    """
    some = [row for row in rows if row.world == world]
    learned = [row for row in some if row.group == "learned"]
    if not learned or any("tracker" not in row.against for row in learned):
        return None
    best = learned[0]
    lead = best.against["lead"]
    even = lead.interval[0] <= 0 <= lead.interval[1]
    line = next(x for x in lines if x.name == best.name)
    rival = best_of(lines, "tracker-informed", world)
    return {
        "world": world,
        "kinds": len(learned),
        "worse": sum(row.against["tracker"].interval[0] > 0 for row in learned),
        "better": sum(row.against["tracker"].interval[1] < 0 for row in learned),
        "best": best,
        "lead": "no clear difference" if even else "better" if lead.change < 0 else "worse",
        "informed": next((r for r in some if r.name.startswith("tracker-informed")), None),
        "against_informed": rival and compare(line.rmse[world], rival, world),
    }


def target(rows: Sequence[Row]) -> dict[str, Any] | None:
    """Return the kind of policy that comes closest to the target: no policy loses a vehicle, and
    each is at or below the tracker in both main worlds.
    """
    kinds: dict[str, list[Row]] = {}
    for world in MAIN:
        for row in rows:
            if row.world == world and row.group == "learned" and "tracker" in row.against:
                kinds.setdefault(row.name, []).append(row)

    def below(row: Row) -> int:
        rival = _get(rows, row.against["tracker"].rival, row.world)
        return 0 if rival is None else sum(seed <= rival.rmse_m for seed in row.by_seed)

    def lost(row: Row) -> int:
        return round(row.lost_fraction * row.seeds * row.episodes)

    if not kinds:
        return None
    name = max(kinds, key=lambda kind: (min(map(below, kinds[kind])), -sum(map(lost, kinds[kind]))))
    told: list[dict[str, Any]] = [
        {"row": row, "below": below(row), "lost": lost(row)} for row in kinds[name]
    ]
    reached = all(one["below"] == one["row"].seeds and not one["lost"] for one in told)
    return {"name": name, "reached": reached, "worlds": told}


def limits(
    results: Sequence[Result], rows: Sequence[Row], plan: Mapping[str, Any]
) -> list[dict[str, Any]]:
    """Return for each world what the best controller could reach, flown and bounded."""
    found: Result = next((r for r in results if r["name"] == "limit"), {"scores": {}})
    out = []
    for world in dict.fromkeys(row.world for row in rows):
        bounds = found["scores"].get(world, {}).get("bound_m")
        flown, oracle = _get(rows, "limit", world), _get(rows, "oracle", world)
        if not bounds or flown is None or oracle is None:
            continue
        learned = [r for r in rows if r.world == world and r.group == "learned"]
        tracker = flown.against.get("tracker")
        out.append(
            {
                "world": world,
                "tracker": tracker and _get(rows, tracker.rival, world),
                "learned": learned[0] if learned else None,
                "flown": flown,
                "bound": float(np.mean(bounds[: plan["episodes"]])),
                "oracle": oracle,
            }
        )
    return out


def ablations(results: Sequence[Result], plan: Mapping[str, Any]) -> list[dict[str, Any]]:
    """Return each change of the ablation with its rows by world, and the change of the mean RMSE
    against the reference.
    """
    ablation = plan["ablation"]
    rows = rows_of(results, plan, ablation=True) if ablation else []
    if not rows:
        return []
    reference = {row.world: row for row in rows if row.name == ablation["reference"]}
    out = []
    for name in [ablation["reference"], *ablation["changes"]]:
        mine = {row.world: row for row in rows if row.name == name}
        gaps = {
            world: row.rmse_m / reference[world].rmse_m - 1
            for world, row in mine.items()
            if world in reference and name != ablation["reference"]
        }
        out.append({"name": name, "rows": mine, "gaps": gaps})
    return out


def training(results: Sequence[Result], lines: Sequence[Line]) -> list[dict[str, Any]]:
    """Return the cost of each kind of learned policy, and its RMSE (m) on fast by seed."""
    out = []
    for line in lines:
        runs = [r["training"] for r in results if r["name"] == line.name and "training" in r]
        if line.group == "learned" and runs:
            minutes = sorted(run["seconds"] / 60 for run in runs)
            fast = line.rmse["fast"].mean(axis=1).tolist() if "fast" in line.rmse else []
            out.append(
                {
                    "name": line.name,
                    "trained_on": line.trained_on,
                    "seeds": len(runs),
                    "decisions": runs[0]["steps"][-1],
                    "minutes": (minutes[0], minutes[-1]),
                    "fast": fast,
                }
            )
    return out
