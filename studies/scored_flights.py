"""One practice flight with at most one effect added, its diagnosis as data, and what that counts
as.
"""

from collections.abc import Mapping
from typing import Any

import numpy as np

from windwrench.dynamics import Vehicle
from windwrench.identification.findings import Diagnosis
from windwrench.runtime.errors import InputError
from windwrench.studies.trials.practice_flights import Practice, practise
from windwrench.studies.trials.scores import coefficient_errors, match

KINDS = ("wrong, sure", "wrong, tentative", "silent", "refused", "right, tentative", "right, sure")
_ATTEMPTS = 4  # draws of a flight that a flight loop may be unable to fly

Truth = Mapping[str, Mapping[str, float]]  # coefficients by effect


def fly(
    vehicle: Vehicle, effect: str, trajectory: str, seed: int, seconds: float, imu: bool = False
) -> Practice | None:
    """Return a flight with an effect of typical size (empty: none), drawn anew with the next seeds
    where no flight loop flies it; none where that does not help.
    """
    for attempt in range(_ATTEMPTS):
        try:
            return practise(
                vehicle,
                "effect" if effect else "nothing",
                (effect,) if effect else (),
                "typical",
                trajectory,
                seed + attempt,
                seconds,
                imu=imu,
            )
        except InputError:
            continue
    return None


def truth_of(flown: Practice) -> dict[str, dict[str, float]]:
    """Return what was added to a flight: coefficients by effect."""
    return {e.name: dict(e.coefficients) for e in flown.effects}


def scored(found: Diagnosis, truth: Truth) -> dict[str, Any]:
    """Return a diagnosis' verdict, its effects and each coefficient's error (relative, and in
    standard deviations) as data.
    """
    effects: list[dict[str, Any]] = [
        {
            "name": e.name,
            "tentative": e.tentative,
            "indistinguishable_from": list(e.indistinguishable_from),
            "coefficients": dict(e.coefficients),
            "std": dict(e.std),
            "channels": list(e.channels),
        }
        for e in found.effects
    ]
    pairs = match(effects, list(truth)) if effects else None
    own = [(e["name"], e["name"]) for e in effects if e["name"] in truth]
    return {
        "verdict": found.verdict,
        "remainder": found.remainder,
        "effects": effects,
        "errors": {
            key: [round(x, 4) for x in error]
            for key, error in coefficient_errors(effects, truth, pairs or own).items()
            if np.isfinite(error).all()
        },
    }


def refused(error: InputError) -> dict[str, Any]:
    """Return a refusal as ``scored`` returns a diagnosis."""
    return {"refused": str(error), "effects": [], "errors": {}}


def kind(outcome: Mapping[str, Any]) -> str:
    """Return what a diagnosis is, one of ``KINDS``: right or wrong, sure or tentative, silent
    (nothing named where something was added), or refused.
    """
    if "refused" in outcome:
        return "refused"
    effects, truth = outcome["effects"], [outcome["effect"]] if outcome["effect"] else []
    if not effects:
        return "silent" if truth else "right, sure"
    sure = [e for e in effects if not e["tentative"]]
    if any(not {e["name"], *e["indistinguishable_from"]} & set(truth) for e in sure):
        return "wrong, sure"
    right = match(effects, truth) is not None
    return (
        f"{'right' if right else 'wrong'}, {'sure' if len(sure) == len(effects) else 'tentative'}"
    )
