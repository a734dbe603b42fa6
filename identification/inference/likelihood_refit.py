"""What least squares of the residual gets wrong, measured by innovations instead.

The noise of the pose goes through the flight loop into the rotors, so the residual's noise follows
the turn rates. What differs little from their delay, or scales the attitude with its noise, comes
out wrong: a motor_lag of 13 ms as 4 to 11 ms behind turn rates that act 2 to 6 ms late, a gain of
the attitude by up to a fifth too large on fast flights and as its triple on gentle ones. What no
past pose foretells has no such noise. (It is less robust: turn rates that are rounded look like
quick gusts.)
"""

from dataclasses import dataclass
from typing import Literal

import numpy as np

from .innovations import Innovations
from .regression import DELAY_EFFECTS, LATE_ROTOR_EFFECTS, REGRESSION, SHIFT, Column, coefficient
from .search import SEARCH, Fit, Search, started


@dataclass(frozen=True)
class RefitSettings:
    """How coefficients are refitted to the innovations, and how a lag is told from a delay."""

    iterations: int = 3  # of Gauss-Newton; the second changes little
    # times the residual's deviance; a refit that leaves more of the residual is not used
    most_deviance_ratio: float = 1.05
    largest_delay: float = 0.1  # s, of the rotors where a latency or a clock_offset is named
    first_lag_share: float = 0.3  # share of the whole delay that is taken for a lag at the start
    delay_iterations: int = 5  # of Gauss-Newton, where a lag is told from a delay
    # standard deviations of a lag, which do not include the rounding of rotor speeds: a delay of
    # 9 ms has looked like 4 of them
    least_lag_in_std: float = 6.0
    # share of the whole delay from which it is a lag, and from which it may be one; behind 34 true
    # delays it was up to 0.47, and once 0.7
    least_share_of_lag: float = 0.5
    least_share_of_possible_lag: float = 0.3


REFIT = RefitSettings()
# effects that least squares of the residual gets wrong
BIASED_EFFECTS = frozenset({"attitude_gain", "motor_lag"})

_LAG = "motor_lag", "tau"
_DELAYS = ("latency", "d"), ("clock_offset", "dt")

Lateness = Literal["as behind a lag", "as behind a delay", "either way"]


def measured(search: Search, fit: Fit) -> Fit:
    """Return the fit with its coefficients at the maximum likelihood of the innovations, if it has
    an effect that needs it.

    Standard deviations are no smaller than those of the residual.
    """
    late = [(effect, name) for effect, name in _DELAYS if effect in fit.effects]
    if search.flights.commanded or not BIASED_EFFECTS & set(fit.effects) or len(late) > 1:
        return fit
    # what delays is measured as turn rates that act late: a pose that is moved would take its noise
    # along
    found = _likeliest(
        search,
        _shifted(fit),
        REFIT.largest_delay if late else REGRESSION.rotor_time_offset_range[1],
        REFIT.iterations,
    )
    for effect, name in late:
        c = coefficient((effect, name))
        delay = {name: float(np.clip(found.setting[SHIFT[0]].pop(SHIFT[1]), c.minimum, c.maximum))}
        found.setting = {
            k: found.setting.get(k, delay) for k in fit.setting
        }  # in the order in which they were found
        found.std[effect, name] = found.std.pop(SHIFT)
    found.std = {
        column: max(value, fit.std.get(column, 0.0)) for column, value in found.std.items()
    }
    return found if _is_close(search, found, fit) else fit


def lateness(search: Search, fit: Fit) -> Lateness | None:
    """Return how rotors that a fit has late follow, turn rates being free to act late; None where
    nothing named is late.
    """
    late = LATE_ROTOR_EFFECTS & set(fit.effects)
    if search.flights.commanded or len(late) != 1 or (behind := _behind(fit)) <= 0.0:
        return None
    begun = _shifted(fit)
    begun.setting[_LAG[0]] = {_LAG[1]: REFIT.first_lag_share * behind}
    begun.setting[SHIFT[0]][SHIFT[1]] = (1.0 - REFIT.first_lag_share) * behind
    found = _likeliest(search, begun, REFIT.largest_delay, REFIT.delay_iterations)
    lag, delay = found.setting[_LAG[0]][_LAG[1]], abs(found.setting[SHIFT[0]][SHIFT[1]])
    if lag > REFIT.least_lag_in_std * found.std[_LAG] and lag > REFIT.least_share_of_lag * (
        lag + delay
    ):
        return "as behind a lag"
    return (
        "either way"
        if lag > REFIT.least_share_of_possible_lag * (lag + delay)
        else "as behind a delay"
    )


