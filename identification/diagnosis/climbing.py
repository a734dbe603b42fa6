"""The mode of the posterior of some effects' coefficients, whatever likelihood it is of."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from .evidence import Index, Marginal, set_evidence
from .likelihood import declared
from .priors import Base, Setting
from .regression import Column, Flights, coefficient

# minus the logarithm of likelihood and prior at a setting, infinite where no vehicle is like that,
# and what returns the mode of the linearised posterior there
Height = tuple[float, Callable[[], Setting]]


@dataclass(frozen=True)
class ClimbSettings:
    """When a search for a mode ends."""

    rounds: int = 8
    shares: tuple[float, ...] = (1.0, 0.5, 0.2, 0.05)  # of a step, tried in turn
    least_gain: float = 0.3  # nats; a step that gains less is the last


CLIMB = ClimbSettings()


def mode(start: Setting, at: Callable[[Setting], Height]) -> Setting:
    """Return the mode of the posterior from a setting on (damped Gauss-Newton)."""
    here, (value, target) = start, at(start)
    for _ in range(CLIMB.rounds):
        there = target()
        for share in CLIMB.shares:
            trial = _between(here, there, share)
            after, onwards = at(trial)
            if after < value:
                break
        else:
            break
        gained, here, value, target = value - after, trial, after, onwards
        if gained < CLIMB.least_gain:
            break
    return here


def linear_mode(
    flights: Flights,
    base: Base,
    m: Marginal,
    asked: Index,
    columns: Sequence[Column],
    setting: Setting,
) -> Setting:
    """Return a setting with its coefficients at the mode of a quadratic likelihood, within their
    limits.

    Args:
        flights: of the vehicle.
        base: the columns' prior sizes and bounds.
        m: the likelihood of the columns that are asked about.
        asked: (c,) which of the base's columns they are.
        columns: (c,) effect and coefficient of each.
        setting: about which the likelihood is quadratic.
    """
    found = set_evidence(m, range(len(asked)), base.low[asked], base.high[asked])
    out: Setting = {e: dict(values) for e, values in setting.items()}
    for c, x in zip(columns, (found.mode * base.size[asked]).tolist(), strict=True):
        limits = coefficient(c)
        out[c[0]][c[1]] = min(max(declared(c, flights) + x, limits.minimum), limits.maximum)
    return out


def _between(here: Setting, there: Setting, share: float) -> Setting:
    """Return the setting that lies a share of the way from one to another of the same effects."""
    return {
        e: {
            name: values.get(name, 0.0) + share * (there[e][name] - values.get(name, 0.0))
            for name in there[e]
        }
        for e, values in here.items()
    }
