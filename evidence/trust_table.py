"""The page "How far to trust it": one table, of the kept results of all its studies."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from windwrench.evidence.kept_results import DOCS, kept
from windwrench.evidence.measured_flights import CABLE, PAYLOAD
from windwrench.evidence.nanodrone_benchmark import FORCE, VEHICLE, mean
from windwrench.evidence.other_engines import DAMPING, ENGINES
from windwrench.evidence.other_engines import VEHICLE as HUMMINGBIRD
from windwrench.evidence.probabilities.calibration import figures, flights_of
from windwrench.evidence.published import OF_SYSID_TOOLS, PUBLISHED
from windwrench.evidence.recovery import poisson_band
from windwrench.evidence.scoring import share
from windwrench.identification.comparison.change import NOWHERE
from windwrench.identification.prediction import QUANTITIES
from windwrench.identification.vehicle_fit.held_out import NO_CHANGE


class Row(NamedTuple):
    """A line of the table: what was measured, the result, and what stands beside it."""

    measured: str
    result: str
    beside: str = "–"


Rows = list[Row]
CLAIM = 0.25  # probability of a cause outside the library from which on it counts as a claim


def count(rows: Sequence[Mapping[str, Any]], key: str) -> str:
    """Return how many rows have a true value, with the interval."""
    return share(sum(bool(row[key]) for row in rows), len(rows))


def nanobench(result: Any) -> Rows:
    """Return residuals and names of flights left out of the fit."""
    folds = result["flights"]
    after, constant = (
        np.sqrt(np.mean(np.square([fold[key] for fold in folds]), axis=0))
        for key in ("after_std", "constant_thrust_std")
    )
    pairs = [(fold["after_std"], fold["constant_thrust_std"]) for fold in folds]
    better = sum(all(np.array(a) < b) for a, b in pairs)
    names = [{"sure": not e["tentative"]} for fold in folds for e in fold["effects"]]
    left = ", ".join(f"{x:.3f}" for x in after)
    return [
        Row(
            f"NanoBench, {len(folds)} fits: acceleration left on an unseen flight, x, y, z (m/s2)",
            left,
            "constant thrust " + ", ".join(f"{x:.3f}" for x in constant),
        ),
        Row("… below constant thrust on all axes", share(better, len(folds))),
        Row("… names that are sure", count(names, "sure")),
    ]


def slung_payload(result: Any) -> Rows:
    """Return how often the load is named, with and without a load."""
    rows = []
    for loaded, words in ((True, f"{1e3 * PAYLOAD:g} g on {CABLE:g} m"), (False, "no payload")):
        sets = [flight for flight in result["flights"] if flight["payload"] == loaded]
        named = [[e for e in x["effects"] if e["name"] == "slung_payload"] for x in sets]
        masses = [e[0] for e in named if e]
        found = "; ".join(
            f"{1e3 * e['coefficients']['m']:.1f} ± {1e3 * e['std']['m']:.1f} g" for e in masses
        )
        result_ = share(len(masses), len(sets))
        rows.append(Row(f"Payload named, {words}", f"{result_}: {found}" if found else result_))
    return rows


def fan_wall(result: Any) -> Rows:
    """Return the winds found."""
    rows = []
    for flight in result["flights"]:
        wind = flight["wind"]
        speed = f"{wind[0]:.1f} ± {flight['wind_std'][0]:.1f} m/s" if wind else "no wind named"
        rows.append(
            Row(
                f"Fan wall, {flight['flight'].partition('_')[0]} controller: wind along x, its "
                "probability",
                f"{speed}, {flight['wind_probability']:.2f}",
                f"label {-flight['label'] or 0.0:g} m/s",
            )
        )
    return rows


def crazypad(result: Any, words: str = "CrazyPAD, few normal flights") -> Rows:
    """Return how often the changed place is right."""
    flights = result["flights"]
    changed = [x for x in flights if x["truth"] != NOWHERE]
    same = [x for x in flights if x["truth"] == NOWHERE]
    missed = [{"missed": x["place"] == NOWHERE} for x in changed]
    sure = [{"right": x["sure"] and x["right"]} for x in changed]
    return [
        Row(f"{words}: weight or cut missed", count(missed, "missed")),
        Row(
            f"{words}: likeliest place right; sure and right",
            f"{count(changed, 'right')}; {count(sure, 'right')}",
        ),
        Row(f"{words}: sure and wrong", count(flights, "sure_and_wrong")),
        Row(f"{words}: nothing likeliest on a normal flight", count(same, "right")),
    ]


def crazypad_e8(result: Any) -> Rows:
    """Return how often the changed place is right on vehicle E8."""
    return crazypad(result, "CrazyPAD E8")


def motor_faults(result: Any) -> Rows:
    """Return which motor failed, and when."""
    flights = [
        {
            "right": x["motor"] in x["commanded"]["motors"],
            "held": x["onset_ci95_s"][0] <= x["commanded"]["between_s"][1]
            and x["onset_ci95_s"][1] >= x["commanded"]["between_s"][0],
        }
        for x in result["flights"]
    ]
    return [
        Row(
            "A motor fails (PX4): motor right; onset holds",
            f"{count(flights, 'right')}; {count(flights, 'held')}",
        )
    ]


def nanodrone(result: Any) -> Rows:
    """Return errors of prediction of paths left out."""
    rows = [row for path in result["paths"].values() for row in path]

    def told(kind: str, way: str) -> str:
        return ", ".join(f"{x:.3g}" for x in mean(rows, kind, way))

    units = ", ".join(f"{name} {unit}" for name, unit in QUANTITIES.items())
    return [
        Row(
            words,
            told(kind, VEHICLE),
            f"thrust and drag {told(kind, FORCE)}; no change {told(kind, NO_CHANGE)}",
        )
        for words, kind in (
            (
                f"Nano-drone, `predict` on {len(rows)} unseen paths, 0.5 s: {units}",
                "after_half_a_second",
            ),
            ("Nano-drone, the benchmark's sums from the logged state", "sums"),
        )
    ]


def published(result: Any) -> Rows:
    """Return figures that are published, beside ours."""
    races = result["races"]
    rows = [
        Row(
            f"Racer, flights {', '.join(races)}: RMSE of smoothed {kind}",
            ", ".join(f"{of['smoothed'][i]:.3g}" for of in races.values()),
            f"{other} {', '.join(map(str, PUBLISHED[f'{other}, {kind.split()[0]}']))}",
        )
        for i, kind, other in (
            (0, "force (N)", "TR-NeuroMHE"),
            (1, "torque (mNm)", "TR-NeuroMHE"),
        )
    ]
    return rows + [
        Row(
            f"Crazyflie of sysid.tools: {name}",
            f"{x:.3g} ({low:.3g}–{high:.3g})",
            f"published {OF_SYSID_TOOLS[name]:.3g}",
        )
        for name, (x, low, high) in result["crazyflie"].items()
    ]


def other_engines(result: Any) -> Rows:
    """Return what is found of an engine's own drag."""
    true, rows = DAMPING * HUMMINGBIRD.mass, []
    for engine in ENGINES:
        flights = [x for x in result["flights"] if x["engine"] == engine]
        drags = [e for x in flights for e in x["effects"] if e["name"] == "body_drag" and e["sure"]]
        others = [
            {"other": any(e["sure"] and e["name"] != "body_drag" for e in x["effects"])}
            for x in flights
        ]
        found = f"{share(len(drags), len(flights))}; {count(others, 'other')}"
        parts = [
            abs(e["coefficients"][c] - true) <= 1.96 * e["std"][c] for e in drags for c in e["std"]
        ]
        if parts:
            found += f"; intervals of coefficients hold {share(sum(parts), len(parts))}"
        drag = f"{true:.3f} N/(m/s) and N/(m/s)²" if engine == "PyBullet" else "no drag"
        rows.append(Row(f"{engine}: `body_drag` sure; another name sure", found, drag))
    return rows


