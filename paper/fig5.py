"""Fig. 5: the wrench filter against a nonlinear observer and an EKF, at low and at high noise.

An external force and torque hit a hovering and a yawing vehicle at 7 s. All estimators take the
same recorded samples. Three ways of tuning, each the same for filter and observer, so that a ratio
compares methods and not tunings:

* ``1 s``: set to a rise time of 1 s, whatever the noise (the observer's low-pass for low noise);
* ``low``: gains and process noise that an optimiser found at low noise, then given either noise.
The paper's comparison;
* ``anew``: the optimiser's for each noise level.
"""

from collections.abc import Sequence
from dataclasses import asdict, replace
from typing import Any

import numpy as np

from ..envs.plant import TICK
from ..estimator import UKFTuning, WrenchEKF, WrenchUKF
from .fig5_estimators import ERRORS, UKF_TUNED, score, states_of, tune
from .fig5_flights import FLIGHTS, NOISES, PLANTS, Array, Flight, fly, vehicle_at
from .fig5_picture import draw
from .observer import NonlinearObserver, ObserverTuning
from .result import Columns, Comparison, Progress, Result, compared, table

TITLE = "Fig. 5: force and torque at two noise levels, against a nonlinear observer and an EKF"
SEEDS = 20

# what is compared with what: a label, the estimator and its rival
PAIRS = (
    ("observer / UKF, both tuned at low noise", "observer low", "UKF low"),
    ("observer / UKF, both re-tuned to the noise", "observer anew", "UKF anew"),
    ("observer / UKF, both set to 1 s", "observer 1 s", "UKF 1 s"),
    ("EKF / UKF, both set to 1 s", "EKF 1 s", "UKF 1 s"),
    ("observer re-tuned / UKF set to 1 s", "observer anew", "UKF 1 s"),
    ("UKF re-tuned / UKF set to 1 s", "UKF anew", "UKF 1 s"),
)
_TUNING_SEEDS = (10_001, 10_002)
_RESAMPLES = 4000

_CASE = ("plant", "flight", "noise")
# (plant, flight, noise, estimator) -> one row (seeds, 5) of the four errors and the NIS
Scores = dict[tuple[str, str, str, str], Array]
# (plant, flight, noise, label of the pair, error) -> ratio and interval
Ratios = dict[tuple[str, str, str, str, str], tuple[float, float, float]]
# (plant, noise) -> the optimiser's
Tunings = dict[tuple[str, str], tuple[UKFTuning, ObserverTuning]]


def run(seeds: int, progress: Progress, evaluations: int = 120) -> Result:
    """Run every estimator over the same flights.

    Args:
        seeds: flights of each kind.
        progress: told the share of the work that is done.
        evaluations: of the cost for each tuning; 0 leaves "low" and "anew" at their starts.
    """
    flights: dict[tuple[str, str, str], list[Flight]] = {}
    tunings: Tunings = {}
    cases = [(plant, noise) for plant in PLANTS for noise in NOISES]
    for i, (plant, noise) in enumerate(cases):
        own = [f for flight in FLIGHTS for f in fly(flight, noise, plant, _TUNING_SEEDS)]
        tunings[plant, noise] = tune(vehicle_at(noise), own, evaluations)
        for flight in FLIGHTS:
            flights[plant, flight, noise] = fly(flight, noise, plant, range(seeds))
        progress(0.5 * (i + 1) / len(cases))
    scores: Scores = {}
    examples: dict[tuple[str, str], Array] = {}
    for (plant, flight, noise), flown in flights.items():
        for name, estimator in _estimators(plant, noise, tunings).items():
            states = [states_of(estimator, f.samples) for f in flown]
            scored = [score(s, f) for s, f in zip(states, flown, strict=True)]
            scores[plant, flight, noise, name] = np.array(scored)
            if plant == "exact" and flight == "hover":
                examples[noise, name] = states[0]
    progress(0.98)
    ratios = _ratios(scores)
    picture = draw(
        ratios,
        [label for label, _, _ in PAIRS],
        flights["exact", "hover", "low"][0].wrench,
        examples,
        seeds,
    )
    return Result(
        _figures(scores, ratios, tunings, seeds),
        _columns(scores),
        picture,
        *_told(scores, ratios, seeds),
    )


