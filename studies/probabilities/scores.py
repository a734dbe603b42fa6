"""What the probabilities of ranked flights are worth: calibration, log score, false alarms, and the
coverage of coefficients' intervals.
"""

import itertools
import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from scipy.stats import mannwhitneyu

from windwrench.studies.page_tables import share, table
from windwrench.studies.resumed_tasks import Task
from windwrench.studies.trials.trials import EQUIVALENTS

_EDGES = (0.05, 0.2, 0.5, 0.8, 0.95, 1.0001)  # of the reliability diagram; below, nothing is named
_NAMED = 0.5  # probability from which an effect counts as named
_CERTAIN = 1e-4  # no probability counts as less than this in the log score


def tables(outcomes: Mapping[Task, dict[str, Any]]) -> str:
    """Return the scores of ranked flights as Markdown tables, each simulator apart."""
    parts = []
    sides = {task[0] == "own" for task in outcomes}
    for own in sorted(sides, reverse=True):
        some = [x for task, x in outcomes.items() if (task[0] == "own") == own]
        parts += [f"**{'Own flights' if own else 'The other simulator'}**", _summary(some)]
        parts += ["Names by their probability:", _reliability(some)]
    return "\n\n".join(parts)


def _known(flights: Sequence[dict[str, Any]]) -> list[dict[str, Any]]:
    """Return the flights whose whole truth is in the library."""
    return [x for x in flights if not x["outsider"] and not x["left_out"]]


def _claims(flights: Sequence[dict[str, Any]]) -> list[tuple[float, bool]]:
    """Return each name's probability and whether it is right, from the least that counts on."""
    return [
        (p, name in x["truth"] and name not in x["left_out"])
        for x in flights
        for name, p in x["probability"].items()
        if p >= _EDGES[0]
    ]


def expected_calibration_error(claims: Sequence[tuple[float, bool]]) -> float:
    """Return the mean distance of stated probability and share that is right, over bins."""
    total = 0.0
    for low, high in itertools.pairwise(_EDGES):
        inside = [x for x in claims if low <= x[0] < high]
        if inside:
            total += abs(sum(p - right for p, right in inside))
    return total / max(len(claims), 1)


def _reliability(flights: Sequence[dict[str, Any]]) -> str:
    rows = []
    claims = _claims(flights)
    for low, high in itertools.pairwise(_EDGES):
        inside = [x for x in claims if low <= x[0] < high]
        if inside:
            mean = float(np.mean([p for p, _ in inside]))
            rows.append(
                [
                    f"{low:g} to {min(high, 1.0):g}",
                    f"{mean:.3f}",
                    share(sum(right for _, right in inside), len(inside)),
                ]
            )
    return table(["probability", "mean", "right"], rows)


def _named(x: dict[str, Any], least: float = _NAMED) -> set[str]:
    return {name for name, p in x["probability"].items() if p > least}


def _same(name: str) -> set[str]:
    return {name, *EQUIVALENTS.get(name, ())}


def _is_right(x: dict[str, Any]) -> bool:
    """Return whether the likeliest set is the truth, or its exact equivalent."""
    none: dict[str, Any] = {"effects": []}
    best = max(x["sets"], key=lambda s: float(s["probability"]), default=none)
    found = set(best["effects"])
    truth = set(x["truth"])
    return len(found) == len(truth) and all(_same(name) & found for name in truth)


def _log_score(flights: Sequence[dict[str, Any]]) -> float:
    """Return the mean over flights of the logarithm of the probability of what is true, of all
    effects one by one.
    """
    scores = []
    for x in flights:
        value = 0.0
        for name, p in {**dict.fromkeys(x["truth"], 0.0), **x["probability"]}.items():
            q = float(np.clip(p, _CERTAIN, 1.0 - _CERTAIN))
            value += math.log(q if name in x["truth"] else 1.0 - q)
        scores.append(value)
    return float(np.mean(scores)) if scores else float("nan")


def _coverage(flights: Sequence[dict[str, Any]]) -> list[float]:
    """Return errors of coefficients in stated standard deviations, where the likeliest set is the
    truth.
    """
    out = []
    for x in flights:
        if not x["sets"] or set(x["sets"][0]["effects"]) != set(x["truth"]):
            continue
        best = x["sets"][0]
        for effect, values in x["truth"].items():
            for name, value in values.items():
                std = best["std"][effect].get(name, 0.0)
                if std > 0.0:
                    out.append(abs(best["coefficients"][effect][name] - value) / std)
    return out


def _area(strange: Sequence[float], known: Sequence[float]) -> str:
    if not strange or not known:
        return "–"
    area = float(mannwhitneyu(strange, known).statistic) / (len(strange) * len(known))
    return f"{area:.3f} ({len(strange)} against {len(known)})"


def _summary(flights: Sequence[dict[str, Any]]) -> str:
    known = _known(flights)
    nothing = [x for x in known if not x["truth"]]
    strange = [x for x in flights if x["outsider"] or x["left_out"]]
    claims = _claims(flights)
    rows = [
        ["flights", str(len(flights))],
        [
            "expected calibration error of names",
            f"{expected_calibration_error(claims):.3f} ({len(claims)} names of 0.05 and more)",
        ],
        ["log score a flight, all effects", f"{_log_score(known):.2f} ({len(known)} flights)"],
    ]
    for kind in ("single", "third", "pair", "catalogue"):
        some = [x for x in known if x["kind"] == kind and x["truth"]]
        if some:
            rows.append(
                [f"likeliest set is the truth: {kind}", share(sum(map(_is_right, some)), len(some))]
            )
    rows += [
        ["nothing missing, yet a name", share(sum(bool(_named(x)) for x in nothing), len(nothing))],
        [
            "outsiders and left-out effects, yet a name of 0.95 and more",
            share(sum(bool(_named(x, 0.95)) for x in strange), len(strange)),
        ],
        [
            "... of these with `unknown` below 0.5",
            share(sum(bool(_named(x, 0.95)) and x["unknown"] < 0.5 for x in strange), len(strange)),
        ],
        [
            "area under the curve of `unknown`",
            _area([x["unknown"] for x in strange], [x["unknown"] for x in known]),
        ],
    ]
    errors = _coverage(known)
    if errors:
        for level, most in ((68, 0.9945), (95, 1.96)):
            rows.append(
                [
                    f"coverage of {level} % intervals",
                    share(sum(e < most for e in errors), len(errors)),
                ]
            )
    times = [x["cpu_s"] for x in flights]
    if times:
        rows.append(["CPU time of a ranking", f"{np.median(times):.1f} s in the median"])
    return table(["", "value (95 % interval)"], rows)
