"""One scorer of diagnoses whose truth is known, and how counts are told on pages.

A name *stands for* an effect where the name is the effect, or where the diagnosis says that these
flights cannot tell the two apart.
"""

import itertools
from collections.abc import Mapping, Sequence
from typing import Any

from scipy.stats import binomtest, mannwhitneyu

Effect = Mapping[str, Any]  # name, tentative, indistinguishable_from, coefficients, std
Truth = Mapping[str, Mapping[str, float]]  # coefficients by effect

# Effects that leave the very log that another one leaves, whatever is flown. A latency is a
# positive clock offset. A thrust scale is a rotor efficiency with four equal numbers. A turned
# world frame turns all forces but the assumed weight, which leaves a constant horizontal force.
EQUIVALENTS: Mapping[str, tuple[str, ...]] = {
    "latency": ("clock_offset",),
    "clock_offset": ("latency",),
    "thrust_scale": ("rotor_efficiency",),
    "world_tilt": ("constant_force",),
}


def stands_for(effect: Effect) -> set[str]:
    """Return the effects that a name stands for."""
    return {effect["name"], *effect["indistinguishable_from"]}


def match(effects: Sequence[Effect], truth: Sequence[str]) -> list[tuple[str, str]] | None:
    """Return pairs (name, added effect) where names and added effects stand for each other one by
    one, else None. Of several ways, the one with most names equal is returned.
    """
    if len(effects) != len(truth):
        return None
    ways = [
        [(str(e["name"]), added) for e, added in zip(effects, order, strict=True)]
        for order in itertools.permutations(truth)
        if all(added in stands_for(e) for e, added in zip(effects, order, strict=True))
    ]
    return max(ways, key=lambda pairs: sum(a == b for a, b in pairs), default=None)


def coefficient_errors(
    effects: Sequence[Effect], truth: Truth, pairs: Sequence[tuple[str, str]]
) -> dict[str, tuple[float, float]]:
    """Return, for each coefficient that is not zero in the truth, its relative error and its error
    in standard deviations.

    Only names that are the added effect's own are compared, and a latency with a clock offset,
    which is the same number.
    """
    by_name = {e["name"]: e for e in effects}
    out = {}
    for name, added in pairs:
        true, e = truth[added], by_name[name]
        if name != added:
            one_each = len(true) == len(e["coefficients"]) == 1
            if name not in EQUIVALENTS.get(added, ()) or not one_each:
                continue
            e = {k: dict(zip(true, e[k].values(), strict=True)) for k in ("coefficients", "std")}
        for c, value in true.items():
            if value != 0.0 and c in e["coefficients"]:
                miss, std = abs(e["coefficients"][c] - value), e["std"].get(c) or float("nan")
                out[f"{added}.{c}"] = (float(miss / abs(value)), float(miss / std))
    return out


def share(count: int, whole: int) -> str:
    """Return a count of a whole and its 95 % interval (Wilson) in per cent."""
    if not whole:
        return "–"
    low, high = binomtest(count, whole).proportion_ci(method="wilson")
    return f"{count} of {whole} ({100 * low:.0f}–{100 * high:.0f} %)"


def area_under_curve(strange: Sequence[float], known: Sequence[float]) -> str:
    """Return how often a number of ``strange`` is above one of ``known``, with both counts."""
    if not strange or not known:
        return "–"
    area = float(mannwhitneyu(strange, known).statistic) / (len(strange) * len(known))
    return f"{area:.3f} ({len(strange)} against {len(known)})"
