"""Coefficients refitted by the likelihood of the innovations, where least squares of the residual
is biased.

The noise of the pose passes through the flight loop into the rotors, so the residual's noise is
correlated with the rotor speeds. Coefficients that act like a small delay, or scale the attitude
with its noise, are biased: a lag of 13 ms was found as 4 to 11 ms with a rotor time offset of 2 to
6 ms, a gain of the attitude up to a fifth too large on fast flights and three times too large on
gentle ones. Innovations are free of it, since past poses do not predict them. (They are less
robust: rounded rotor speeds look like fast disturbances.)
"""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Literal

import numpy as np

from ...dynamics.effects import Role, get, playing
from .innovations import Innovations
from .regression import Column, coefficient, is_delay, moves_time
from .search import SEARCH, FittedEffects, Search, with_changes
from .time_offsets import ROTOR_TIME_OFFSET, TIMING


@dataclass(frozen=True)
class RefitSettings:
    """How coefficients are refitted to the innovations, and how a lag is told from a delay."""

    iterations: int = 3  # of Gauss-Newton; the second changes little
    # times the residual's deviance; a refit that leaves more of the residual is not used
    most_deviance_ratio: float = 1.05
    largest_delay: float = 0.1  # s, of the rotors where a delay is named
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
DelayKind = Literal["lag", "delay", "either"]


def is_biased(effect: str) -> bool:
    """Return whether least squares of the residual gets an effect wrong."""
    return get(effect).scales_noise or get(effect).role == Role.LAG


def _first_coefficients(role: Role, among: Iterable[str] | None = None) -> list[Column]:
    """Return the effects of a role, each with the coefficient that the role states."""
    return [(effect, get(effect).coefficients[0].name) for effect in playing(role, among=among)]


def _lag_coefficient(search: Search, fit: FittedEffects) -> Column | None:
    """Return the lag that a fit has, or that it may have; None where the whole library has none."""
    found = (
        _first_coefficients(Role.LAG, fit.effects)
        or _first_coefficients(Role.LAG, search.library)
        or _first_coefficients(Role.LAG)
    )
    return found[0] if found else None


def _delays(fit: FittedEffects) -> list[str]:
    return [effect for effect in fit.effects if is_delay(effect)]


def _late_rotor_effects(fit: FittedEffects) -> list[str]:
    return [effect for effect in fit.effects if moves_time(effect)]


def refitted_by_likelihood(search: Search, fit: FittedEffects) -> FittedEffects:
    """Return the fit with its coefficients at the maximum likelihood of the innovations, if it has
    an effect that needs it.

    Standard deviations are no smaller than those of the residual.
    """
    late = _first_coefficients(Role.DELAY, fit.effects)
    if not any(map(is_biased, fit.effects)) or len(late) > 1:
        return fit
    # a delay is fitted as a rotor time offset: moving the pose would move its noise as well
    found = _maximum_likelihood(
        search,
        _with_rotor_time_offset(fit),
        REFIT.largest_delay if late else TIMING.rotor_time_offset_range[1],
        REFIT.iterations,
    )
    for effect, name in late:
        c = coefficient((effect, name))
        delay = {
            name: float(
                np.clip(
                    found.setting[ROTOR_TIME_OFFSET[0]].pop(ROTOR_TIME_OFFSET[1]),
                    c.minimum,
                    c.maximum,
                )
            )
        }
        found.setting = {
            k: found.setting.get(k, delay) for k in fit.setting
        }  # in the order in which they were found
        found.std[effect, name] = found.std.pop(ROTOR_TIME_OFFSET)
    found.std = {
        column: max(value, fit.std.get(column, 0.0)) for column, value in found.std.items()
    }
    return found if _residual_agrees(search, found, fit) else fit


def delay_kind(search: Search, fit: FittedEffects) -> DelayKind | None:
    """Return whether the rotors follow like behind a lag or behind a delay, with a free rotor time
    offset; None where no late rotors are named.
    """
    late, of_lag = _late_rotor_effects(fit), _lag_coefficient(search, fit)
    if len(late) != 1 or of_lag is None or (behind := _total_delay(fit)) <= 0.0:
        return None
    begun = _with_rotor_time_offset(fit)
    begun.setting[of_lag[0]] = {of_lag[1]: REFIT.first_lag_share * behind}
    begun.setting[ROTOR_TIME_OFFSET[0]][ROTOR_TIME_OFFSET[1]] = (
        1.0 - REFIT.first_lag_share
    ) * behind
    found = _maximum_likelihood(search, begun, REFIT.largest_delay, REFIT.delay_iterations)
    lag, delay = (
        found.setting[of_lag[0]][of_lag[1]],
        abs(found.setting[ROTOR_TIME_OFFSET[0]][ROTOR_TIME_OFFSET[1]]),
    )
    if lag > REFIT.least_lag_in_std * found.std[of_lag] and lag > REFIT.least_share_of_lag * (
        lag + delay
    ):
        return "lag"
    return "either" if lag > REFIT.least_share_of_possible_lag * (lag + delay) else "delay"


