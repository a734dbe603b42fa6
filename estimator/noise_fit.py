"""The tuning with the likeliest innovations of a flight.

Maximum likelihood of the innovations: Mehra, *On the identification of variances and adaptive
Kalman filtering*, IEEE Trans. Automatic Control 15, 1970; Astrom, *Maximum likelihood and
prediction error methods*, Automatica 16, 1980. The fitted numbers, as logarithms:

* walk of the force and of the torque, each horizontally (x and y are alike) and vertically.
* white noise of thrust and motor torque, and noise of position and attitude, one number each.

Pose noise and walks are well determined: they shape the innovations at short and at long times.
White noise often is not: below some size white noise changes nothing, and then stays or comes to
rest on its bound.

With ``NoiseFitSettings.gusts`` the correlation times of force and torque are fitted, too, each
horizontally and vertically, from the likeliest walk on. The fit keeps them if they are likelier
than the walk beyond chance: in a flight of a walk, one of a thousand exceeds the bound on the
likelihood ratio (four numbers more, Wilks 1938).
"""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Sequence
from concurrent.futures import Executor, ThreadPoolExecutor
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ..dynamics.vehicle import Vehicle
from ..runtime.errors import InputError
from .consistency import MEASURED, Consistency, chi2_band
from .estimate import Array
from .innovations import Innovations, Piece, innovations, pieces_of
from .likelihood_search import climb
from .rise_time import rise_times
from .tuning import UKFTuning

_PARAMETERS: tuple[tuple[str, tuple[int, ...]], ...] = (
    ("force_walk", (0, 1)),
    ("force_walk", (2,)),
    ("torque_walk", (0, 1)),
    ("torque_walk", (2,)),
    ("thrust_noise", (0, 1, 2)),
    ("motor_torque_noise", (0, 1, 2)),
    ("position_noise", (0, 1, 2)),
    ("attitude_noise", (0, 1, 2)),
)
_TIMES: tuple[tuple[str, tuple[int, ...]], ...] = (
    ("force_time", (0, 1)),
    ("force_time", (2,)),
    ("torque_time", (0, 1)),
    ("torque_time", (2,)),
)
_GUSTS = (0.1, 0.3, 1.0, 5.0)  # s, of starts
_BY_CHANCE = 9.2  # gain of log-likelihood by four numbers more, of one in a thousand walks


@dataclass(frozen=True)
class NoiseFitSettings:
    """Rows and bounds of the fit.

    Walks are bounded as a random walk over a second, white noise as a deviation at 200 Hz. Both are
    shares of the vehicle's weight, or of weight times arm. Bounds keep the filter sane with a log
    that was filtered before writing and has no noise.

    Attributes:
        startup: s after each start of the filter, not counted.
        longest_gap: s without a pose until the filter starts anew.
        rows: fitted rows of the log; a longer log is thinned to spread excerpts.
        excerpt: s, each of them; the first ``startup`` s do not count.
        fewest_poses: that count: 600 numbers for 8 parameters.
        outlier_chance: prior chance of a pose.
        outlier_range: m from the truth, along each axis.
        walk: share of the weight, change of a force in a second: from a breath to a tumble.
        white: share of the weight: no rotor is known better than 0.1 %, none is worse than its own
            thrust.
        position: m: the best motion capture, a poor radio.
        attitude: rad.
        rise_times: s, of further starting tunings, with a tenth of the white noise.
        gusts: whether correlation times of force and torque are fitted.
        correlation: s: from a few poses to the length of an excerpt; a longer one is a walk.
    """

    startup: float = 1.0
    longest_gap: float = 0.5
    rows: int = 12_000
    excerpt: float = 4.0
    fewest_poses: int = 100
    outlier_chance: float = 0.01
    outlier_range: float = 1.0
    walk: tuple[float, float] = (1e-4, 10.0)
    white: tuple[float, float] = (6e-4, 0.6)
    position: tuple[float, float] = (2e-5, 0.3)
    attitude: tuple[float, float] = (1e-4, 0.5)
    rise_times: tuple[float, ...] = (1.0, 0.3, 0.1)
    gusts: bool = False
    correlation: tuple[float, float] = (0.02, 10.0)