def with_lag(search: Search, fit: Fit) -> Fit:
    """Return the fit with a motor_lag in place of a latency or a clock_offset, if the library and
    the residual allow it.
    """
    if _LAG[0] not in search.library or _LAG[0] in fit.effects:
        return fit
    found = search.refit(
        Fit({**fit.without(*DELAY_EFFECTS).setting, _LAG[0]: {_LAG[1]: _behind(fit)}})
    )
    return found if _is_close(search, found, fit) else fit


def others_late(search: Search, fit: Fit, follow: Lateness | None) -> dict[str, list[str]]:
    """Return of a named lag or delay which effects of the library it may be instead; nothing where
    it is surely that.
    """
    if follow != "either way":
        return {}
    return {
        e: [
            x
            for x in search.library
            if x in LATE_ROTOR_EFFECTS - ({e} if e == _LAG[0] else DELAY_EFFECTS)
        ]
        for e in LATE_ROTOR_EFFECTS & set(fit.effects)
    }


def lag_or_delay(search: Search, fit: Fit, follow: Lateness | None) -> list[str]:
    """Return in words that what is named motor_lag delays as a latency would, or the other way
    round, if so.
    """
    for effect in LATE_ROTOR_EFFECTS & set(fit.effects) if follow else ():
        is_it = follow == ("as behind a lag" if effect == _LAG[0] else "as behind a delay")
        if not is_it and not any(others_late(search, fit, follow).values()):
            if effect == _LAG[0]:
                return ["motor_lag, with turn rates out of step, may be a latency"]
            return [
                f"{effect}: quick changes of the rotors come true less than behind a delay: a lag "
                f"may be behind it"
            ]
    return []


def _behind(fit: Fit) -> float:
    """Return by how much (s) the rotors follow late in a fit, by whatever it has for that."""
    return sum(
        fit.setting.get(effect, {}).get(name, 0.0) for effect, name in (_LAG, SHIFT, *_DELAYS)
    )


def _shifted(fit: Fit) -> Fit:
    """Return the fit with turn rates that act late in place of a latency or a clock_offset."""
    setting = {
        effect: dict(values) for effect, values in fit.without(*DELAY_EFFECTS).setting.items()
    }
    nuisances = setting.setdefault(SHIFT[0], {})
    nuisances[SHIFT[1]] = _behind(fit) - fit.setting.get(_LAG[0], {}).get(_LAG[1], 0.0)
    return Fit(setting)


def _likeliest(search: Search, fit: Fit, latest: float, turns: int) -> Fit:
    """Return the fit at the maximum likelihood of the innovations, with turn rates that act up to
    ``latest`` s late.
    """
    columns: list[Column] = search.base(fit.effects)
    every = np.arange(len(columns))
    found, std = fit, np.zeros(len(columns))
    for _ in range(turns):
        gram = Innovations(search.flights, found.setting).gram(columns)
        if SHIFT in columns:  # whose range may be another one than regressions have
            at = columns.index(SHIFT)
            gram.lower[at], gram.upper[at] = -latest - gram.value[at], latest - gram.value[at]
        total = gram.blocks.sum(axis=0)
        change = gram.solve(total, every)
        found = started(search.flights, found, columns, change)
        if SHIFT in columns:
            found.setting[SHIFT[0]][SHIFT[1]] = float(gram.value[at] + change[at])
        std = np.sqrt(np.diag(np.linalg.inv(total[:-1, :-1] + np.diag(gram.precision))))
    found.std = dict(zip(columns, std.tolist(), strict=True))
    return found


def _is_close(search: Search, fit: Fit, other: Fit) -> bool:
    """Return whether a fit leaves hardly more of the residual than another one."""
    return (
        search.energy(fit.setting)
        < REFIT.most_deviance_ratio * search.energy(other.setting) + SEARCH.least_deviance_reduction
    )