def with_lag(search: Search, fit: FittedEffects) -> FittedEffects:
    """Return the fit with a lag in place of a delay, if the library and the residual allow it."""
    lags = _first_coefficients(Role.LAG, search.library)
    if not lags or playing(Role.LAG, among=fit.effects):
        return fit
    effect, name = lags[0]
    found = search.refit(
        FittedEffects(
            {
                **fit.without(*_delays(fit)).setting,
                effect: {name: _total_delay(fit)},
            }
        )
    )
    return found if _residual_agrees(search, found, fit) else fit


def delay_alternatives(
    search: Search, fit: FittedEffects, kind: DelayKind | None
) -> dict[str, list[str]]:
    """Return for a named lag or delay the effects of the library that it may be instead; none where
    the flights tell them apart.
    """
    if kind != "either":
        return {}
    return {
        e: [x for x in search.library if get(x).role == (Role.LAG if is_delay(e) else Role.DELAY)]
        for e in _late_rotor_effects(fit)
    }


def delay_doubts(search: Search, fit: FittedEffects, kind: DelayKind | None) -> list[str]:
    """Return, as sentences, doubts about a lag that follows like a delay, or the reverse.

    Of 340 flights with a wrong name it doubts 20, and 5 as the only check.
    """
    for effect in _late_rotor_effects(fit) if kind else ():
        is_it = kind == ("delay" if is_delay(effect) else "lag")
        if not is_it and not any(delay_alternatives(search, fit, kind).values()):
            delays = [x for x in playing(Role.DELAY) if get(x).kind == "rotor input"]
            other = next(iter(playing(Role.LAG) if is_delay(effect) else delays), "another effect")
            follow = (
                "follow fast changes less than behind a delay"
                if is_delay(effect)
                else "follow like behind a delay"
            )
            return [f"{effect} may be a {other}: the rotors {follow}"]
    return []


def _total_delay(fit: FittedEffects) -> float:
    """Return the whole delay (s) of the rotors in a fit: of lag, delay, clock and time offset."""
    return sum(
        fit.setting.get(effect, {}).get(name, 0.0)
        for effect, name in (
            *_first_coefficients(Role.LAG, fit.effects),
            ROTOR_TIME_OFFSET,
            *_first_coefficients(Role.DELAY, fit.effects),
        )
    )


def _with_rotor_time_offset(fit: FittedEffects) -> FittedEffects:
    """Return the fit with a rotor time offset in place of a delay."""
    setting = {
        effect: dict(values) for effect, values in fit.without(*_delays(fit)).setting.items()
    }
    time_offsets = setting.setdefault(ROTOR_TIME_OFFSET[0], {})
    time_offsets[ROTOR_TIME_OFFSET[1]] = _total_delay(fit) - sum(
        fit.setting[effect].get(name, 0.0)
        for effect, name in _first_coefficients(Role.LAG, fit.effects)
    )
    return FittedEffects(setting)


def _maximum_likelihood(
    search: Search, fit: FittedEffects, latest: float, turns: int
) -> FittedEffects:
    """Return the fit at the maximum likelihood of the innovations, with a rotor time offset of at
    most ``latest`` s.
    """
    columns: list[Column] = search.model_columns(fit.effects)
    every = np.arange(len(columns))
    found, std = fit, np.zeros(len(columns))
    for _ in range(turns):
        gram = Innovations(search.flights, found.setting).gram(columns)
        if ROTOR_TIME_OFFSET in columns:  # its range here may differ from that of regressions
            at = columns.index(ROTOR_TIME_OFFSET)
            gram.lower[at], gram.upper[at] = -latest - gram.value[at], latest - gram.value[at]
        total = gram.blocks.sum(axis=0)
        change = gram.solve(total, every)
        found = with_changes(search.flights, found, columns, change)
        if ROTOR_TIME_OFFSET in columns:
            found.setting[ROTOR_TIME_OFFSET[0]][ROTOR_TIME_OFFSET[1]] = float(
                gram.value[at] + change[at]
            )
        std = np.sqrt(np.diag(np.linalg.inv(total[:-1, :-1] + np.diag(gram.precision))))
    found.std = dict(zip(columns, std.tolist(), strict=True))
    return found


def _residual_agrees(search: Search, fit: FittedEffects, other: FittedEffects) -> bool:
    """Return whether a fit leaves hardly more of the residual than another one."""
    return (
        search.deviance(fit.setting)
        < REFIT.most_deviance_ratio * search.deviance(other.setting)
        + SEARCH.least_deviance_reduction
    )