def _estimators(plant: str, noise: str, tunings: Tunings) -> dict[str, WrenchUKF]:
    """Return all our estimators, by name, for flights of a plant at a noise level."""
    vehicle = vehicle_at(noise)
    base = UKFTuning.for_vehicle(vehicle, TICK)
    low, observer_low = tunings[plant, "low"]
    # a filter is told how noisy its measurements are: that is no tuning
    low = replace(low, position_noise=base.position_noise, attitude_noise=base.attitude_noise)
    estimators: dict[str, WrenchUKF] = {"EKF 1 s": WrenchEKF(vehicle, base, TICK)}
    for way, (ukf, observer) in {
        "1 s": (base, ObserverTuning()),
        "low": (low, observer_low),
        "anew": tunings[plant, noise],
    }.items():
        estimators[f"UKF {way}"] = WrenchUKF(vehicle, ukf, TICK)
        estimators[f"observer {way}"] = NonlinearObserver(vehicle, observer, TICK)
    return estimators


def ratio(rows: Array, rival: Array) -> tuple[float, float, float]:
    """Return the ratio of two mean errors (seeds,) of the same flights, and its 95 % interval by a
    paired bootstrap.
    """
    pick = np.random.default_rng(0).integers(len(rows), size=(_RESAMPLES, len(rows)))
    low, high = np.quantile(rows[pick].mean(axis=1) / rival[pick].mean(axis=1), [0.025, 0.975])
    return float(rows.mean() / rival.mean()), float(low), float(high)


def _ratios(scores: Scores) -> Ratios:
    out: Ratios = {}
    for plant, flight, noise in dict.fromkeys(key[:3] for key in scores):
        for label, one, other in PAIRS:
            a, b = scores[plant, flight, noise, one], scores[plant, flight, noise, other]
            for i, error in enumerate(ERRORS):
                out[plant, flight, noise, label, error] = ratio(a[:, i], b[:, i])
    return out


def _round(value: Any) -> float | None:
    return float(f"{float(value):.4g}") if np.isfinite(value) else None


def _named(key: Sequence[str], *more: str) -> dict[str, str]:
    return dict(zip((*_CASE, *more), key, strict=True))


def _figures(scores: Scores, ratios: Ratios, tunings: Tunings, seeds: int) -> dict[str, Any]:
    return {
        "seeds": seeds,
        "rmse_ratio": [
            _named(key, "pair", "error")
            | {"ratio": _round(value), "ci95": [_round(low), _round(high)]}
            for key, (value, low, high) in ratios.items()
        ],
        "rmse": [
            _named(key, "estimator")
            | dict(zip((*ERRORS, "nis"), map(_round, rows.mean(axis=0)), strict=True))
            for key, rows in scores.items()
        ],
        "tuning": [
            {
                "plant": plant,
                "noise": noise,
                "UKF": {k: _round(getattr(ukf, k)) for k in UKF_TUNED},
                "observer": {k: _round(v) for k, v in asdict(observer).items()},
            }
            for (plant, noise), (ukf, observer) in tunings.items()
        ],
    }


def _columns(scores: Scores) -> Columns:
    units = {"f": "_N", "t": "_Nm", "n": ""}
    names = [name + units[name[0]] for name in (*ERRORS, "nis")]
    return table(
        [
            {
                **_named(key, "estimator"),
                "seed": np.arange(len(rows)),
                **dict(zip(names, rows.T, strict=True)),
            }
            for key, rows in scores.items()
        ]
    )


def _told(scores: Scores, ratios: Ratios, seeds: int) -> tuple[list[Comparison], list[str]]:
    low, anew, second, ekf, mixed, gain = (label for label, _, _ in PAIRS)

    def span(label: str, noise: str, errors: Sequence[str], plant: str | None = None) -> str:
        """Return the range of the ratios of a pair over plants and flights."""
        values = [
            v[0]
            for (p, _, n, name, error), v in ratios.items()
            if name == label and n == noise and error in errors and plant in (None, p)
        ]
        return f"{min(values):.2f} to {max(values):.2f}"

    def words(label: str, noise: str, flight: str) -> list[str]:
        some = [ratios["disturbed", flight, noise, label, error] for error in ERRORS]
        return [f"{v:.2f} [{a:.2f}, {b:.2f}]" for v, a, b in some]

    def nis(name: str, plant: str, noise: str) -> float:
        return float(np.mean([scores[plant, f, noise, name][:, 4] for f in FLIGHTS]))

    return compared(
        "fig5",
        globals(),
        seeds=seeds,
        words=words,
        nis=nis,
        span=span,
        low=low,
        anew=anew,
        second=second,
        ekf=ekf,
        mixed=mixed,
        gain=gain,
        transient=("force_transient", "torque_transient"),
        steady=("force_steady", "torque_steady"),
        close=max(v[0] for key, v in ratios.items() if key[3] == anew) < 1.3,
    )
