"""The mean of a vehicle's flights, which scatter from flight to flight and from session to session.

A battery is never put in twice at the same place, and a vehicle is taken apart between two days:
all flights of one session are off by the same, and by more than they differ among each other. So
ten flights of one session say little more of the vehicle than two. Which flights belong together is
told by the batteries (a voltage that rises from one flight to the next) and by the flights
themselves: every way to cut their sequence into sessions counts by its likelihood. How much one
vehicle scatters more or less than others, at either level, is summed over likewise.
"""

import itertools
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .trim import Trim

Array = NDArray[np.float64]


@dataclass(frozen=True)
class ScatterSettings:
    """How unchanged flights differ, in the four numbers of a trim.

    Measured on 89 flights of one Crazyflie, 7 of them unchanged (CrazyPAD, vehicle E8; Masalimov
    and others, Data 2024, 9, 79).
    """

    # standard deviations between sessions, of the differences of sides and of the diagonals, in
    # parts of the total, and of the total's logarithm; a centre of mass that moves by 1 % of the
    # arm is 0.01 of a side
    session: tuple[float, float, float, float] = (0.015, 0.01, 0.01, 0.02)
    # between flights of a session
    flight: tuple[float, float, float, float] = (0.0035, 0.0035, 0.005, 0.006)
    # standard deviation of the logarithm by which one vehicle scatters more or less, at a level
    spread: float = 0.5
    scales: int = 7  # of either level, within two standard deviations, over which is summed
    # probability that a session ends between two flights; and where the voltage rises there, by at
    # least this share
    ends: float = 0.3
    ends_at_rise: float = 0.9
    rise: float = 0.01
    most_ends: int = 6  # places where a session may end, those where flights differ most
    least_log: float = -12.0  # below the likeliest way; what is less likely does not count


SCATTER = ScatterSettings()


@dataclass(frozen=True, eq=False)
class Means:
    """What the mean (4,) of the unchanged vehicle may be: a normal density of each of n ways, which
    are cuts into sessions and scales of the scatter.
    """

    mean: Array  # (n, 4)
    variance: Array  # (n, 4)
    log: Array  # (n,) logarithm of how likely the flights are in that way
    scale: NDArray[np.intp]  # (n,) which scales of the scatter it has


def means_of(trims: Sequence[Trim]) -> Means:
    """Return what the mean of the flights' sessions is, in their order of time."""
    x = np.array([trim.features for trim in trims])
    noise = np.mean([np.diagonal(trim.noise) for trim in trims], axis=0)
    session, flight, _ = _scales()
    flight = flight + noise
    parts = [_of_cut(x, cut, session, flight, log) for cut, log in _cuts(trims, x)]
    means, variances, logs = (np.concatenate(part) for part in zip(*parts, strict=True))
    return Means(means, variances, logs, np.tile(np.arange(len(session)), len(parts)))


def difference(after: Sequence[Trim], before: Sequence[Trim]) -> Means:
    """Return what the difference of two sets' means may be, of the likeliest ways; their ``log``
    are normalised.
    """
    a, b = means_of(after), means_of(before)
    i, j = np.nonzero(a.scale[:, None] == b.scale)
    log = a.log[i] + b.log[j] + _scales()[2][a.scale[i]]
    log -= np.logaddexp.reduce(log)
    keep = log > log.max() + SCATTER.least_log
    i, j, log = i[keep], j[keep], log[keep]
    return Means(a.mean[i] - b.mean[j], a.variance[i] + b.variance[j], log, a.scale[i])


def _scales() -> tuple[Array, Array, Array]:
    """Return the variances (k, 4) between sessions and between flights at each pair of scales, and
    the logarithms (k,) of its prior.
    """
    use = SCATTER
    grid = np.linspace(-2.0, 2.0, use.scales)
    first, second = (x.ravel() for x in np.meshgrid(grid, grid, indexing="ij"))
    return (
        np.exp(2.0 * use.spread * first)[:, None] * np.square(use.session),
        np.exp(2.0 * use.spread * second)[:, None] * np.square(use.flight),
        -0.5 * (first**2 + second**2),
    )


def _cuts(trims: Sequence[Trim], x: Array) -> list[tuple[NDArray[np.intp], float]]:
    """Return each way to cut the flights into sessions: the number of each flight's session, and
    the logarithm of its prior.
    """
    use = SCATTER
    apart = np.abs(np.diff(x, axis=0) / use.session).sum(axis=1)
    volts = np.array([np.nan if trim.voltage is None else trim.voltage for trim in trims])
    rises = np.diff(volts) > use.rise * volts[:-1]  # False where one is not known
    chance = np.where(rises, use.ends_at_rise, use.ends)
    places = np.argsort(-apart, kind="stable")[: use.most_ends]
    out = []
    for chosen in itertools.product((False, True), repeat=len(places)):
        ends = np.zeros(len(apart), dtype=np.bool_)
        ends[places] = chosen
        log = float(np.log(np.where(ends, chance, 1.0 - chance)[places]).sum())
        out.append((np.concatenate([[0], np.cumsum(ends)]).astype(np.intp), log))
    return out


def _of_cut(
    x: Array, cut: NDArray[np.intp], session: Array, flight: Array, log: float
) -> tuple[Array, Array, Array]:
    """Return mean and variance (k, 4) of the vehicle's mean, and the logarithm (k,) of how likely
    flights (n, 4) are, for variances (k, 4) between sessions and flights; the vehicle's mean is
    integrated out.
    """
    count = np.bincount(cut)
    middle = np.array([x[cut == i].mean(axis=0) for i in range(len(count))])
    within = np.square(x - middle[cut]).sum(axis=0)
    freedom = len(x) - len(count)
    logs = -0.5 * (within / flight + freedom * np.log(2.0 * np.pi * flight)).sum(axis=1)
    logs -= 2.0 * np.log(count).sum()
    variance = session[:, None] + flight[:, None] / count[:, None]  # (k, sessions, 4)
    total = (1.0 / variance).sum(axis=1)
    mean = (middle / variance).sum(axis=1) / total
    off = np.square(middle - mean[:, None]) / variance + np.log(2.0 * np.pi * variance)
    logs += 0.5 * (np.log(2.0 * np.pi / total).sum(axis=1) - off.sum(axis=(1, 2)))
    return mean, 1.0 / total, logs + log
