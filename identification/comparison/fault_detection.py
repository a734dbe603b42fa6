"""Which rotor lost thrust, when and how much.

The thrusts follow the commands with a lag and a curve, both fitted. A quadrotor with one rotor in
each quadrant is all that is assumed. Two questions are asked apart:

* Did torque or force jump, and when? A likelihood ratio over every time, with a step of whatever
  size in each channel of the balance (``balance.py``) against none.
* What jumped? Each channel says by itself what share of a rotor's thrust would be lost. For the
  rotor that failed, they agree, within what the model gets wrong of a rotor that suddenly works
  elsewhere; for another rotor they contradict each other in sign. Rivals are all rotors together,
  and a force and a torque that no rotor makes (a gust, a load that fell, a collision).
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.special import logsumexp
from scipy.stats import norm

from .fault_balance import AT_ONCE, Begin, FaultBalance
from .fault_channels import STEP, Channels, Samples, sample
from .fault_noise import Noise

Array = NDArray[np.float64]

NOTHING, ALL, OTHER = "nothing", "all rotors", "another force or torque"


@dataclass(frozen=True)
class FaultSettings:
    """What is tried, and when a fault is named."""

    losses: tuple[float, float] = (0.05, 1.0)  # share of a rotor's thrust
    all_lose: float = 0.5  # the most that is tried of all rotors together
    lags: tuple[float, ...] = (0.0, 0.015, 0.03, 0.05, 0.08, 0.12)  # s
    # curves of thrust against command: the square's share, and the dead zone in parts of the
    # median command
    curves: tuple[tuple[float, float], ...] = (
        *((0.0, 0.0), (0.2, 0.0), (0.5, 0.0), (1.0, 0.0), (0.0, 0.3), (1.0, 0.3)),
    )
    # before the log is looked at: nothing, one of the rotors, all rotors, another force or torque
    prior: tuple[float, float, float, float] = (0.5, 0.3, 0.05, 0.15)
    # what the model gets wrong of a loss, as a share of it: curve, lag and inflow of rotors that
    # suddenly work elsewhere
    error: float = 0.25
    before: int = 25  # intervals of flight before a fault, at least: what is usual
    after: int = 4  # intervals after a fault, at least, that show it
    places: int = 2000  # where a fault may begin, at most
    steps: int = 39  # of ``losses`` that are tried
    parts: tuple[float, ...] = (0.0, 0.25, 0.5, 0.75)  # of an interval, where a fault may begin
    # standard deviation of a jump that no rotor makes, about x, y, z and along z, in parts of what
    # one rotor's usual thrust does there: a load of a third of the weight that falls
    other: tuple[float, float, float, float] = (0.5, 0.5, 0.5, 1.3)
    rounds: int = 2  # of fitting the noise and looking again
    sure: float = 0.95  # probability from which a fault is named without a doubt


FAULTS = FaultSettings()


@dataclass(frozen=True, eq=False)
class RotorFault:
    """What a search found in one flight."""

    samples: Samples  # of the flight
    # of "nothing", rotors "1" to "4", "all rotors" and "another force or torque"; they sum to one
    probabilities: dict[str, float]
    # of the likeliest rotor: median and the ends of a 95 % interval
    rotor: int
    onset: tuple[float, float, float]  # s, of the log's clock
    remaining: tuple[float, float, float]  # share of its thrust that is left

    @property
    def seconds(self) -> float:
        """Seconds of flight that were looked at."""
        return len(self.samples.t) * STEP

    @property
    def likeliest(self) -> str:
        """The likeliest of ``probabilities``."""
        return max(self.probabilities, key=self.probabilities.__getitem__)

    @property
    def sure(self) -> bool:
        """Whether the likeliest is sure."""
        return self.probabilities[self.likeliest] >= FAULTS.sure


def find_fault(channels: Channels) -> RotorFault:
    """Look for a rotor that lost thrust during a flight.

    Raises:
        InputError: too little flight.
    """
    use, samples = FAULTS, sample(channels)
    search = _Search(samples, _rows(len(samples.t)))
    search.find_curve(channels.thrust_known)
    best = search.tried[search.likeliest()]
    evidence, starts, start_weights = search.onsets(best)
    names = ["1", "2", "3", "4", ALL, OTHER]
    each, shares, weights = _patterns(best)
    prior = np.array([*[use.prior[1] / 4] * 4, use.prior[2], use.prior[3]])
    logs = np.log(prior) + each
    # the prior of an event of some kind is in ``prior``; how likely it is that there was one, with
    # sizes left free, is the search's
    whole = np.array([math.log(use.prior[0]) + search.nothing()])
    shape = logs - logsumexp(logs)
    happened = evidence + math.log(float(prior.sum()))
    every = np.concatenate([whole, happened + shape])
    chances = np.exp(every - logsumexp(every))
    rotor = 1 + int(np.argmax(logs[:4]))
    return RotorFault(
        samples,
        dict(zip([NOTHING, *names], chances.tolist(), strict=True)),
        rotor,
        _quantiles(starts, start_weights, STEP),
        _remaining(shares, weights[rotor - 1]),
    )


def _patterns(best: "_Tried") -> tuple[Array, Array, Array]:
    """Return the log-evidence (6,) of rotors 1 to 4, of all rotors and of another force and torque
    from what the channels say; shares (E,) that may be lost, and how likely each is by each rotor
    (4, E).
    """
    use = FAULTS
    shares = np.linspace(*use.losses, use.steps)
    lost = shares[shares <= use.all_lose, None]
    jumps = best.balance.jumps(best.noise, best.row, best.begin)
    # what each channel sees, its standard deviation, and by the hypothesis: means and their spread
    tried: list[tuple[Array, Array, Array, Array]] = []
    for rotor in range(4):
        loss = best.balance.losses(best.noise, rotor, best.row, best.begin)
        tried.append((*loss, shares[:, None] * np.ones(4), use.error * shares[:, None]))
    means, spread = lost * [0.0, 0.0, 0.0, 4.0], use.error * lost * [2.0, 2.0, 2.0, 4.0]
    tried.append((*jumps, means, spread))
    tried.append((*jumps, np.zeros((1, 4)), np.array([use.other])))
    # only what speaks under every hypothesis, so that all explain the same numbers
    says = np.isfinite([std for _, std, *_ in tried]).all(axis=0)
    logs = [
        norm.logpdf(seen[says], means[:, says], np.hypot(std, spread)[:, says]).sum(axis=1)
        for seen, std, means, spread in tried
    ]
    evidence = np.array([logsumexp(log) - math.log(len(log)) for log in logs])
    return evidence, shares, np.array([np.exp(log - logsumexp(log)) for log in logs[:4]])


def _rows(count: int) -> NDArray[np.int64]:
    """Return where a fault may begin: everywhere, or in a long flight evenly spread and everywhere
    near the end, where little is left to see it by.
    """
    rows, most = np.arange(FAULTS.before, count - FAULTS.after), FAULTS.places
    if len(rows) > most:
        early = rows[: -most // 4]
        step = math.ceil(len(early) / (0.75 * most))
        rows = np.concatenate([early[::step], rows[-most // 4 :]])
    return rows


@dataclass(frozen=True, eq=False)
class _Tried:
    """One lag and curve: the noise that fits it best, and the likeliest jump with that."""

    balance: FaultBalance
    usual: list[Noise]  # if nothing happened
    noise: list[Noise]  # with the jump
    log: float
    row: int
    begin: Begin


class _Search:
    """The likeliest jump, with the lags and curves that were tried."""

    def __init__(self, samples: Samples, rows: NDArray[np.int64]) -> None:
        self.samples, self.rows = samples, rows
        self.begins = [Begin(part, lagged) for lagged in (False, True) for part in FAULTS.parts]
        self.tried: dict[tuple[float, float, float], _Tried] = {}

    def find_curve(self, thrust_known: bool) -> None:
        """Try lags, and then curves, each from the best so far."""
        middle = FAULTS.lags[len(FAULTS.lags) // 2]
        curves = FAULTS.curves[:1] if thrust_known else FAULTS.curves
        for curve in curves:
            self._try((middle, *curve))
        _, bend, dead = self.likeliest()
        for lag in FAULTS.lags:
            self._try((lag, bend, dead))
        lag = self.likeliest()[0]
        for curve in curves:
            self._try((lag, *curve))

    def likeliest(self) -> tuple[float, float, float]:
        """Return the lag and the curve with the likeliest jump."""
        return max(self.tried, key=lambda key: self.tried[key].log)

    def _try(self, key: tuple[float, float, float]) -> None:
        if key in self.tried:
            return
        one = FaultBalance(self.samples, self.samples.thrust(*key), key[0])
        usual = one.noises()
        noise = usual
        for _ in range(FAULTS.rounds):
            _, row, begin = self._jump(one, noise)
            noise = one.noises(row, begin)
        self.tried[key] = _Tried(one, usual, noise, *self._jump(one, noise))

    def _jump(self, one: FaultBalance, noise: list[Noise]) -> tuple[float, int, Begin]:
        """Return the log-likelihood, the row and the kind of the likeliest jump."""
        rows_around = self._rows_around(one.steps(noise, self.rows, AT_ONCE))
        logs = np.array([one.steps(noise, rows_around, begin) for begin in self.begins])
        j, k = np.unravel_index(int(np.argmax(logs)), logs.shape)
        return float(logs[j, k]), int(rows_around[k]), self.begins[j]

    def _rows_around(self, log: Array) -> NDArray[np.int64]:
        """Return the rows around the likeliest of ``rows``, also those left out between them."""
        k = int(np.argmax(log))
        low, high = self.rows[max(k - 2, 0)], self.rows[min(k + 2, len(log) - 1)]
        return np.arange(low, high + 1)

    def nothing(self) -> float:
        """Return the log-likelihood of no jump."""
        return max(
            max(one.balance.nothing(one.usual), one.balance.nothing(one.noise))
            for one in self.tried.values()
        )

    def onsets(self, best: _Tried) -> tuple[float, Array, Array]:
        """Return the log-evidence of a jump, when it may have begun (T,) in s, and how likely each
        time is (T,).
        """
        logs = np.array([best.balance.steps(best.noise, self.rows, b) for b in self.begins])
        rows = np.arange(max(best.row - 5, FAULTS.before), min(best.row + 6, self.rows[-1] + 1))
        fine = np.array([best.balance.steps(best.noise, rows, begin) for begin in self.begins])
        parts = np.array([begin.part for begin in self.begins])
        starts = self.samples.t[rows][None] + STEP * (parts[:, None] - 0.5)
        evidence = max(float(logsumexp(logs)), float(logsumexp(fine)))
        places = len(self.begins) * len(self.samples.t)
        weights = np.exp(fine - logsumexp(fine))
        return evidence - math.log(places), starts.ravel(), weights.ravel()


def _remaining(shares: Array, weight: Array) -> tuple[float, float, float]:
    """Return the share of thrust that is left: mean and the ends of a 95 % interval."""
    _, low, high = _quantiles(shares, weight, 0.5 * float(shares[1] - shares[0]))
    return 1.0 - float(weight @ shares), max(0.0, 1.0 - high), min(1.0, 1.0 - low)


def _quantiles(values: Array, weight: Array, margin: float) -> tuple[float, float, float]:
    """Return the median and the ends of a 95 % interval, widened by a step of the grid."""
    order = np.argsort(values, kind="stable")
    values, weight = values[order], weight[order]
    total = np.cumsum(weight)
    low, middle, high = (
        float(values[min(int(np.searchsorted(total, q)), len(values) - 1)])
        for q in (0.025, 0.5, 0.975)
    )
    return middle, low - margin, high + margin
