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
from operator import attrgetter
from typing import Any, NamedTuple

import numpy as np
from scipy.special import log_softmax, logsumexp, softmax

from ...runtime.arrays import Array
from ..logs.table import ArrayPair
from .change import SURE
from .fault_balance import SIGNS, STARTS, FaultBalance
from .fault_channels import STEP, Samples

NOTHING, ALL, OTHER = "nothing", "all rotors", "another force or torque"
ROTORS = ("rotor 1", "rotor 2", "rotor 3", "rotor 4")

_LOSSES = np.linspace(0.05, 1.0, 39)  # tried shares of a rotor's thrust
_ALL_LOSE = 0.5  # the largest share tried for all rotors together
_LAGS = (0.0, 0.015, 0.03, 0.05, 0.08, 0.12)  # s
_USUAL_LAG = 0.05  # s, beside each of the curves
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


class RotorFault(NamedTuple):
    """The result of a search in one flight; of no rotor, the last six are None."""

    samples: Samples
    log: str  # its name
    flight_s: float
    ended_because: str | None  # reason for the end of the search; None: the log's end
    probabilities: dict[str, float]  # nothing, each rotor, all rotors, and another cause; sum: 1
    found: str  # the likeliest
    sure: bool  # at least ``SURE``
    rotor: int | None = None  # 1 to 4
    motor: str | None = None  # the log's own name
    # onset as median, share of thrust as mean, each with a 95 % interval
    onset_s: Any = None  # on the log's clock
    onset_ci95_s: Any = None
    remaining: Any = None
    remaining_ci95: Any = None


def find_fault(samples: Samples) -> RotorFault:
    """Look for a rotor that lost thrust during a flight."""
    tried = [FaultBalance(samples, _USUAL_LAG, curve) for curve in _CURVES]
    curve = max(tried, key=attrgetter("log")).curve
    tried += [FaultBalance(samples, lag, curve) for lag in _LAGS]
    best = max(tried, key=attrgetter("log"))
    jumps = best.steps(best.rows, best.ramps)
    each, weights = _patterns(best)
    logs = np.log(_EVENTS) + each
    # the search, with free sizes, gives the likelihood of an event of any kind
    event = logsumexp(jumps) + math.log(sum(_EVENTS) / (len(jumps) * len(samples.t)))
    nothing = math.log(_NOTHING) + max(one.nothing for one in tried)
    chances = softmax(np.append(nothing, event + log_softmax(logs)))
    causes = dict(zip([NOTHING, *ROTORS, ALL, OTHER], chances.tolist(), strict=True))
    found = max(causes, key=causes.__getitem__)
    fault = RotorFault(
        samples,
        samples.name,
        len(samples.t) * STEP,
        samples.ended,
        causes,
        found,
        causes[found] >= SURE,
    )
    if found not in ROTORS:
        return fault
    i = ROTORS.index(found)
    starts = np.add.outer(STEP * (STARTS - 0.5), samples.t[best.rows])
    onset, begin, end = _interval(starts.ravel(), softmax(jumps).ravel(), STEP)
    margin = 0.5 * (_LOSSES[1] - _LOSSES[0])
    _, least, most = _interval(1.0 - _LOSSES, weights[i], margin)
    return fault._replace(
        rotor=i + 1,
        motor=samples.motor_names[i] if samples.motor_names else None,
        onset_s=onset,
        onset_ci95_s=(begin, end),
        remaining=1.0 - weights[i] @ _LOSSES,
        remaining_ci95=(max(0.0, least), min(1.0, most)),
    )


def _patterns(best: FaultBalance) -> ArrayPair:
    """Return the log-evidence (6,) of rotors 1 to 4, all rotors, and another force and torque; and
    the probabilities of ``_LOSSES`` for each rotor (4, E).
    """
    each = _LOSSES[:, None]
    few = each[_LOSSES <= _ALL_LOSE]
    jump = np.tile(best.share[:, None], 4)
    # each cause's shape in the channels (N, 4), and by amount the means and standard deviations of
    # its size there. A bare jump is in parts of one rotor's usual torque or force
    causes = [
        *((jump * best.thrust[:, [i]] * SIGNS[:, i], each, _ERROR * each) for i in range(4)),
        (jump, few * [0.0, 0.0, 0.0, 4.0], _ERROR * few * [2.0, 2.0, 2.0, 4.0]),
        (jump, np.zeros((1, 1)), np.array(_OTHER)),
    ]
    sizes = [
        np.transpose([c.part(x) for c, x in zip(best.channels, shape.T, strict=True)])
        for shape, *_ in causes
    ]
    # channels finite under every hypothesis, so all hypotheses explain the same numbers
    says = np.isfinite(sizes).all(axis=(0, 1))
    logs = []
    for (size, std), (_, means, spread) in zip(sizes, causes, strict=True):
        variance = std**2 + spread**2
        off = (size - means) ** 2 / variance + np.log(variance)
        logs.append(-0.5 * off.sum(axis=1, where=says))
    evidence = [logsumexp(log) - math.log(len(log)) for log in logs]
    return np.array(evidence), softmax(logs[:4], axis=1)


def _interval(values: Array, weight: Array, margin: float) -> tuple[float, float, float]:
    """Return the median and the ends of a 95 % interval, widened by a step of the grid."""
    order = np.argsort(values, kind="stable")
    at = np.searchsorted(np.cumsum(weight[order]), (0.5, 0.025, 0.975))
    middle, low, high = values[order[at]].tolist()
    return middle, low - margin, high + margin
