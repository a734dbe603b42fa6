"""What least squares of the residual gets wrong, measured by innovations instead.

The noise of the pose goes through the flight loop into the rotors, so the residual's noise follows
the turn rates. What differs little from their delay, or scales the attitude with its noise, comes
out wrong: a motor_lag of 13 ms as 4 to 11 ms behind turn rates that act 2 to 6 ms late, a gain of
the attitude by up to a fifth too large on fast flights and as its triple on gentle ones. What no
past pose foretells has no such noise. (It is less robust: turn rates that are rounded look like
quick gusts.)
"""

from typing import Literal

import numpy as np

from .innovations import Innovations
from .regression import LATE, SHIFT, SHIFT_RANGE, TIMING, Column, coefficient
from .search import LEAST_GAIN, Fit, Search, started

_BENT = frozenset({"attitude_gain", "motor_lag"})  # effects of which that is known
_TURNS = 3  # of Gauss-Newton; the second changes little
_WORSE = 1.05  # of the residual's energy: what is worse for the residual than that is not measured
_LAG = "motor_lag", "tau"
_DELAYS = ("latency", "d"), ("clock_offset", "dt")
_ANY_DELAY = 0.1  # s
_BEGIN = 0.3  # share of a lag where the search for it begins
_DELAY_TURNS = 5
# standard deviations of a lag, which know nothing of rounded turn rates: a delay of 9 ms has looked
# like 4 of them
_SURE = 6.0
_LAGS, _MAY_LAG = (
    0.5,
    0.3,
    # share of a lag, that is one and that may be one; behind 34 delays it was up to 0.47, and once
    # 0.7
)

Lateness = Literal["as behind a lag", "as behind a delay", "either way"]


def measured(search: Search, fit: Fit) -> Fit:
    """Return the fit with its coefficients at the maximum likelihood of the innovations, if it has
    an effect that needs it.

    Standard deviations are no smaller than those of the residual.
    """
    late = [(effect, name) for effect, name in _DELAYS if effect in fit.effects]
    if search.flights.commanded or not _BENT & set(fit.effects) or len(late) > 1:
        return fit
    # what delays is measured as turn rates that act late: a pose that is moved would take its noise
    # along
    found = _likeliest(search, _shifted(fit), _ANY_DELAY if late else SHIFT_RANGE[1], _TURNS)
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
    late = LATE & set(fit.effects)
    if search.flights.commanded or len(late) != 1 or (behind := _behind(fit)) <= 0.0:
        return None
    begun = _shifted(fit)
    begun.setting[_LAG[0]] = {_LAG[1]: _BEGIN * behind}
    begun.setting[SHIFT[0]][SHIFT[1]] = (1.0 - _BEGIN) * behind
    found = _likeliest(search, begun, _ANY_DELAY, _DELAY_TURNS)
    lag, delay = found.setting[_LAG[0]][_LAG[1]], abs(found.setting[SHIFT[0]][SHIFT[1]])
    if lag > _SURE * found.std[_LAG] and lag > _LAGS * (lag + delay):
        return "as behind a lag"
    return "either way" if lag > _MAY_LAG * (lag + delay) else "as behind a delay"


def with_lag(search: Search, fit: Fit) -> Fit:
    """Return the fit with a motor_lag in place of a latency or a clock_offset, if the library and
    the residual allow it.
    """
    if _LAG[0] not in search.library or _LAG[0] in fit.effects:
        return fit
    found = search.refit(Fit({**fit.without(*TIMING).setting, _LAG[0]: {_LAG[1]: _behind(fit)}}))
    return found if _is_close(search, found, fit) else fit


def others_late(search: Search, fit: Fit, follow: Lateness | None) -> dict[str, list[str]]:
    """Return of a named lag or delay which effects of the library it may be instead; nothing where
    it is surely that.
    """
    if follow != "either way":
        return {}
    return {
        e: [x for x in search.library if x in LATE - ({e} if e == _LAG[0] else TIMING)]
        for e in LATE & set(fit.effects)
    }


def lag_or_delay(search: Search, fit: Fit, follow: Lateness | None) -> list[str]:
    """Return in words that what is named motor_lag delays as a latency would, or the other way
    round, if so.
    """
    for effect in LATE & set(fit.effects) if follow else ():
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
    setting = {effect: dict(values) for effect, values in fit.without(*TIMING).setting.items()}
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
    return search.energy(fit.setting) < _WORSE * search.energy(other.setting) + LEAST_GAIN