@dataclass(frozen=True, eq=False)
class NoiseFit:
    """A tuning fitted to a log, beside the given one.

    Figures "before" are of the given tuning, "after" of the fitted one, both over the whole log
    without start-ups and outliers.

    Attributes:
        tuning: the fitted one.
        given: the given one.
        before: consistency of the given tuning.
        after: likewise, of the fitted one.
        log_likelihood_before: sum over the poses, outliers included.
        log_likelihood_after: sum over the poses, outliers included.
        outliers: poses, to the fitted tuning.
        rise_before: (3,) s of the force, (3,) s of the torque, 10-90 %.
        rise_after: likewise (s), of the fitted tuning.
        deviation: standard deviation of the logarithm of each fitted number (8,), of gusts (12,);
            NaN on a bound. Their order: force walk (horizontal, vertical), torque walk (the same),
            thrust, motor torque, position and attitude noise; the correlation times as the walks.
    """

    tuning: UKFTuning
    given: UKFTuning
    before: Consistency
    after: Consistency
    log_likelihood_before: float
    log_likelihood_after: float
    outliers: int
    rise_before: tuple[Array, Array]
    rise_after: tuple[Array, Array]
    deviation: Array

    def as_dict(self) -> dict[str, object]:
        """Return the fitted numbers, NIS and rise times as plain data."""
        names = dict.fromkeys(name for name, _ in _parameters(len(self.deviation)))
        return {name: np.asarray(getattr(self.tuning, name)).tolist() for name in names} | {
            "nis_before": self.before.nis,
            "nis_after": self.after.nis,
            "nis_band": list(chi2_band(MEASURED, self.after.poses)),
            "nis_over_second_before": self.before.nis_over_second,
            "nis_over_second_after": self.after.nis_over_second,
            "nis_over_second_band": list(chi2_band(MEASURED, self.after.seconds)),
            "log_likelihood_before": self.log_likelihood_before,
            "log_likelihood_after": self.log_likelihood_after,
            "force_rise_time_s": self.rise_after[0].tolist(),
            "torque_rise_time_s": self.rise_after[1].tolist(),
        }

    def __str__(self) -> str:
        (force, torque), (force_before, torque_before) = self.rise_after, self.rise_before
        return (
            f"Tuning fitted to this flight: rise time of force {_times(force)} s (before: "
            f"{_times(force_before)} s), of torque {_times(torque)} s (before: "
            f"{_times(torque_before)} s). {self.after}; before: {self.before.nis:.2f}, over a "
            f"second {self.before.nis_over_second:.3g}."
            + "".join(
                f" Correlation time of the {name}: {_times(np.asarray(time))} s."
                for name, time in (
                    ("force", self.tuning.force_time),
                    ("torque", self.tuning.torque_time),
                )
                if np.isfinite(time).any()
            )
        )


def _times(seconds: Array) -> str:
    low, high = f"{seconds.min():.2g}", f"{seconds.max():.2g}"
    return low if low == high else f"{low} to {high}"


def consistency_of(
    vehicle: Vehicle,
    t: ArrayLike,
    rotor_speeds: ArrayLike,
    position: ArrayLike,
    quaternion: ArrayLike,
    voltage: ArrayLike | None = None,
    tuning: UKFTuning | None = None,
) -> Consistency:
    """Return the consistency of a flight's innovations with a tuning, without a fit: arguments and
    errors as of ``fit_noise``.
    """
    columns = t, rotor_speeds, position, quaternion, voltage
    flight = _Flight(vehicle, columns, tuning, NoiseFitSettings())
    return flight.judge(flight.given)[0]


