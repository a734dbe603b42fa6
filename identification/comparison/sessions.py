"""By how much two sets of a vehicle's flights differ, where flights scatter from one to the next
and from session to session.

A battery is never put in twice at the same place, and a vehicle is taken apart between two days:
all flights of one session are off by the same, and by more than they differ among each other. So
ten flights of one session say little more of the vehicle than two. Which flights belong together is
named by the user; or told by the batteries (a voltage that rises from one flight to the next) and
by the flights themselves: every way to cut their sequence into sessions counts by its likelihood.
What all flights of a session are off by cancels where it has flights of both sets. How much one
vehicle scatters more or less than others, at either level, is summed over likewise.
"""

import itertools
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.special import log_softmax

from ...runtime.arrays import Array, Index
from .trim import Trim

# How unchanged flights differ, in the four numbers of a trim, measured on 89 flights of one
# Crazyflie, 7 of them unchanged (CrazyPAD, vehicle E8; Masalimov and others, Data 2024, 9, 79).
# Standard deviations between sessions, of the differences of sides and of the diagonals, in parts
# of the total, and of the total's logarithm; a centre of mass that moves by 1 % of the arm is 0.01
# of a side
SESSION_STD = (0.015, 0.01, 0.01, 0.02)
# between flights of a session
FLIGHT_STD = (0.0035, 0.0035, 0.005, 0.006)
# standard deviation of the logarithm by which one vehicle scatters more or less, at a level
_SPREAD = 0.5
_SCALES = 7  # of either level, within two standard deviations, over which is summed
# probability that a session ends between two flights; and where the voltage rises there, by at
# least this share
_ENDS = 0.3
_ENDS_AT_RISE = 0.9
_RISE = 0.01
_MOST_ENDS = 8  # places where a session may end, those where flights differ most
_LEAST_LOG = -12.0  # below the likeliest way; what is less likely does not count


@dataclass(frozen=True, eq=False)
class Difference:
    """What the difference (4,) of two sets may be, if nothing changed between them but the vehicle:
    a normal density of each of n ways, which are cuts into sessions and scales of the scatter.
    """

    mean: Array  # (n, 4)
    variance: Array  # (n, 4)
    log: Array  # (n,) logarithm of how likely the flights are in that way, normalised


def difference(after: Sequence[Trim], before: Sequence[Trim]) -> Difference:
    """Return what the difference of two sets of flights may be, in the likeliest ways; either set
    is in the order of time.
    """
    # flights of one name stand together, behind those without a name
    every = [*((trim, 0.0) for trim in before), *((trim, 1.0) for trim in after)]
    names = [trim.session for trim, _ in every]
    every.sort(key=lambda flown: names.index(flown[0].session) if flown[0].session else -1)
    trims, later = [trim for trim, _ in every], np.array([which for _, which in every])
    x = np.array([trim.features for trim in trims])
    noise = np.array([trim.noise for trim in trims])
    parts = (_of_cut(x, later, noise, cut, log) for cut, log in _cuts(trims, later, x))
    mean, variance, log = map(np.concatenate, zip(*parts, strict=True))
    log = log_softmax(log)
    keep = log > log.max() + _LEAST_LOG
    return Difference(mean[keep], variance[keep], log[keep])


def _cuts(trims: Sequence[Trim], later: Array, x: Array) -> list[tuple[Index, float]]:
    """Return each way to cut the flights into sessions: the number of each flight's session, and
    the logarithm of its prior.
    """
    apart = np.abs(np.diff(x, axis=0) / SESSION_STD).sum(axis=1)
    volts = np.array([np.nan if trim.voltage is None else trim.voltage for trim in trims])
    rises = np.diff(volts) > _RISE * volts[:-1]  # False where one is not known
    chance = np.where(rises, _ENDS_AT_RISE, _ENDS)
    names = np.array([trim.session for trim in trims])
    told = (names[1:] != "") | (names[:-1] != "") | (np.diff(later) != 0.0)
    known = np.where(names[1:] != "", names[1:] != names[:-1], True)
    places = np.argsort(np.where(told, np.inf, -apart), kind="stable")
    places = places[: min(int((~told).sum()), _MOST_ENDS)]
    out = []
    for chosen in itertools.product((False, True), repeat=len(places)):
        ends = told & known
        ends[places] = chosen
        log = float(np.log(np.where(ends, chance, 1.0 - chance)[places]).sum())
        out.append((np.concatenate([[0], np.cumsum(ends)]).astype(np.int64), log))
    return out


def _of_cut(
    x: Array, later: Array, noise: Array, cut: Index, log: float
) -> tuple[Array, Array, Array]:
    """Return mean and variance (k, 4) of the difference between flights (n, 4) that are ``later``
    (n,) and those that are not, and the logarithm (k,) of how likely they are, at each pair of
    scales of the scatter; the vehicle's mean is integrated out.
    """
    scale = np.linspace(-2.0, 2.0, _SCALES)
    wider = np.exp(2.0 * _SPREAD * scale)[:, None]
    session = np.repeat(wider * np.square(SESSION_STD), _SCALES, axis=0)  # (k, 4) variances
    flight = np.tile(wider * np.square(FLIGHT_STD), (_SCALES, 1))
    prior = -0.5 * np.add.outer(scale**2, scale**2).ravel()
    weight = 1.0 / (flight[:, None] + noise)  # (k, n, 4)
    of = np.eye(int(cut[-1]) + 1)[cut]  # (n, sessions)
    # of the vehicle's mean, the difference, and the flights: products under the inverse covariance
    # of flights that share their session's error (Woodbury)
    parts = np.stack([np.ones_like(x), np.broadcast_to(later[:, None], x.shape), x])
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
