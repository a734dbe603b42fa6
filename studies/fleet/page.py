"""The results of the study on its page, between two marks, with their data and a picture beside
it.
"""

import shutil
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from scipy.stats import linregress, t

from windwrench.identification.fleet.drift import DRIFT
from windwrench.runtime.page_files import write_json
from windwrench.runtime.provenance import made_by
from windwrench.studies.fleet.flights import EACH, KINDS
from windwrench.studies.page_tables import put_between, share, table

_ADDED = {
    "steady": "nothing",
    "draggy": "rotor drag, the same on each flight",
    "wearing": "one rotor that loses thrust from flight to flight",
    "shifting": "a centre of mass that moves from flight to flight",
}
_STEPS = (20, 50, 100, 200, 500, 1000)  # logs
_TARGET = 1000  # flights, to which the cost is extrapolated


def write_page(result: Mapping[str, Any], folder: Path, page: Path) -> None:
    """Put the results into the page and their data and picture into the folder beside it.

    Raises:
        InputError: the page is not there or lacks the marks.
    """
    data = page.with_suffix("") / "study.json.gz"
    data.parent.mkdir(exist_ok=True)
    write_json(result, data)
    shutil.copyfile(folder / "fleet.png", data.with_name("fleet.png"))
    made = made_by(
        f"python -m studies.fleet --flights {result['flights']} --page docs/{page.name}",
        [result["commit"]],
        result["version"],
    )
    parts = [_found(result), _cost(result), _refused(result["refused"]), made]
    put_between("\n\n".join(parts), page)


def _found(result: Mapping[str, Any]) -> str:
    """Return what was told of each kind of individual, losses first."""
    rows, missed, short = [], 0, 0
    for kind in KINDS:
        own = [one for one in result["truth"] if one["kind"] == kind]
        right = false = held = tried = 0
        for one in own:
            told = [trend for trend in one["trends"] if trend["told"]]
            true = [tr for tr in told if [tr["effect"], tr["coefficient"]] == one["drifts"]]
            right += bool(true)
            if one["drifts"] and not true:
                missed += 1
                short += one["diagnosed"] < DRIFT.least_flights
            # other coefficients of an effect that drifts are no false alarm of the effect
            effect = one["drifts"][0] if one["drifts"] else ""
            false += any(tr["effect"] != effect for tr in told)
            for trend in one["trends"]:
                if trend["ci95"] is None or (one["drifts"] and trend["effect"] != effect):
                    continue
                is_it = [trend["effect"], trend["coefficient"]] == one["drifts"]
                truth = one["true_per_flight"] if is_it else 0.0
                tried += 1
                held += trend["ci95"][0] <= truth <= trend["ci95"][1]
        drifting = len(own) if own and own[0]["drifts"] else 0
        rows.append(
            [
                kind,
                _ADDED[kind],
                str(len(own)),
                str(sum(one["diagnosed"] for one in own)),
                share(drifting - right, drifting),
                share(false, len(own)),
                share(held, tried),
            ]
        )
    flights = sum(one["diagnosed"] for one in result["truth"])
    return (
        f"### What was found\n\n{result['flights']} flights of {len(result['truth'])} vehicles of "
        f"three models (ardrone2, crazyflie, hummingbird), {result['seconds']:g} s each, at most "
        f"{EACH} a vehicle; {flights} were diagnosed. In brackets: 95 % intervals (Wilson).\n\n"
        + table(
            (
                "vehicles",
                "what its model lacks",
                "how many",
                "flights diagnosed",
                "drift missed",
                "a drift told of an effect that does not drift",
                "trend's 95 % interval holds the truth",
            ),
            rows,
        )
        + f"\n\nOf the {missed} drifts that were missed {short} are of vehicles with fewer than "
        f"{DRIFT.least_flights} diagnosed flights, which a trend needs."
        + "\n\n![Coefficients from flight to flight](fleets/fleet.png)"
    )