def probabilities(result: Any) -> Rows:
    """Return what probabilities of names are worth."""
    rows = []
    for words, posed in (("Two simulators", True), ("No measured pose", False)):
        flights = flights_of([x for x in result["flights"] if (len(x["task"]) == 3) == posed])
        if flights:
            found = figures(flights)
            words = f"{words}, {len(flights)} flights"
            rows += [Row(f"{words}: {name}", *told) for name, told in found.items()]
    return rows


def recovery(result: Any) -> Rows:
    """Return how often a filter is beyond a limit."""
    limits = "limits: 2 restarts, 5 % of the weight, 4 deviations in 2 % of rows"
    rows = [
        Row(f"Filter, {words}: beyond a limit", share(x["beyond"], x["flights"]), limits)
        for words, x in (
            ("noise of 1 to 3 times the declared, with gap, jump or tilt", result["combinations"]),
            ("heavy-tailed, changing, rounded noise", result["tails"]),
        )
    ]
    wrong = result["attitudes"]
    told = "; ".join(share(wrong[key], wrong["flights"]) for key in ("meanwhile", "later"))
    rows.append(
        Row("Wrong attitudes, no gate: wrench off by 6 deviations meanwhile; 2 s later", told)
    )
    quiet = []
    for noise, (restarts, hours) in result["quiet"].items():
        low, high = poisson_band(restarts, hours)
        quiet.append(f"{noise} {restarts / hours:.1f} ({low:.1f}–{high:.1f})")
    return [*rows, Row("Good poses: restarts an hour by noise", ", ".join(quiet))]


