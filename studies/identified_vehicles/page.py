"""The study's table: what was lost, errors, and how often the intervals hold the truth."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from windwrench.studies.identified_vehicles.study import quantities
from windwrench.studies.page_tables import share, table

_WORST = {"motor_lag": 0.10}  # share of the truth; of the others:
_WITHIN = 0.05
_HEAD = (
    "quantity",
    "runs",
    "median error",
    "worst",
    "within 5 % (lag: 10 %)",
    "truth in the 95 % interval",
)


def tables(outcomes: Sequence[Mapping[str, Any]]) -> str:
    """Return the tables as Markdown, losses first."""
    losses, rows, whole = [], [], [0, 0]
    for outcome in outcomes:
        where = f"{outcome['vehicle']}, seed {outcome['seed']}"
        if outcome["commanded"] and not outcome["lag_found"]:
            losses.append(f"* {where}: the lag was not found")
        if not outcome["commanded"] and outcome["lag_found"]:
            losses.append(f"* {where}: a lag was found that is not there")
        if drag := [e for e in outcome["effects"] if e != "motor_lag"]:
            losses.append(f"* {where}: found {', '.join(drag)}, which is not there")
        for name, e in outcome["quantities"].items():
            if not e["truth"]:
                continue
            if e["status"] != "identified":
                losses.append(f"* {where}: {name} not identified")
            elif abs(e["value"] / e["truth"] - 1.0) > _WORST.get(name, _WITHIN):
                error = 100 * (e["value"] / e["truth"] - 1.0)
                losses.append(f"* {where}: {name} off by {error:+.1f} %")
    for name, found in quantities(outcomes).items():
        told = [e for e in found if e["status"] == "identified"]
        if not told:
            continue
        holding = sum(e["low"] <= e["truth"] <= e["high"] for e in told)
        whole[0] += holding
        whole[1] += len(told)
        if told[0]["truth"]:
            errors = np.abs([e["value"] / e["truth"] - 1.0 for e in told])
            limit = _WORST.get(name, _WITHIN)
            error = f"{100 * np.median(errors):.2f} %"
            most = f"{100 * errors.max():.1f} %"
            inside = share(int(np.sum(errors <= limit)), len(told))
        else:
            size = np.abs([1e3 * e["value"] for e in told])
            error, most, inside = f"{np.median(size):.2f} mm", f"{size.max():.1f} mm", "–"
        rows.append([name, str(len(found)), error, most, inside, share(holding, len(told))])
    lines = [
        f"{len(outcomes)} vehicles. Lost: {len(losses)}.",
        *losses,
        "",
        table(_HEAD, rows),
        "",
        f"All quantities together: {share(*whole)}. Median time of an identification: "
        f"{np.median([o['cpu_s'] for o in outcomes]):.1f} s of one core.",
    ]
    return "\n".join(lines)