def fit_noise(
    vehicle: Vehicle,
    t: ArrayLike,
    rotor_speeds: ArrayLike,
    position: ArrayLike,
    quaternion: ArrayLike,
    voltage: ArrayLike | None = None,
    tuning: UKFTuning | None = None,
    settings: NoiseFitSettings | None = None,
) -> NoiseFit:
    """Find the tuning with the likeliest innovations of one flight.

    Args:
        vehicle: the declared vehicle; its declared effects are part of the filter's model.
        t: (N,) s, increasing.
        rotor_speeds: (N, 4) rad/s, at the instants of the rows; a step uses the mean of its ends.
        position: (N, 3) m, world; rows that are not finite have no pose.
        quaternion: (N, 4) body to world, scalar first; likewise.
        voltage: (N,) V; default: the vehicle's nominal one.
        tuning: the given one, to compare with; numbers beyond the fit (``kappa``, the noise of
            inertial sensors) stay. Default: ``UKFTuning.for_vehicle``.
        settings: default ``NoiseFitSettings()``.

    Raises:
        InputError: shapes differ, times do not increase, or fewer than 100 poses are left once
            held poses and start-ups are taken out.
    """
    columns = t, rotor_speeds, position, quaternion, voltage
    use = NoiseFitSettings() if settings is None else settings
    flight = _Flight(vehicle, columns, tuning, use)
    period, start_tuning = flight.period, flight.given
    pieces = flight.whole if len(flight.columns[0]) <= use.rows else _excerpts(flight)
    if _poses(pieces) < use.fewest_poses:
        pieces = flight.whole

    def evaluate(x: Array) -> Innovations:
        return flight.evaluate(_tuning(x, start_tuning, use), pieces)

    bounds = np.log(_bounds(vehicle, period, use))
    starts = [np.clip(_numbers(made), *bounds.T) for made in _starts(flight)]
    try:
        with ThreadPoolExecutor(min(len(bounds), os.cpu_count() or 1)) as threads:
            likeliest, deviation = _likeliest(evaluate, starts, bounds, threads)
            if use.gusts:
                starts = [np.append(likeliest, np.log(4 * [time])) for time in _GUSTS]
                wider = np.vstack([bounds, *4 * [np.log([use.correlation])]])
                gusts = _likeliest(evaluate, starts, wider, threads)
                totals = [evaluate(x).log_likelihood.sum() for x in (likeliest, gusts[0])]
                if totals[1] > totals[0] + _BY_CHANCE:
                    likeliest, deviation = gusts
        fitted = _tuning(likeliest, start_tuning, use)
        rise, rise_after = (rise_times(vehicle, made, period) for made in (start_tuning, fitted))
    except np.linalg.LinAlgError as error:
        raise InputError(f"fit_noise: no tuning suits these poses: {error}") from error
    before, likelihood, _ = flight.judge(start_tuning)
    after, likelihood_after, outliers = flight.judge(fitted)
    return NoiseFit(
        *(fitted, start_tuning, before, after, likelihood, likelihood_after),
        *(outliers, rise, rise_after, deviation),
    )


def _parameters(count: int) -> tuple[tuple[str, tuple[int, ...]], ...]:
    """Return the fitted numbers: eight, of gusts twelve."""
    return (*_PARAMETERS, *_TIMES)[:count]


def _likeliest(
    evaluate: Callable[[Array], Innovations], starts: list[Array], bounds: Array, threads: Executor
) -> tuple[Array, Array]:
    """Return the result of ``climb`` from the likeliest start."""
    likelihoods = [each.log_likelihood.sum() for each in threads.map(evaluate, starts)]
    return climb(evaluate, starts[int(np.argmax(likelihoods))], bounds, threads)


def _tuning(x: Array, start_tuning: UKFTuning, use: NoiseFitSettings) -> UKFTuning:
    """Return the tuning with logarithms ``x`` (8 or 12,) of the fitted numbers."""
    parameters = _parameters(len(x))
    values: dict[str, Any] = {name: np.empty(3) for name, _ in parameters}
    for (name, axes), value in zip(parameters, np.exp(x), strict=True):
        values[name][list(axes)] = value
    for name in values.keys() & {"force_time", "torque_time"}:  # on the upper bound: a walk
        values[name][values[name] > 0.99 * use.correlation[1]] = math.inf
    return replace(start_tuning, **values)


def _numbers(tuning: UKFTuning) -> Array:
    """Return the logarithms (8,) of a tuning's numbers; of several axes, their mean."""
    return np.array(
        [
            np.log(np.broadcast_to(np.asarray(getattr(tuning, name)), 3)[list(axes)]).mean()
            for name, axes in _PARAMETERS
        ]
    )


def _starts(flight: _Flight) -> list[UKFTuning]:
    """Return the given tuning, and variants with other walks and less white noise."""
    factors = {"force_walk": 1, "torque_walk": 1, "thrust_noise": 0.1, "motor_torque_noise": 0.1}
    others = (
        UKFTuning.for_vehicle(flight.vehicle, flight.period, r) for r in flight.use.rise_times
    )
    variants: list[dict[str, Any]] = [
        {name: factor * np.asarray(getattr(made, name)) for name, factor in factors.items()}
        for made in others
    ]
    return [flight.given, *(replace(flight.given, **variant) for variant in variants)]


