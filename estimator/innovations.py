"""How likely a flight's innovations are under a tuning: one compiled pass of the filter.

Prediction error decomposition (Schweppe, *Evaluation of likelihood functions for Gaussian signals*,
IEEE Trans. Information Theory 11, 1965): the likelihood of a flight is the product of those of its
innovations, each normal with the covariance S that the filter states, so its logarithm is
``-1/2 sum(NIS + log det S + 6 log 2 pi)``.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray

from ..dynamics.rotation import attitude_error, quaternion_to_matrix
from ..dynamics.vehicle import Vehicle
from ..runtime.compiled import Record, compiled, compiled_without_gil
from ..runtime.errors import InputError
from .estimate import Array
from .recovery import remember
from .sample import undo_sensing
from .tuning import UKFTuning
from .ukf import WrenchUKF, innovate, predict, take_in

Mask = NDArray[np.bool_]

_SLACK = 0.1  # of a period: a step so little too long is still one step
_TWIST = 0.03  # s between the poses whose difference starts a piece's velocity
_MRP_VOLUME = 4.0 * math.pi / 3.0  # of all attitudes: MRPs of at most length 1
_CONSTANT = -3.0 * math.log(2.0 * math.pi)  # of a normal density of six numbers


@dataclass(frozen=True, eq=False)
class Piece:
    """Rows of a flight without a long gap, from one with a pose on.

    A row whose pose repeats that of the last one to the last digit is one without: a sensor's noise
    does not repeat, so the pose was held.
    """

    position: Array  # (3,) m, world, at its start
    quaternion: Array  # (4,)
    velocity: Array  # (3,) m/s, world
    angular_velocity: Array  # (3,) rad/s, body
    dt: Array  # (K,) s, to each further row
    samples: Array  # (K, 11) mean rotor speeds of the way there, position, quaternion
    voltage: Array  # (K,) V
    measured: Mask  # (K,) a pose is there
    counted: Mask  # (K,) and the filter's start is over


@dataclass(frozen=True, eq=False)
class Innovations:
    """What a pass found at the M poses that count."""

    nis: Array  # (M,)
    log_likelihood: Array  # (M,) of each pose, given all before it
    outlier: Mask  # (M,) likelier an outlier than a pose of this filter
    innovation: Array  # (M, 6) of (rho, x), rho an MRP
    root: Array  # (M, 6, 6) of its covariance, lower triangular


def pieces_of(
    vehicle: Vehicle,
    t: Array,
    rotor_speeds: Array,
    position: Array,
    quaternion: Array,
    voltage: Array | None,
    longest_gap: float,
    startup: float,
) -> list[Piece]:
    """Return a flight of N rows in pieces, cut where no pose came for more than
    ``longest_gap`` s; the poses of the first ``startup`` s of each do not count.

    Args:
        vehicle: whose nominal voltage stands in where none was logged.
        t: (N,) s, increasing.
        rotor_speeds: (N, 4) rad/s.
        position: (N, 3) m, world; a row that is not finite has no pose.
        quaternion: (N, 4), body to world, scalar first; likewise, or where it is zero.
        voltage: (N,) V or None.
        longest_gap: s.
        startup: s.
    """
    length = np.linalg.norm(quaternion, axis=1, keepdims=True)
    pose = np.column_stack([position, quaternion / np.where(length > 0.0, length, np.nan)])
    measured: Mask = np.asarray(np.isfinite(pose).all(axis=1))
    seen = np.flatnonzero(measured)
    if seen.size:
        held = (np.diff(pose[seen], axis=0) == 0.0).all(axis=1)
        measured[seen[1:][held]] = False
        seen = np.flatnonzero(measured)
    ends = np.flatnonzero(np.diff(t[seen]) > longest_gap) + 1
    pieces = []
    for rows in np.split(seen, ends):
        later = rows[t[rows] >= t[rows[0]] + _TWIST] if rows.size else rows
        if not later.size:
            continue
        first, second, last = int(rows[0]), int(later[0]), int(rows[-1])
        here, steps = slice(first, last), slice(first + 1, last + 1)
        span = t[second] - t[first]
        turn, rotation = np.empty(3), np.empty((3, 3))
        attitude_error(pose[second, 3:], pose[first, 3:], turn)  # a quarter of it, world
        quaternion_to_matrix(pose[first, 3:], rotation)
        pieces.append(
            Piece(
                pose[first, :3],
                pose[first, 3:],
                (pose[second, :3] - pose[first, :3]) / span,
                rotation.T @ turn * (4.0 / span),
                np.diff(t[first : last + 1]),
                np.column_stack([0.5 * (rotor_speeds[here] + rotor_speeds[steps]), pose[steps]]),
                np.full(last - first, vehicle.voltage_ref)
                if voltage is None
                else 0.5 * (voltage[here] + voltage[steps]),
                measured[steps],
                measured[steps] & (t[steps] > t[first] + startup),
            )
        )
    return pieces


def innovations(
    vehicle: Vehicle,
    tuning: UKFTuning,
    period: float,
    pieces: Sequence[Piece],
    outlier_chance: float,
    outlier_range: float,
) -> Innovations:
    """Return how likely the poses of these pieces are to a filter with this tuning.

    With a chance of ``outlier_chance`` a pose is an outlier, which lies anywhere within
    ``outlier_range`` of the prediction along each axis and has any attitude. A pose that is
    likelier that than not is not taken in, and it costs the logarithm of this density however far
    off it is: a few wild poses cannot dominate.

    Args:
        vehicle: with its declared effects.
        tuning: what the filter assumes of noise.
        period: s, to which the tuning belongs.
        pieces: of the flight.
        outlier_chance: between 0 and 1.
        outlier_range: m.
    """
    density = outlier_chance / ((2.0 * outlier_range) ** 3 * _MRP_VOLUME)
    found = []
    for piece in pieces:
        ukf = WrenchUKF(vehicle, tuning, period)
        ukf.reset(
            piece.position,
            piece.quaternion,
            velocity=piece.velocity,
            angular_velocity=piece.angular_velocity,
        )
        count = len(piece.dt)
        out = Innovations(
            np.empty(count),
            np.empty(count),
            np.zeros(count, dtype=np.bool_),
            np.empty((count, 6)),
            np.empty((count, 6, 6)),
        )
        _pass(
            ukf.record,
            piece.dt,
            piece.samples,
            piece.voltage,
            piece.measured,
            period,
            math.log1p(-outlier_chance),
            math.log(density),
            out.nis,
            out.log_likelihood,
            out.outlier,
            out.innovation,
            out.root,
        )
        found.append([getattr(out, f.name)[piece.counted] for f in fields(out)])
    return Innovations(*(np.concatenate(part) for part in zip(*found, strict=True)))


@compiled_without_gil
def _pass(
    record: Record,
    dt: Array,
    samples: Array,
    voltage: Array,
    measured: Mask,
    period: float,
    log_inlier: float,
    log_outlier: float,
    nis: Array,
    likelihood: Array,
    outlier: Mask,
    innovation: Array,
    root: Array,
) -> None:
    f = record[0]
    for k in range(len(dt)):
        z = undo_sensing(f, samples[k], 3 if measured[k] else 0, dt[k])
        steps = max(1, math.ceil(dt[k] / period - _SLACK))
        for _ in range(steps):
            predict(f, z[0:4], dt[k] / steps, voltage[k])
        if not measured[k]:
            continue
        # the filter's own gate and restarts stay out: the likelihood of outliers is stated here
        nis[k] = innovate(f, z[4:7], z[7:11], True, True)
        log_normal = log_inlier + _CONSTANT - 0.5 * nis[k]
        for i in range(6):
            log_normal -= math.log(f.L[i, i])
            innovation[k, i] = 0.0
            for j in range(i + 1):
                root[k, i, j] = f.L[i, j]
                innovation[k, i] += f.L[i, j] * f.innovation[j]  # which is whitened
        if log_normal > log_outlier:
            likelihood[k] = log_normal + math.log1p(math.exp(log_outlier - log_normal))
            take_in(f)
            remember(f, z[4:7], z[7:11], True, True)
            continue
        # an outlier, or numbers that are none
        outlier[k] = True
        likelihood[k] = log_outlier
        if log_normal > log_outlier - 40.0:
            likelihood[k] += math.log1p(math.exp(log_normal - log_outlier))


def fisher_information(found: Innovations, moved: Sequence[Innovations], step: float) -> Array:
    """Return the expected information (n, n) on n parameters, of which ``moved`` have one each
    moved by ``step``.

    Of normal innovations it is ``sum(d_i y' S^-1 d_j y + tr(S^-1 d_i S S^-1 d_j S) / 2)``
    (Schweppe 1965); outliers tell nothing.
    """
    information = np.zeros((len(moved), len(moved)))
    slopes = np.zeros((len(moved), 42))
    kept = ~np.logical_or.reduce([found.outlier, *(m.outlier for m in moved)])
    _add_information(
        found.innovation,
        found.root,
        np.stack([m.innovation for m in moved]),
        np.stack([m.root for m in moved]),
        kept,
        slopes,
        information,
    )
    return information / (step * step)


@compiled
def _add_information(
    innovation: Array,
    root: Array,
    moved_innovation: Array,
    moved_root: Array,
    kept: Mask,
    slopes: Array,
    information: Array,
) -> None:
    n = len(slopes)
    D = np.empty((6, 6))
    for k in range(len(innovation)):
        if not kept[k]:
            continue
        L = root[k]
        for p in range(n):
            slope, M = slopes[p], moved_root[p, k]
            for i in range(6):
                total = moved_innovation[p, k, i] - innovation[k, i]
                for j in range(i):
                    total -= L[i, j] * slope[j]
                slope[i] = total / L[i, i]
            # L^-1 M is near 1: L^-1 (MM' - LL') L^-T = (L^-1 M)(L^-1 M)' - 1
            for j in range(6):
                for i in range(6):
                    total = M[i, j] if j <= i else 0.0
                    for m in range(i):
                        total -= L[i, m] * D[m, j]
                    D[i, j] = total / L[i, i]
            for i in range(6):
                for j in range(6):
                    total = -1.0 if i == j else 0.0
                    for m in range(6):
                        total += D[i, m] * D[j, m]
                    slope[6 + 6 * i + j] = math.sqrt(0.5) * total
        for p in range(n):
            for q in range(p + 1):
                total = 0.0
                for i in range(42):
                    total += slopes[p, i] * slopes[q, i]
                information[p, q] += total
                if p != q:
                    information[q, p] += total


def check_flight(
    t: Array,
    rotor_speeds: Array,
    position: Array,
    quaternion: Array,
    voltage: Array | None,
) -> None:
    """Raise InputError where shapes differ, times do not increase or a rotor speed or voltage is
    not finite; see ``pieces_of``.
    """
    count = len(t)
    for name, value, shape in (
        ("t", t, (count,)),
        ("rotor_speeds", rotor_speeds, (count, 4)),
        ("position", position, (count, 3)),
        ("quaternion", quaternion, (count, 4)),
        ("voltage", voltage, (count,)),
    ):
        if value is None:
            continue
        if value.shape != shape:
            raise InputError(f"fit_noise: {name} must have shape {shape}, got {value.shape}")
        if name in ("t", "rotor_speeds", "voltage") and not np.all(np.isfinite(value)):
            raise InputError(f"fit_noise: {name} must be finite in every row")
    if count < 2 or not np.all(np.diff(t) > 0):
        raise InputError(
            "fit_noise: expected two rows or more whose times t increase strictly, in s"
        )
