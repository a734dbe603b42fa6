"""Which rotor lost thrust, when and how much: a likelihood ratio over every rotor and every time.

The thrusts follow the commands with a lag and a curve, both fitted. A quadrotor with one rotor in
each quadrant is all that is assumed. A fault of rotor i at a time leaves the share ``1 - loss`` of
its thrust from then on, in all four channels of the balance (``balance.py``). Rivals: nothing
happened; all rotors lost; a steady force and torque began (a gust, a load that fell), free in each
channel. Each hypothesis is weighed by its evidence, summed over times and losses, with the noise,
the lag and the curve that fit it best.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.special import logsumexp

from .balance import Balance
from .channels import STEP, Channels, Samples, sample
from .noise import Noise

Array = NDArray[np.float64]

NOTHING, ALL, OTHER = "nothing", "all rotors", "another force or torque"


@dataclass(frozen=True)
class FaultSettings:
    """What is tried, and when a fault is named."""

    losses: tuple[float, float] = (0.05, 1.0)  # share of a rotor's thrust
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
    # lags and curves that are looked at this finely: so many, and this near to the best
    finer: int = 5
    finer_within: float = 12.0  # of log-likelihood
    sure: float = 0.95  # probability from which a fault is named without a doubt


@dataclass(frozen=True, eq=False)
class RotorFault:
    """What a search found in one flight."""

    name: str  # of the log
    # of "nothing", rotors "1" to "4", "all rotors" and "another force or torque"; they sum to one
    probabilities: dict[str, float]
    # of the likeliest rotor: median and the ends of a 95 % interval
    rotor: int
    onset: tuple[float, float, float]  # s, of the log's clock
    remaining: tuple[float, float, float]  # share of its thrust that is left
    sure_from: float
    seconds: float  # of flight that were looked at
    ended: str  # why nothing later was looked at; empty: the log's end
    lag: float  # s, of the rotors
    motor_names: tuple[str, str, str, str] | None

    @property
    def likeliest(self) -> str:
        """The likeliest of ``probabilities``."""
        return max(self.probabilities, key=self.probabilities.__getitem__)

    @property
    def sure(self) -> bool:
        """Whether the likeliest is sure."""
        return self.probabilities[self.likeliest] >= self.sure_from


def find_fault(channels: Channels, settings: FaultSettings | None = None) -> RotorFault:
    """Look for a rotor that lost thrust during a flight.

    Raises:
        InputError: too little flight.
    """
    use = FaultSettings() if settings is None else settings
    samples = sample(channels)
    losses = np.linspace(*use.losses, use.steps)
    rows = _rows(len(samples.t), use)
    search = _Search(samples, rows, losses, use)
    search.find_curve(channels.thrust_known)
    nothing = search.nothing()
    found = {name: search.best(name) for name in _LOSERS}
    other = search.steps()
    logs = np.array([nothing, *(found[name][0] for name in found), other])
    prior = [use.prior[0], *[use.prior[1] / 4] * 4, use.prior[2], use.prior[3]]
    logs += np.log(prior)
    names = [NOTHING, *found, OTHER]
    chances = np.exp(logs - logsumexp(logs))
    rotor = 1 + int(np.argmax(logs[1:5]))
    _, starts, weight, lag = found[str(rotor)]
    when = _quantiles(starts, weight.sum(axis=1), 0.5 * STEP * use.parts[1])
    remaining = _remaining(losses, weight.sum(axis=0), use.error)
    return RotorFault(
        channels.name,
        dict(zip(names, chances.tolist(), strict=True)),
        rotor,
        when,
        remaining,
        use.sure,
        len(samples.t) * STEP,
        samples.ended,
        lag,
        channels.motor_names,
    )


def _rows(count: int, use: FaultSettings) -> NDArray[np.int64]:
    """Return where a fault may begin: everywhere, or in a long flight evenly spread and everywhere
    near the end, where little is left to see it by.
    """
    rows = np.arange(use.before, count - use.after)
    if len(rows) > use.places:
        early = rows[: -use.places // 4]
        step = math.ceil(len(early) / (0.75 * use.places))
        rows = np.concatenate([early[::step], rows[-use.places // 4 :]])
    return rows


class _Search:
    """Evidence of each hypothesis, with the lags and curves that were tried."""

    def __init__(
        self, samples: Samples, rows: NDArray[np.int64], losses: Array, use: FaultSettings
    ) -> None:
        self.samples, self.rows, self.losses, self.use = samples, rows, losses, use
        self.coarse_losses = losses[:: max(1, len(losses) // 10)]
        self.balances: dict[tuple[float, float, float], Balance] = {}
        self.usual: dict[tuple[float, float, float], list[Noise]] = {}
        # by hypothesis, then by lag and curve: log-likelihood at its best and the noise there
        self.tried: dict[str, dict[tuple[float, float, float], tuple[float, list[Noise]]]] = {
            name: {} for name in _LOSERS
        }

    def find_curve(self, thrust_known: bool) -> None:
        """Try lags, and then curves, each from the best so far."""
        use = self.use
        middle = use.lags[len(use.lags) // 2]
        curves = use.curves[:1] if thrust_known else use.curves
        for curve in curves:
            self._try((middle, *curve))
        _, bend, dead = self._likeliest()
        for lag in use.lags:
            self._try((lag, bend, dead))
        lag = self._likeliest()[0]
        for curve in curves:
            self._try((lag, *curve))

    def _likeliest(self) -> tuple[float, float, float]:
        scores = {key: max(self.tried[name][key][0] for name in _LOSERS) for key in self.balances}
        return max(scores, key=scores.__getitem__)

    def _try(self, key: tuple[float, float, float]) -> None:
        if key in self.balances:
            return
        one = Balance(self.samples, self.samples.thrust(*key), key[0])
        self.balances[key] = one
        self.usual[key] = one.noises(one.residuals(np.zeros(4), 0, 0.0))
        for name, rotors in _LOSERS.items():
            noise = self.usual[key]
            best = -math.inf
            for _ in range(2):
                log = one.losses(noise, rotors, self.rows, self.coarse_losses, 0.0, self.use.error)
                k, e = np.unravel_index(int(np.argmax(log)), log.shape)
                best = float(log.max())
                row, loss = int(self.rows[k]), float(self.coarse_losses[e])
                noise = one.noises(one.residuals(rotors, row, loss))
            self.tried[name][key] = (best, noise)

    def nothing(self) -> float:
        """Return the evidence that nothing happened."""
        return max(one.nothing(self.usual[key]) for key, one in self.balances.items())

    def best(self, name: str) -> tuple[float, Array, Array, float]:
        """Return the evidence of a loss, the times (T,) at which it may have begun, the weights (T,
        E) of times and sizes, and the rotors' lag in s.
        """
        use, rotors = self.use, _LOSERS[name]
        ranked = sorted(self.tried[name].items(), key=lambda item: -item[1][0])
        fine = []
        for key, (best, noise) in ranked[: use.finer]:
            if best < ranked[0][1][0] - use.finer_within:
                break
            one = self.balances[key]
            log = one.losses(noise, rotors, self.rows, self.losses, 0.0, use.error)
            k, e = np.unravel_index(int(np.argmax(log)), log.shape)
            noise = one.noises(one.residuals(rotors, int(self.rows[k]), float(self.losses[e])))
            log = one.losses(noise, rotors, self.rows, self.losses, 0.0, use.error)
            fine.append((log, one, noise))
        coarse = np.array([log for log, _, _ in fine])
        over = coarse.max(axis=(0, 2))
        near = np.flatnonzero(over > over.max() - use.finer_within)
        # the rows beside those that count, also those that a long flight's spacing left out
        low, high = self.rows[max(near[0] - 1, 0)], self.rows[min(near[-1] + 1, len(over) - 1)]
        rows = np.arange(low, high + 1) if high - low < use.places else self.rows[near]
        logs = np.array(
            [
                [one.losses(noise, rotors, rows, self.losses, p, use.error) for p in use.parts]
                for _, one, noise in fine
            ]
        )  # (combinations, P, K, E)
        top = logs.max()
        weight = np.exp(logs - top)
        each = weight.sum(axis=(1, 2, 3))
        places = len(self.samples.t) * len(use.parts) * len(self.losses)
        evidence = top + math.log(each.max()) - math.log(places)
        lag = float(each @ [one.lag for _, one, _ in fine] / each.sum())
        weight = weight.sum(axis=0).transpose(1, 0, 2).reshape(-1, len(self.losses))
        starts = self.samples.t[rows][:, None] + STEP * (np.array(use.parts) - 0.5)
        return float(evidence), starts.ravel(), weight / weight.sum(), lag

    def steps(self) -> float:
        """Return the evidence of another force and torque that began."""
        found = -math.inf
        for key, one in self.balances.items():
            noise = self.usual[key]
            for _ in range(2):
                k = int(np.argmax(one.steps(noise, self.rows)))
                noise = one.noises(one.step_residuals(int(self.rows[k])))
            log = one.steps(noise, self.rows)
            found = max(found, float(logsumexp(log)) - math.log(len(self.rows)))
        return found


# which rotors lose thrust, by hypothesis
_LOSERS: dict[str, Array] = {**{str(i + 1): np.eye(4)[i] for i in range(4)}, ALL: np.ones(4)}


def _remaining(losses: Array, weight: Array, error: float) -> tuple[float, float, float]:
    """Return the share of thrust that is left, and the ends of a 95 % interval.

    The thrust that a rotor would have is known to the share ``error`` where it works far from what
    is usual, and what is lost is seen as a share of that.
    """
    mean = float(weight @ losses)
    width = float(losses[1] - losses[0])
    variance = float(weight @ np.square(losses - mean)) + width**2 / 12.0 + (error * mean) ** 2
    reach = 1.96 * math.sqrt(variance)
    return 1.0 - mean, max(0.0, 1.0 - mean - reach), min(1.0, 1.0 - mean + reach)


def _quantiles(values: Array, weight: Array, margin: float) -> tuple[float, float, float]:
    """Return the median and the ends of a 95 % interval, widened by a step of the grid."""
    total = np.cumsum(weight)
    low, middle, high = (
        float(values[min(int(np.searchsorted(total, q)), len(values) - 1)])
        for q in (0.025, 0.5, 0.975)
    )
    return middle, low - margin, high + margin