def _bounds(vehicle: Vehicle, period: float, use: NoiseFitSettings) -> Array:
    """Return the smallest and the largest value (8, 2) of each fitted number."""
    moment = vehicle.weight * vehicle.arm_l
    walk = np.array(use.walk) * period**0.5  # in a step
    white = np.array(use.white) * (0.005 / period) ** 0.5
    bounds = {
        "force_walk": walk * vehicle.weight,
        "torque_walk": walk * moment,
        "thrust_noise": white * vehicle.weight,
        "motor_torque_noise": white * moment,
        "position_noise": np.array(use.position),
        "attitude_noise": np.array(use.attitude),
    }
    return np.array([bounds[name] for name, _ in _PARAMETERS])


def _excerpts(flight: _Flight) -> list[Piece]:
    """Return excerpts of a long flight, spread evenly over it."""
    use, t = flight.use, flight.columns[0]
    count = max(2, round(use.rows * flight.period / use.excerpt))
    pieces: list[Piece] = []
    for start in np.linspace(t[0], t[-1] - use.excerpt, count):
        rows = slice(*np.searchsorted(t, [start, start + use.excerpt]))
        pieces += flight.pieces(rows)
    return pieces


def _poses(pieces: Sequence[Piece]) -> int:
    """Return how many count."""
    return sum(int(piece.rows["counted"].sum()) for piece in pieces)


class _Flight:
    """One flight, checked: t, rotor speeds, position, quaternion, and voltage or None."""

    def __init__(
        self,
        vehicle: Vehicle,
        given: Sequence[ArrayLike | None],
        tuning: UKFTuning | None,
        use: NoiseFitSettings,
    ) -> None:
        columns: list[Any] = [None if c is None else np.asarray(c, dtype=np.float64) for c in given]
        times = columns[0]
        names = ("t", "rotor_speeds", "position", "quaternion", "voltage")
        for name, array, width in zip(names, columns, ((), (4,), (3,), (4,), ()), strict=True):
            if array is None:
                continue
            shape = (len(times), *width)
            if array.shape != shape:
                raise InputError(f"fit_noise: {name} must have shape {shape}, got {array.shape}")
            if name not in ("position", "quaternion") and not np.isfinite(array).all():
                raise InputError(f"fit_noise: {name} must be finite in every row")
        if len(times) < 2 or not np.all(np.diff(times) > 0):
            raise InputError(
                "fit_noise: expected two rows or more whose times t increase strictly, in s"
            )
        self.vehicle, self.columns, self.use = vehicle, columns, use
        self.period = float(np.median(np.diff(times)))
        self.given = UKFTuning.for_vehicle(vehicle, self.period) if tuning is None else tuning
        self.whole = self.pieces(slice(None))
        poses = _poses(self.whole)
        if poses < use.fewest_poses:
            raise InputError(
                f"fit_noise: {poses} of {len(times)} rows have a pose that does not "
                f"repeat the last one and comes {use.startup:g} s or more after a start; "
                f"expected at least {use.fewest_poses} to fit the tuning to"
            )

    def pieces(self, rows: slice) -> list[Piece]:
        """Return the pieces of some rows."""
        columns: list[Any] = [None if c is None else c[rows] for c in self.columns]
        t, speeds, position, quaternion, voltage = columns
        gap, startup = self.use.longest_gap, self.use.startup
        return pieces_of(self.vehicle, t, speeds, position, quaternion, voltage, gap, startup)

    def evaluate(self, tuning: UKFTuning, pieces: Sequence[Piece]) -> Innovations:
        """Return the result of a pass of the filter with this tuning."""
        chance, reach = self.use.outlier_chance, self.use.outlier_range
        return innovations(self.vehicle, tuning, self.period, pieces, chance, reach)

    def judge(self, tuning: UKFTuning) -> tuple[Consistency, float, int]:
        """Return consistency and log-likelihood of all poses under a tuning, and the count of
        outliers.
        """
        poses, consistency = self.evaluate(tuning, self.whole), Consistency()
        for pose in poses[~poses.outlier]:
            consistency.add(pose.t, pose.white)
        return consistency, float(poses.log_likelihood.sum()), int(poses.outlier.sum())