def _cost(result: Mapping[str, Any]) -> str:
    """Return what it cost: a table over the number of logs, and in words."""
    cpu = np.array([cost["cpu_s"] for cost in result["costs"]])
    peak = np.array([cost["peak_mb"] for cost in result["costs"]], dtype=float)
    parent = {line["logs"]: line["parent_mb"] for line in result["parent"]}
    rows = []
    for step in sorted({*(s for s in _STEPS if s < len(cpu)), len(cpu)}):
        near = min(parent, key=lambda logs: abs(logs - step), default=None)
        rows.append(
            [
                str(step),
                f"{cpu[:step].sum():.0f}",
                _mean(cpu[:step]),
                f"{peak[:step].max():.0f}",
                "–" if near is None else f"{parent[near]:.0f} (after {near} logs)",
            ]
        )
    line = linregress(np.arange(len(cpu)), cpu)
    half = t.ppf(0.975, len(cpu) - 2) * line.stderr * 100
    start = {
        key: np.array([one[key] for one in result["starts"]])
        for key in ("start", "first", "second")
    }
    mean = float(cpu.mean())
    many = [float(_TARGET * x / 3600.0) for x in (mean, *_interval(cpu))]
    steady = [cost["cpu_s"] for cost in result["costs"] if "steady" in cost["id"]][-3:]
    warm = (start["start"] + start["first"]).mean() / start["second"].mean()
    further = (
        f"\n\nExtrapolated, not measured: {_TARGET} such flights take {many[0]:.2f} hours of one "
        f"core ({many[1]:.2f} to {many[2]:.2f}, by the interval of the mean alone)."
        if result["flights"] < _TARGET
        else ""
    )
    return (
        "### What it costs\n\n"
        + table(
            (
                "logs diagnosed",
                "time of one core, s",
                "a log, s (95 %)",
                "most memory of the worker, MB",
                "most memory of the process that shares out, MB",
            ),
            rows,
        )
        + "\n\nThe machine did other work beside it, whose load grew meanwhile, and a core that is "
        "shared needs more time for the same. From log to log the time changed by "
        f"{100 * line.slope:+.2f} s a 100 logs (95 %: {100 * line.slope - half:+.2f} to "
        f"{100 * line.slope + half:+.2f}). Whether that is the worker's age: the last three "
        f"flights of vehicles that lack nothing took {np.mean(steady):.2f} s each in the worker "
        "that had done all before; such a flight took "
        f"{start['second'].mean():.2f} s in processes that were "
        f"started for it right after (each its second diagnosis).\n\nA process "
        f"that starts for one log pays {start['start'].mean():.1f} s to start and import, and "
        f"{start['first'].mean():.1f} s for its first diagnosis, which loads compiled code; the "
        f"same diagnosis again takes {start['second'].mean():.1f} s ({len(result['starts'])} "
        f"processes, compiled code in the cache). So a warm worker does {warm:.1f} logs in the "
        f"time of one process for one log.{further}"
    )


def _interval(values: Any) -> tuple[float, float]:
    half = t.ppf(0.975, len(values) - 1) * values.std(ddof=1) / np.sqrt(len(values))
    return float(values.mean() - half), float(values.mean() + half)


def _mean(values: Any) -> str:
    low, high = _interval(values)
    return f"{values.mean():.2f} ({low:.2f}–{high:.2f})"


def _refused(refused: Sequence[Mapping[str, Any]]) -> str:
    """Return what was refused, the logs of one reason together."""
    found: dict[str, list[str]] = {}
    for one in refused:
        reason = one["reason"].removeprefix(f"{one['log']}: ").replace("|", "/")
        found.setdefault(reason.partition("; expected")[0], []).append(one["log"])
    rows = [[str(len(logs)), reason, logs[0]] for reason, logs in found.items()]
    rows.sort(key=lambda row: -int(row[0]))
    return (
        "### Which logs were refused\n\nOne log of 20 was spoiled on purpose: cut off, one second "
        "long, a rotor speed that is no number, a column missing.\n\n"
        + table(("logs", "why", "one of them"), rows)
    )
