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
from typing import NamedTuple

import numpy as np
from scipy.special import log_softmax

from ...runtime.arrays import Array, Index, Mask
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


class _Difference(NamedTuple):
    """The difference (4,) of two sets, if nothing but the vehicle changed between them: a normal
    density for each of n ways (cuts into sessions and scales of the scatter).
    """

    mean: Array  # (n, 4)
    variance: Array  # (n, 4)
    log: Array  # (n,) log-likelihood of the flights in this way, normalised


def difference(after: Sequence[Trim], before: Sequence[Trim]) -> _Difference:
    """Return the difference of two sets of flights in the likeliest ways; either set is in the
    order of time.
    """
    # flights of one name stand together, behind those without a name
    every = [*before, *after]
    names = [trim.session for trim in every]
    order = sorted(range(len(every)), key=lambda i: names.index(names[i]) if names[i] else -1)
    trims = [every[i] for i in order]
    later = np.array(order) >= len(before)
    x = np.array([trim.features for trim in trims])
    noise = np.array([trim.noise for trim in trims])
    parts = (_of_cut(x, later, noise, cut, log) for cut, log in _cuts(trims, later, x))
    mean, variance, log = map(np.concatenate, zip(*parts, strict=True))
    log = log_softmax(log)
    keep = log > log.max() + _LEAST_LOG
    return _Difference(mean[keep], variance[keep], log[keep])


def _cuts(trims: Sequence[Trim], later: Mask, x: Array) -> Iterator[tuple[Index, float]]:
    """Yield each way to cut the flights into sessions: the number of each flight's session, and
    the logarithm of its prior.
    """
    apart = np.abs(np.diff(x, axis=0) / SESSION_STD).sum(axis=1)
    volts = np.array([trim.voltage for trim in trims])
    rises = np.diff(volts) > _RISE * volts[:-1]  # False where one is not known
    chance = np.where(rises, _ENDS_AT_RISE, _ENDS)
    names = np.array([trim.session for trim in trims])
    named = names != ""
    told = named[1:] | named[:-1] | np.diff(later)
    known = ~named[1:] | (names[1:] != names[:-1])
    order = np.argsort(np.where(told, np.inf, -apart), kind="stable")
    places = order[: min((~told).sum(), _MOST_ENDS)]
    for chosen in itertools.product((False, True), repeat=len(places)):
        ends = told & known
        ends[places] = chosen
        chances = np.where(ends, chance, 1.0 - chance)[places]
        yield np.append(0, np.cumsum(ends)), np.log(chances).sum()


def _of_cut(
    x: Array, later: Mask, noise: Array, cut: Index, log: float
) -> tuple[Array, Array, Array]:
    """Return mean and variance (k, 4) of the difference, and the flights' log-likelihood (k,).

    The difference is between flights (n, 4), ``later`` (n,) against earlier, at each pair of scales
    of the scatter; the vehicle's mean is integrated out.
    """
    wider = np.exp(2.0 * _SPREAD * _SCALES.T[..., None])
    session, flight = wider * np.square([[SESSION_STD], [FLIGHT_STD]])  # (k, 4) variances
    prior = -0.5 * np.square(_SCALES).sum(axis=1)
    weight = 1.0 / (flight[:, None] + noise)  # (k, n, 4)
    of = np.eye(cut[-1] + 1)[cut]  # (n, sessions)
    # products of the vehicle's mean, the difference, and the flights under the inverse covariance;
    # flights of a session share its error (Woodbury)
    parts = np.stack(np.broadcast_arrays(1.0, later[:, None], x))
    sums = np.einsum("ns,knf,pnf->pksf", of, weight, parts)
    shrink = session[:, None] / (1.0 + session[:, None] * sums[0])
    (aa, ab, ax), (_, bb, bx), (*_, xx) = np.einsum(
        "knf,pnf,qnf->pqkf", weight, parts, parts
    ) - np.einsum("ksf,pksf,qksf->pqkf", shrink, sums, sums)
    determinant = aa * bb - ab**2
    mean = (aa * bx - ab * ax) / determinant
    level = (bb * ax - ab * bx) / determinant
    left = xx - level * ax - mean * bx + np.log(determinant) - np.log(weight).sum(axis=1)
    left += np.log1p(session[:, None] * sums[0]).sum(axis=1)
    return mean, aa / determinant, log + prior - 0.5 * left.sum(axis=1)
