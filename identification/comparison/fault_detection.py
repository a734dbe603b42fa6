"""The rotor that lost thrust, the time and the amount.

The thrusts follow the commands with a lag and a curve, both fitted. The only assumption is a
quadrotor with one rotor in each quadrant. Two questions are asked apart:

* Did torque or force jump, and when? A likelihood ratio over every time, with a step of any size in
  each channel of the balance (``fault_balance.py``) against none.
* The cause of the jump: each channel by itself gives a lost share of a rotor's thrust. For the
  failed rotor the shares agree, within the model's error for a rotor at a new working point. For
  another rotor they contradict each other in sign. Rivals are all rotors together, and a force and
  a torque without a rotor (a gust, a lost load, a collision).
"""

import math
from collections.abc import Iterable
from typing import NamedTuple

import numpy as np
from scipy.special import log_softmax, logsumexp, softmax

from ...runtime.arrays import Array
from ..logs.table import ArrayPair
from .fault_balance import PARTS, FaultBalance
from .fault_channels import STEP, Channels, Samples, sample

NOTHING, ALL, OTHER = "nothing", "all rotors", "another force or torque"
Interval = tuple[float, float, float]  # middle, low and high; of a trial: lag, bend and dead zone

_LOSSES = np.linspace(0.05, 1.0, 39)  # tried shares of a rotor's thrust
_ALL_LOSE = 0.5  # the largest share tried for all rotors together
_LAGS = (0.0, 0.015, 0.03, 0.05, 0.08, 0.12)  # s
# curves of thrust against command: the square's share, and the dead zone in parts of the
# median command
_CURVES = ((0.0, 0.0), (0.2, 0.0), (0.5, 0.0), (1.0, 0.0), (0.0, 0.3), (1.0, 0.3))
# prior of nothing; of each rotor, all rotors, another force or torque
_NOTHING = 0.5
_EVENTS = (*[0.075] * 4, 0.05, 0.15)
# the model's error of a loss, as a share: curve, lag and inflow of rotors at a new working point
_ERROR = 0.25
# standard deviation of a jump without a rotor, about x, y, z and along z, in parts of one rotor's
# usual torque and force there: the loss of a load of a third of the weight
_OTHER = (0.5, 0.5, 0.5, 1.3)
_SURE = 0.95  # least probability of a fault named without a doubt


class RotorFault(NamedTuple):
    """The result of a search in one flight."""

    samples: Samples
    # "nothing", rotors "1" to "4", "all rotors" and "another force or torque"; sum: 1
    probabilities: dict[str, float]
    # the likeliest rotor; onset as median, thrust as mean, each with a 95 % interval
    rotor: int
    onset: Interval  # s, on the log's clock
    remaining: Interval  # remaining share of thrust

    @property
    def seconds(self) -> float:
        """Seconds of the flight in the search."""
        return len(self.samples.t) * STEP

    @property
    def likeliest(self) -> str:
        """The likeliest of ``probabilities``."""
        return max(self.probabilities, key=self.probabilities.__getitem__)

    @property
    def sure(self) -> bool:
        """Whether the likeliest is sure."""
        return self.probabilities[self.likeliest] >= _SURE


def find_fault(channels: Channels) -> RotorFault:
    """Look for a rotor that lost thrust during a flight.

    Raises:
        InputError: too little flight.
    """
    samples = sample(channels)
    tried = _search(samples, channels.thrust_known)
    best = max(tried, key=lambda one: one.log)
    # a jump at each row, by each ramp
    jumps = best.steps(best.rows, best.ramps)
    starts = np.add.outer(STEP * (np.tile(PARTS, 2) - 0.5), samples.t[best.rows])
    evidence = logsumexp(jumps) - math.log(len(best.ramps) * len(samples.t))
    each, weights = _patterns(best)
    logs = np.log(_EVENTS) + each
    # the search, with free sizes, gives the likelihood of an event of any kind
    nothing = math.log(_NOTHING) + max(one.nothing for one in tried)
    chances = softmax(np.append(nothing, evidence + math.log(sum(_EVENTS)) + log_softmax(logs)))
    rotor = int(np.argmax(logs[:4]))
    _, least, most = _quantiles(_LOSSES, weights[rotor], 0.5 * (_LOSSES[1] - _LOSSES[0]))
    return RotorFault(
        samples,
        dict(zip([NOTHING, "1", "2", "3", "4", ALL, OTHER], chances.tolist(), strict=True)),
        1 + rotor,
        _quantiles(starts.ravel(), softmax(jumps).ravel(), STEP),
        (1.0 - weights[rotor] @ _LOSSES, max(0.0, 1.0 - most), min(1.0, 1.0 - least)),
    )


def _search(samples: Samples, thrust_known: bool) -> list[FaultBalance]:
    """Return all trials: lags, and then curves, each from the best so far."""
    tried = dict[Interval, FaultBalance]()

    def best_of(keys: Iterable[Interval]) -> Interval:
        for key in keys:
            tried[key] = tried.get(key) or FaultBalance(samples, *key)
        return max(tried, key=lambda key: tried[key].log)

    curves = _CURVES[:1] if thrust_known else _CURVES
    _, bend, dead = best_of((_LAGS[3], *curve) for curve in curves)
    lag, *_ = best_of((lag, bend, dead) for lag in _LAGS)
    best_of((lag, *curve) for curve in curves)
    return list(tried.values())


def _patterns(best: FaultBalance) -> ArrayPair:
    """Return the log-evidence (6,) of rotors 1 to 4, all rotors, and another force and torque; and
    the probabilities of ``_LOSSES`` for each rotor (4, E).
    """
    from scipy.stats import norm  # as late as can be: it takes .6 s

    each = _LOSSES[:, None]
    lost = each[_LOSSES <= _ALL_LOSE]

    def seen(columns: Array) -> Array:
        """Return the visible part (4,) of a column in each channel, and its deviation (4,)."""
        pairs = zip(best.channels, columns.T, strict=True)
        return np.array([channel.part(column) for channel, column in pairs]).T

    # each channel's visible part, its standard deviation, and the hypothesis' means and spread
    tried = [(*seen(best.lost(rotor)), each, _ERROR * each) for rotor in range(4)]
    # a jump of each channel, in parts of one rotor's usual torque or force there
    jumps = seen(np.tile(best.share[:, None], 4))
    tried.append((*jumps, lost * [0.0, 0.0, 0.0, 4.0], _ERROR * lost * [2.0, 2.0, 2.0, 4.0]))
    tried.append((*jumps, np.zeros((1, 1)), np.array(_OTHER)))
    # channels finite under every hypothesis, so all hypotheses explain the same numbers
    says = np.isfinite([std for _, std, *_ in tried]).all(axis=0)
    logs = [
        norm.logpdf(part, means, np.hypot(std, spread)).sum(axis=1, where=says)
        for part, std, means, spread in tried
    ]
    evidence = [logsumexp(log) - math.log(len(log)) for log in logs]
    return np.array(evidence), softmax(logs[:4], axis=1)


def _quantiles(values: Array, weight: Array, margin: float) -> Interval:
    """Return the median and the ends of a 95 % interval, widened by a step of the grid."""
    order = np.argsort(values, kind="stable")
    at = np.searchsorted(np.cumsum(weight[order]), (0.025, 0.5, 0.975))
    low, middle, high = values[order[np.minimum(at, len(order) - 1)]].tolist()
    return middle, low - margin, high + margin
