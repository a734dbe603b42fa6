"""Fig. 5: the wrench filter against a nonlinear observer and an EKF, at low and at high noise.

An external force and torque hit a hovering and a yawing vehicle at 7 s. All estimators take the
same recorded samples. Three ways of tuning, each the same for filter and observer, so that a ratio
compares methods and not tunings:

* ``1 s``: set to a rise time of 1 s, whatever the noise (the observer's low-pass for low noise);
* ``low``: gains and process noise that an optimiser found at low noise, then given either noise.
The paper's comparison;
* ``anew``: the optimiser's for each noise level.
"""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, replace
from itertools import product
from typing import Any

import numpy as np
from matplotlib.figure import Figure, SubFigure

from ..envs.plant import TICK
from ..estimator import UKFTuning, WrenchUKF
from ..runtime.drawing import ESTIMATE, HELD_OUT, SERIES, new_figure, only_ticks, styled
from .ekf import WrenchEKF
from .fig5_estimators import ERRORS, UKF_TUNED, score, states_of, tune
from .fig5_flights import FLIGHTS, NOISES, PLANTS, Array, Flight, fly, vehicle_at
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

_NOISE_COLOURS = {"low": SERIES[0], "high": SERIES[1]}
_MARKERS = {"hover": "o", "yawing": "^"}
_KINDS = tuple(product(NOISES, FLIGHTS))
_LINES = {
    "observer low": (SERIES[1], "observer, tuned at low noise"),
    "observer anew": (SERIES[4], "observer, re-tuned"),
    "UKF low": (ESTIMATE, "UKF, tuned at low noise"),
}
_PLANT_TITLES = {"exact": "exact plant", "disturbed": "standard plant (unmodelled disturbance)"}


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
    picture = draw(ratios, flights["exact", "hover", "low"][0].wrench, examples, seeds)
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


@styled()
def draw(
    ratios: Ratios, truth: Array, examples: Mapping[tuple[str, str], Array], seeds: int
) -> Figure:
    """Draw estimates of the example flight over time beside the true wrench (n, 6), and who errs
    how much less than whom; ``examples`` has the states (n, 20) by noise and estimator.
    """
    figure = new_figure(10.5)
    parts: Any = figure.subfigures(3, 1)
    top, middle, bottom = parts
    _draw_examples(top, truth, examples)
    for part, plant in ((middle, "disturbed"), (bottom, "exact")):
        _draw_ratios(part, plant, ratios, seeds)
    return figure


def _draw_examples(
    figure: SubFigure, truth: Array, examples: Mapping[tuple[str, str], Array]
) -> None:
    grid = figure.subplots(2, 2, sharex=True, sharey="row")
    rows = slice(round(6.0 / TICK), round(13.0 / TICK))
    t = TICK * np.arange(len(truth))[rows]
    for column, noise in enumerate(NOISES):
        for axes, true, state, label in (
            (grid[0, column], 2, 18, r"force $f_z$ (N)"),
            (grid[1, column], 3, 13, r"torque $\tau_x$ (Nm)"),
        ):
            for name, (colour, text) in _LINES.items():
                axes.plot(t, examples[noise, name][rows, state], color=colour, lw=1.3, label=text)
            axes.plot(t, truth[rows, true], color="black", lw=1.0, ls="--", label="true")
            if column == 0:
                axes.set_ylabel(label)
        sizes = f"{1e3 * NOISES[noise].sigma_pos_m:g} mm, {NOISES[noise].sigma_att_rad:g} rad"
        grid[0, column].set_title(f"{noise} noise ({sizes}): one hovering flight, exact plant")
        grid[1, column].set_xlabel("time (s)")
    grid[1, 0].legend(loc="lower right")


def _draw_ratios(figure: SubFigure, plant: str, ratios: Ratios, seeds: int) -> None:
    labels = [label for label, _, _ in PAIRS]
    shown = [v for (p, *_), value in ratios.items() if p == plant for v in value]
    lowest, highest = min([0.5, *shown]) / 1.1, max([2.0, *shown]) * 1.1
    panels = figure.subplots(1, len(ERRORS), sharey=True)
    figure.suptitle(
        f"Ratio of RMSE, {_PLANT_TITLES[plant]}: in the green the first named errs less "
        f"(95 % intervals, {seeds} seeds)",
        x=0.01,
        ha="left",
    )
    for axes, error in zip(panels, ERRORS, strict=True):
        axes.set_xscale("log")
        axes.set_xlim(lowest, highest)
        axes.axvspan(lowest, 1.0, color=HELD_OUT, lw=0)
        axes.axvline(1.0, color="black", lw=0.9)
        for (i, label), (k, (noise, flight)) in product(enumerate(labels), enumerate(_KINDS)):
            value, low, high = ratios[plant, flight, noise, label, error]
            y, colour = i + 0.17 * (k - 1.5), _NOISE_COLOURS[noise]
            axes.plot([low, high], [y, y], color=colour, lw=1.8)
            axes.plot(value, y, _MARKERS[flight], color=colour, ms=5)
        axes.set_ylim(len(labels) - 0.45, -0.55)
        only_ticks(axes.xaxis, [v for v in (0.1, 0.2, 0.5, 1, 2, 5, 10) if lowest < v < highest])
        title = error.replace("_", ", ") + (" state" if "steady" in error else "")
        axes.set_title(title, loc="center")
        axes.grid(axis="x", color="0.9", lw=0.6)
        axes.set_axisbelow(True)
    panels[0].set_yticks(range(len(labels)), labels)
    for noise, flight in _KINDS:
        label = f"{noise} noise, {flight}"
        panels[-1].plot([], [], _MARKERS[flight], color=_NOISE_COLOURS[noise], label=label)
    figure.legend(*panels[-1].get_legend_handles_labels(), loc="outside lower center", ncols=4)
