"""Accuracy on RotorPy's flights with given, fitted and best tuning, and the cost of bad poses."""

import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize

from windwrench import __version__
from windwrench.estimator import UKFTuning
from windwrench.identification.logs.flight_log import FlightLog
from windwrench.identification.wrench_series import (
    GATE,
    WrenchSeries,
    estimate_log,
    tune_to_log,
)
from windwrench.runtime.provenance import commit
from windwrench.studies.log_estimates.flights import (
    PLANT_VEHICLES,
    ROTORPY,
    SETTLED,
    Flight,
    bursts,
    gaps,
    isolated,
    plant_flight,
    rotorpy_flights,
)

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]
Spoil = Callable[[FlightLog, np.random.Generator], tuple[FlightLog, Mask]]
Result = dict[str, Any]

SHARE, FAR = 0.01, 0.1  # of the poses; m
BURSTS = (0.1, 0.3, 0.5)  # s
EVERY = 5.0  # s between bursts
JUMP = 2.0  # m, for good
_DRAWS = 2000  # of the bootstrap


def errors(series: WrenchSeries, log: FlightLog, kind: str) -> Array:
    """Return the error (N, 3) of force or torque."""
    error: Array = getattr(series, kind) - getattr(log, kind)
    return error


def rms(error: Array, rows: Mask) -> float:
    """Return the root mean square length of the error's vector over some rows."""
    return float(np.sqrt(np.mean(np.sum(np.square(error[rows]), axis=1))))


def settled(log: FlightLog) -> Mask:
    """Return the rows (N,) that count."""
    late: Mask = log.t >= log.t[0] + SETTLED
    return late


def _best(flight: Flight, start: UKFTuning, kind: str) -> float:
    """Return the least error of the filter over factors on walk and white noise, truth known."""
    walk, white = (
        ("force_walk", "thrust_noise") if kind == "force" else ("torque_walk", "motor_torque_noise")
    )
    rows = settled(flight.log)

    def error(x: Array) -> float:
        made = replace(
            start,
            **{
                name: np.asarray(getattr(start, name)) * np.exp(factor)
                for name, factor in ((walk, x[0]), (white, x[1]))
            },
        )
        return rms(errors(estimate_log(flight.log, flight.vehicle, made), flight.log, kind), rows)

    simplex = [[0.0, 0.0], [0.7, 0.0], [0.0, 0.7]]
    found = minimize(
        error,
        simplex[0],
        method="Nelder-Mead",
        options={"xatol": 0.05, "fatol": 1e-6, "maxfev": 60, "initial_simplex": simplex},
    )
    return float(found.fun)


def accuracy(seconds: float, seed: int, progress: Callable[[float], None]) -> list[Result]:
    """Return force (N) and torque (Nm) errors of each RotorPy flight by tuning, smoothed or not."""
    rows = []
    for flight in rotorpy_flights(seconds, seed):
        log, vehicle, count = flight.log, flight.vehicle, settled(flight.log)
        begin = time.perf_counter()
        fit = tune_to_log(log, vehicle)
        fitting = time.perf_counter() - begin
        row: Result = {
            "flight": flight.name,
            "fit_s": fitting,
            "nis_before": fit.nis_before,
            "nis_after": fit.nis_after,
            "nis_band": fit.nis_band,
            "consistent": fit.given_is_consistent,
            "rise_s": float(np.mean(fit.rise_after[0][:2])),
        }
        for name, tuning, smooth in (
            ("given", fit.given, False),
            ("given, smoothed", fit.given, True),
            ("fitted", fit.tuning, False),
            ("fitted, smoothed", fit.tuning, True),
        ):
            begin = time.perf_counter()
            series = estimate_log(log, vehicle, tuning, smooth=smooth)
            row[name] = {
                kind: rms(errors(series, log, kind), count) for kind in ("force", "torque")
            } | {"seconds": time.perf_counter() - begin}
        row["best"] = {kind: _best(flight, fit.tuning, kind) for kind in ("force", "torque")}
        rows.append(row)
        progress(len(rows) / len(ROTORPY))
    return rows


def groups(seconds: float, seed: int, flights: int) -> Iterator[tuple[str, list[Flight]]]:
    """Yield the flights whose poses are spoiled, by the name that a group of them has."""
    for name in PLANT_VEHICLES:
        yield name, [plant_flight(name, seconds, seed + i) for i in range(flights)]
    fast = list(rotorpy_flights(seconds, seed))
    yield "RotorPy, default tuning", fast
    yield (
        "RotorPy, tuning fitted to the clean log",
        [replace(f, tuning=tune_to_log(f.log, f.vehicle).tuning) for f in fast],
    )


