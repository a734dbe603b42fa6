"""The difference of two sets of a vehicle's flights, with scatter from flight to flight and from
session to session.

A battery is never put in twice at the same place, and a vehicle is taken apart between two days:
all flights of one session are off by the same, and by more than they differ among each other. So
ten flights of one session say little more of the vehicle than two. The user names the flights of a
session. Without names, batteries (a voltage that rises from one flight to the next) and the flights
themselves tell: every way to cut their sequence into sessions counts by its likelihood. The common
error of a session cancels if both sets have flights in the session. The vehicle's own scale of the
scatter, at either level, is summed over likewise.
"""

import itertools
from collections.abc import Iterator, Sequence

import numpy as np
from scipy.special import log_softmax

from ...runtime.arrays import Array, Mask
from .trim import Trim

# Scatter of unchanged flights in the four numbers of a trim. Measured on 89 flights of one
# Crazyflie, 7 of them unchanged (CrazyPAD, vehicle E8; Masalimov and others, Data 2024, 9, 79).
# Standard deviations between sessions: the differences of sides and of the diagonals, in parts of
# the total, and the total's logarithm. A shift of the centre of mass by 1 % of the arm is 0.01 of a
# side
SESSION_STD = (0.015, 0.01, 0.01, 0.02)
# between flights of a session
FLIGHT_STD = (0.0035, 0.0035, 0.005, 0.006)
# standard deviation of the logarithm of one vehicle's own scale of scatter, at a level
_SPREAD = 0.5
# (k, 2) standard deviations of the two scales in the sum, between sessions and within one
_SCALES = np.array([*itertools.product(np.linspace(-2.0, 2.0, 7), repeat=2)])
# probability of a session's end between two flights, and the same at a rise of the voltage by at
# least this share
_ENDS = 0.3
_ENDS_AT_RISE = 0.9
_RISE = 0.01
_MOST_ENDS = 8  # possible ends of sessions: the largest differences between flights
_LEAST_LOG = -12.0  # below the likeliest way; less likely ways do not count


def difference(after: Sequence[Trim], before: Sequence[Trim]) -> tuple[Array, Array, Array]:
    """Return the difference of two sets of flights, if nothing but the vehicle changed: mean and
    variance (n, 4) of a normal density for each of the n likeliest ways (cuts into sessions and
    scales of the scatter), and the ways' log-likelihood (n,), normalised.

    Either set is in the order of time.
    """
    flights = [*before, *after]
    later = np.arange(len(flights)) >= len(before)
    x = np.array([trim.features for trim in flights])
    noise = np.square([trim.std for trim in flights])
    scales = np.exp(2.0 * _SPREAD * _SCALES.T[..., None])
    session, flight = scales * np.square([[SESSION_STD], [FLIGHT_STD]])  # (k, 4) variances
    own = (flight[..., None] + noise.T)[..., None] * np.eye(len(x))  # (k, 4, n, n)
    # the vehicle's mean, the difference, and the flights
    columns = np.stack(np.broadcast_arrays(1.0, later, x.T), axis=-1)
    ways = []
    for same, log in _cuts(flights, later, x):
        root = np.linalg.cholesky(own + session[..., None, None] * same)
        # triangular, of independent errors: the vehicle's mean is integrated out
        r = np.asarray(np.linalg.qr(np.linalg.solve(root, columns), mode="r"))
        a, b = r[..., 0, 0], r[..., 1, 1]
        size = np.log(np.diagonal(root, axis1=2, axis2=3)).sum(axis=2) + np.log(np.abs(a * b))
        left = size + 0.5 * (r[..., 2:, 2] ** 2).sum(axis=2)
        log = log - 0.5 * (_SCALES**2).sum(axis=1) - left.sum(axis=1)
        ways.append((r[..., 1, 2] / b, b**-2.0, log))
    mean, variance, logs = map(np.concatenate, zip(*ways, strict=True))
    keep = logs > logs.max() + _LEAST_LOG
    return mean[keep], variance[keep], log_softmax(logs)[keep]


def _cuts(flights: Sequence[Trim], later: Mask, x: Array) -> Iterator[tuple[Mask, float]]:
    """Yield each way to cut the flights into sessions: the pairs (n, n) of one session, and the
    logarithm of its prior.
    """
    names = np.array([trim.session for trim in flights])
    volts = np.array([trim.voltage for trim in flights])
    told = (names[:, None] == names) & (names != "")
    # between two flights without a name, of one set
    unknown = (names[1:] == "") & (names[:-1] == "") & ~np.diff(later)
    apart = unknown * np.abs(np.diff(x, axis=0) / SESSION_STD).sum(axis=1)
    places = np.argsort(-apart, kind="stable")[: min(unknown.sum(), _MOST_ENDS)]
    rises = np.diff(volts) > _RISE * volts[:-1]  # False where one is not known
    chance = np.where(rises, _ENDS_AT_RISE, _ENDS)[places]
    for chosen in itertools.product((False, True), repeat=len(places)):
        ends = ~unknown
        ends[places] = chosen
        number = np.append(0, np.cumsum(ends))
        same = told | (number[:, None] == number)
        yield same, np.log(np.where(chosen, chance, 1.0 - chance)).sum()
