"""How likely a flight's innovations are under a tuning: one pass of the filter.

Prediction error decomposition (Schweppe, *Evaluation of likelihood functions for Gaussian signals*,
IEEE Trans. Information Theory 11, 1965): the likelihood of a flight is the product of its
innovations' likelihoods, each normal with the filter's covariance S. The logarithm is ``-1/2
sum(NIS + log det S + 6 log 2 pi)``.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .. import _core
from ..dynamics.effects.own import raise_errors
from ..dynamics.vehicle import Vehicle
from .estimate import Array
from .reference import multiply, rotation_matrix, to_mrp
from .tuning import UKFTuning
from .ukf import WrenchUKF

Mask = NDArray[np.bool_]

_TWIST = 0.03  # s between the poses whose difference starts a piece's velocity
_MRP_VOLUME = 4.0 * math.pi / 3.0  # volume of all attitudes: MRPs of at most length 1

# A row of a flight; layouts of ``core/innovations.hpp``
ROW = np.dtype(
    [
        ("t", "f8"),  # s
        ("dt", "f8"),  # s since the row before
        ("sample", "f8", (11,)),  # mean rotor speeds of the way there, position, quaternion
        ("voltage", "f8"),  # V
        ("measured", "?"),  # a pose is there
        ("counted", "?"),  # and the filter's start is over
    ],
    align=True,
)
# The result of a pass at a pose
INNOVATION = np.dtype(
    [
        ("t", "f8"),  # s
        ("nis", "f8"),
        ("log_likelihood", "f8"),  # given all poses before
        ("outlier", "?"),  # likelier an outlier than a pose of this filter
        ("innovation", "f8", (6,)),  # (rho, x), rho an MRP
        ("white", "f8", (6,)),  # whitened: six standard normal numbers, if the filter is right
        ("root", "f8", (6, 6)),  # root of the innovation's covariance, lower triangular
    ],
    align=True,
)
Innovations = Any  # a record array of INNOVATION


@dataclass(frozen=True, eq=False)
class Piece:
    """Rows of a flight without a long gap, from one with a pose on.

    A row with the last row's pose, to the last digit, counts as without one: a sensor's noise does
    not repeat, so the pose was held.
    """

    position: Array  # (3,) m, world, at its start
    quaternion: Array  # (4,)
    velocity: Array  # (3,) m/s, world
    angular_velocity: Array  # (3,) rad/s, body
    rows: np.ndarray  # (K,) of ROW, each further row


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
    """Return a flight of N rows in pieces, cut at gaps of more than ``longest_gap`` s without a
    pose. The poses of a piece's first ``startup`` s do not count.

    Args:
        vehicle: its nominal voltage stands in for an unlogged one.
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
        back = pose[first, 3:] * [1.0, -1.0, -1.0, -1.0]
        turn = to_mrp(multiply(pose[second, 3:], back))  # a quarter of it, world
        row = np.zeros(last - first, dtype=ROW)
        row["t"], row["dt"] = t[steps], np.diff(t[first : last + 1])
        row["sample"][:, 4:] = pose[steps]
        row["sample"][:, :4] = 0.5 * (rotor_speeds[here] + rotor_speeds[steps])
        row["voltage"] = vehicle.voltage_ref
        if voltage is not None:
            row["voltage"] = 0.5 * (voltage[here] + voltage[steps])
        row["measured"] = measured[steps]
        row["counted"] = measured[steps] & (t[steps] > t[first] + startup)
        velocity = (pose[second, :3] - pose[first, :3]) / span
        rate = rotation_matrix(pose[first, 3:]).T @ turn * (4.0 / span)
        pieces.append(Piece(pose[first, :3], pose[first, 3:], velocity, rate, row))
    return pieces


def innovations(
    vehicle: Vehicle,
    tuning: UKFTuning,
    period: float,
    pieces: Sequence[Piece],
    outlier_chance: float,
    outlier_range: float,
    covariance: Array | None = None,
) -> Innovations:
    """Return the likelihoods (M,) of the counted poses under a tuning.

    With a chance of ``outlier_chance`` a pose is an outlier: anywhere within ``outlier_range`` of
    the prediction along each axis, with any attitude. A likely outlier is not taken in. However far
    off, an outlier costs the logarithm of this density: a few wild poses cannot dominate.

    Args:
        vehicle: with its declared effects.
        tuning: the filter's.
        period: s, of the tuning.
        pieces: the flight's.
        outlier_chance: from 0, every pose is taken in, to 1.
        outlier_range: m.
        covariance: (18, 18) at the start of each piece; default: the filter's own.
    """
    density = outlier_chance / ((2.0 * outlier_range) ** 3 * _MRP_VOLUME)
    outlier = math.log(density) if density > 0.0 else -math.inf
    counted_poses = []
    for piece in pieces:
        ukf = WrenchUKF(vehicle, tuning, period)
        twist = {"velocity": piece.velocity, "angular_velocity": piece.angular_velocity}
        ukf.reset(piece.position, piece.quaternion, covariance, **twist)
        out = np.zeros(len(piece.rows), dtype=INNOVATION)
        inlier = math.log1p(-outlier_chance)
        memory = piece.rows.view(np.uint8), out.view(np.uint8)
        _core.judge_rows(ukf.record.ctypes.data, memory[0], inlier, outlier, memory[1])
        raise_errors()
        counted_poses.append(out[piece.rows["counted"]])
    return np.concatenate(counted_poses).view(np.recarray)


def fisher_information(poses: Innovations, moved: Sequence[Innovations], step: float) -> Array:
    """Return the expected information (n, n) on n parameters; each of ``moved`` has one parameter
    moved by ``step``.

    Normal innovations have ``sum(d_i y' S^-1 d_j y + tr(S^-1 d_i S S^-1 d_j S) / 2)`` (Schweppe
    1965); outliers have none.
    """
    regular = ~np.logical_or.reduce([poses.outlier, *(m.outlier for m in moved)])
    inverse, mean = np.linalg.inv(poses.root[regular]), poses.innovation[regular]
    slopes = []
    for each in moved:
        change = inverse @ (each.innovation[regular] - mean)[:, :, np.newaxis]
        # L^-1 M is near 1: L^-1 (MM' - LL') L^-T = (L^-1 M)(L^-1 M)' - 1
        D = inverse @ each.root[regular]
        covariance = math.sqrt(0.5) * (D @ np.swapaxes(D, 1, 2) - np.eye(6))
        slopes.append(np.concatenate([change.ravel(), covariance.ravel()]))
    information: Array = np.array(slopes) @ np.array(slopes).T / (step * step)
    return information