def outliers(name: str, group: Sequence[Flight], seed: int) -> list[Result]:
    """Return what bad poses cost a group of flights: the error of the force over that of the clean
    log, on the rows that count, gate and no gate, with an interval over the flights.
    """
    cases: list[tuple[str, Spoil]] = [
        (f"{100 * SHARE:g} % of the poses {100 * FAR:g} cm off", _isolated)
    ]
    for length in BURSTS:
        cases += [
            # what nothing can do better than: no pose at all for that long
            (f"no pose for {length:g} s", _gap(length)),
            (f"bursts of {length:g} s, one offset", _burst(length, together=True)),
            (f"bursts of {length:g} s, each pose its own offset", _burst(length, together=False)),
        ]
    filters: tuple[tuple[str, dict[str, Any]], ...] = (
        ("filter", {}),
        ("smoothed", {"smooth": True}),
        ("no gate", {"gate": None}),
    )

    def error(flight: Flight, log: FlightLog, options: dict[str, Any]) -> Array:
        series = estimate_log(log, flight.vehicle, flight.tuning, **options)
        return errors(series, flight.log, "force")

    rows = []
    clean = [{k: error(f, f.log, options) for k, options in filters} for f in group]
    for case, spoil in cases:
        pairs: dict[str, list[tuple[float, float]]] = {label: [] for label, _ in filters}
        for i, flight in enumerate(group):
            spoiled, where = spoil(flight.log, np.random.default_rng([seed, i]))
            for label, options in filters:
                pairs[label].append(
                    (rms(error(flight, spoiled, options), where), rms(clean[i][label], where))
                )
        rows.append(
            {"flights": name, "count": len(group), "case": case}
            | {label: _ratio(found, seed) for label, found in pairs.items()}
        )
    return rows


def _isolated(log: FlightLog, rng: np.random.Generator) -> tuple[FlightLog, Mask]:
    return isolated(log, SHARE, FAR, rng), settled(log)


def _gap(length: float) -> Spoil:
    return lambda log, _: gaps(log, length, EVERY)


def _burst(length: float, together: bool) -> Spoil:
    return lambda log, rng: bursts(log, length, EVERY, FAR, together, rng)


def _ratio(pairs: Sequence[tuple[float, float]], seed: int) -> Result:
    """Return the ratio of pooled errors, its 95 % interval over flights, and the greatest."""
    squares = np.square(np.array(pairs))
    draws = np.random.default_rng(seed).integers(0, len(pairs), (_DRAWS, len(pairs)))
    drawn = np.sqrt(squares[draws, 0].mean(axis=1) / squares[draws, 1].mean(axis=1))
    return {
        "ratio": float(np.sqrt(squares[:, 0].mean() / squares[:, 1].mean())),
        "ci95": [float(v) for v in np.percentile(drawn, [2.5, 97.5])],
        "largest": float(np.sqrt(np.max(squares[:, 0] / squares[:, 1]))),
    }


def jumps(seconds: float, seed: int, flights: int) -> list[Result]:
    """Return how a pose that moves for good, half way, is met: when the filter restarts, and
    the error of the force from two seconds after on, over that of the clean log.
    """
    rows = []
    for name in PLANT_VEHICLES:
        for label, gate in (("gate", GATE), ("no gate", None)):
            after, pairs = [], []
            for i in range(flights):
                flight = plant_flight(name, seconds, seed + i)
                log = flight.log
                at = len(log.t) // 2
                moved = log.position.copy()
                moved[at:] += np.array([JUMP, 0.0, 0.0])
                series = estimate_log(
                    replace(log, position=moved), flight.vehicle, flight.tuning, gate=gate
                )
                clean = estimate_log(log, flight.vehicle, flight.tuning)
                restarted = np.flatnonzero(series.status[at:] == 3)
                after.append(
                    float(log.t[at + restarted[0]] - log.t[at]) if restarted.size else None
                )
                later = log.t > log.t[at] + SETTLED
                pairs.append(
                    (
                        rms(errors(series, log, "force"), later),
                        rms(errors(clean, log, "force"), later),
                    )
                )
            rows.append(
                {
                    "vehicle": name,
                    "filter": label,
                    "count": flights,
                    "restarted": sum(a is not None for a in after),
                    "after_s": float(np.median([a for a in after if a is not None] or [np.inf])),
                }
                | _ratio(pairs, seed)
            )
    return rows


def run(
    seconds: float,
    flights: int,
    seed: int,
    progress: Callable[[str, float], None],
    measured: Result | None = None,
) -> Result:
    """Return everything that the page says; ``measured`` is an earlier result whose accuracy by
    tuning is kept.
    """
    made = commit()
    poses: list[Result] = []
    for i, (name, group) in enumerate(groups(seconds / 2, seed, flights)):
        poses += outliers(name, group, seed)
        progress("bad poses", (i + 1) / (len(PLANT_VEHICLES) + 2))
    return {
        "commit": measured["commit"] if measured else made,
        "poses_commit": made,
        "version": __version__,
        "seconds": seconds,
        "flights": flights,
        "seed": seed,
        "accuracy": measured["accuracy"]
        if measured
        else accuracy(seconds, seed, lambda share: progress("accuracy", share)),
        "outliers": poses,
        "jumps": jumps(seconds / 2, seed, flights),
    }
