"""Every judgement of a trial that falls short of the rules, in words."""

from collections.abc import Sequence

from windwrench.studies.trials.judgements import (
    COEFFICIENT_BAR,
    FAILED,
    RIGHT,
    WRONG,
    Judgement,
    doubts,
    left_out,
)


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
