"""What the page of the trials shows: the rules, a row an effect, and every miss."""

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from windwrench.studies.pages import kept
from windwrench.studies.scoring import EQUIVALENTS
from windwrench.studies.trials.held_back_outsiders import UNSEEN
from windwrench.studies.trials.judgements import (
    COEFFICIENT_BAR,
    FAILED,
    OUTCOMES,
    RIGHT,
    WRONG,
    Judgement,
    doubts,
    judge,
    left_out,
    rules,
)

RESULTS = "diagnosis-trials/trials.json.gz"  # below docs/


def effect_rows(judged: Sequence[Judgement]) -> list[dict[str, Any]]:
    """Return a row for each effect that was flown alone, with the whole library and without."""
    alone = [j for j in judged if j.group in ("typical", "third", "preset") and not j.without]
    without = [j for size in ("typical", "small") for j in left_out(judged, size)]
    rows = []
    for cause in sorted({j.cause for j in alone}):
        mine = [j for j in alone if j.cause == cause]
        typical = [j for j in mine if j.group != "third"]
        third = [j for j in mine if j.group == "third"]
        missing = [j for j in without if j.cause == cause]
        worst = [max(e for e, _ in j.errors.values()) for j in typical if j.errors]
        rows.append(
            {
                "effect": cause,
                "typical": f"{sum(j.right for j in typical)} of {len(typical)}",
                "third": f"{sum(j.right for j in third)} of {len(third)}",
                "tentative": sum(j.right and j.outcome != RIGHT for j in mine),
                "worst": f"{np.median(worst):.1%}, {max(worst):.1%}" if worst else "–",
                "floor": f"{max(j.floor_ratio for j in mine):.2f}",
                "rollout": f"{np.median([j.rollout_ratio for j in typical]):.2f} "
                f"({np.median([j.rollout_of_truth for j in typical]):.2f})",
                "left_out": f"{sum(j.outcome not in (WRONG, FAILED) for j in missing)} "
                f"of {len(missing)}",
            }
        )
    return rows


def group_rows(judged: Sequence[Judgement]) -> list[dict[str, Any]]:
    """Return how often each outcome came, for each group of flights and library."""
    counted = {id(j) for size in ("typical", "small") for j in left_out(judged, size)}
    rows: dict[str, list[Judgement]] = {}
    for j in judged:
        if j.without and id(j) not in counted:
            continue  # an equivalent was left in, and is named, as it must be
        group = f"{j.group}, left out" if j.without else j.group
        rows.setdefault(group, []).append(j)
    return [
        {"group": group, "counts": [sum(j.outcome == name for j in some) for name in OUTCOMES]}
        for group, some in rows.items()
    ]


def misses(judged: Sequence[Judgement]) -> list[str]:
    """Return in words each judgement that falls short of the rules."""
    counted = {id(j) for size in ("typical", "small") for j in left_out(judged, size)}
    lines = []
    for j in judged:
        if what := _miss(j, id(j) in counted):
            without = f", without {', '.join(j.without)}" if j.without else ""
            vehicle = "" if j.vehicle == "ardrone2" else f", {j.vehicle}"
            lines.append(f"{j.cause} ({j.group}, {j.flight}{vehicle}{without}): {what}")
    return lines


def _miss(j: Judgement, is_left_out: bool) -> str:
    """Return in words how a judgement falls short of the rules; empty where it does not."""
    named = ", ".join(j.named) or "-"
    if j.outcome == FAILED:
        return f"ended in an error: {j.problem}"
    if j.without or j.group == "hover":
        wrong = j.outcome == WRONG and (is_left_out or not j.without)
        return f"confidently wrong: {named}" if wrong else ""
    if j.group in ("outsider", "held back"):
        return "" if doubts(j) else f"{j.verdict}: {named}"
    if j.outcome != RIGHT:
        return f"{j.outcome}: {named}" + (f" ({j.gave_away})" if j.gave_away else "")
    if j.group in ("typical", "preset", "rotorpy"):
        far = [
            f"{c} by {e:.1%} ({s:.1f} standard deviations)"
            for c, (e, s) in j.errors.items()
            if e > COEFFICIENT_BAR
        ]
        return f"the right name, but off: {', '.join(far)}" if far else ""
    return ""


def page(found: Mapping[str, Any] | None = None) -> dict[str, Any]:
    """Return what the page shows of results; default: of those that are kept."""
    result = found or kept(RESULTS)
    outcomes: Iterable[Mapping[str, Any]] = result["trials"]
    judged = [j for outcome in outcomes for j in judge(outcome)]
    seconds = [j.seconds for j in judged] or [0.0]
    return {
        "command": command(result),
        "version": result["version"],
        "commit": result["commit"],
        "flights": len(result["trials"]),
        "diagnoses": len(judged),
        "rules": rules(judged),
        "outcomes": OUTCOMES,
        "groups": group_rows(judged),
        "effects": effect_rows(judged),
        "equivalents": EQUIVALENTS,
        "unseen": list(UNSEEN),
        "misses": misses(judged),
        "not_flown": [o for o in outcomes if "error" in o],
        "seconds": {"median": float(np.median(seconds)), "most": max(seconds)},
    }


def command(result: Mapping[str, Any]) -> str:
    """Return the command line that gives these results."""
    words = [f"python -m studies.trials --seed {result['seed']} --seeds {result['seeds']}"]
    words += ["--quick"] if result["quick"] else []
    words += [f"--group '{group}'" for group in result.get("groups", ())]
    return " ".join(words)