def perfect_models(result: Any) -> Rows:
    """Return how often a diagnosis claims something of a perfect model, by kind of log."""
    flights = list(result["flights"].values())
    return [
        Row(
            f"Perfect model in gusts, {kind}: a name, or a cause outside",
            count(
                [{"claim": x[kind]["names"] or x[kind]["unknown"] >= CLAIM} for x in flights],
                "claim",
            ),
            "aim: 5 %",
        )
        for kind in flights[0]
    ]


# by study: its kept result below docs/, and its rows
TABLE: Mapping[str, tuple[str, Callable[[Any], Rows]]] = {
    "crazypad_e8": ("results/crazypad_e8.json", crazypad_e8),
    "crazypad": ("results/crazypad.json", crazypad),
    "motor_faults": ("results/motor_faults.json", motor_faults),
    "nanobench": ("results/nanobench.json", nanobench),
    "slung_payload": ("results/slung_payload.json", slung_payload),
    "fan_wall": ("results/fan_wall.json", fan_wall),
    "nanodrone": ("identify/nanodrone.json", nanodrone),
    "published": ("results/published.json", published),
    "other_engines": ("results/other_engines.json", other_engines),
    "probabilities": ("results/probabilities.json.gz", probabilities),
    "perfect_models": ("results/perfect_models.json", perfect_models),
    "recovery": ("results/recovery.json", recovery),
}


def page() -> dict[str, Any]:
    """Return what the page shows, of the studies that have a kept result."""
    shown = {
        name: (path, kept(path), rows)
        for name, (path, rows) in TABLE.items()
        if (DOCS / path).exists()
    }
    benchmark = shown["nanodrone"][1]["paths"].values()
    flown = [row for path in benchmark for row in path]
    return {
        "studies": {
            name: {"path": path, "commit": result["commit"], "rows": rows(result)}
            for name, (path, result, rows) in shown.items()
        },
        "results": {name: result for name, (_, result, _) in shown.items()},
        "predicted": {way: mean(flown, "after_half_a_second", way) for way in (VEHICLE, NO_CHANGE)},
        "published": PUBLISHED["TR-NeuroMHE, torque"][1],
        "nowhere": NOWHERE,
    }
