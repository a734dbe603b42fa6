"""The page of a fleet: one HTML file that needs nothing else. Its script only sorts and searches;
without it all of the page is there.
"""

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from ... import __version__
from ...runtime.page_files import page_template
from ...runtime.plain_values import as_text
from ..report.page import TONES, page_file
from ..report.words import MISSING, coefficient_meaning, in_words, with_std
from .drift import FALSE_DISCOVERIES, LEAST_FLIGHTS, Appearance, Fleet, Trend

_KINDS = {
    "input": "the log or its vehicle cannot be used",
    "time": "it took too long",
    "memory": "it needs too much memory",
    "died": "its process died",
    "error": "an error of this program",
}
_MINUS = "−"
_WIDTH, _HEIGHT, _EDGE = 132.0, 34.0, 4.0  # of a small picture, pixels


def fleet_page(fleet: Fleet, rows: Sequence[Mapping[str, Any]], command: str) -> str:
    """Return the page. Every text is escaped: names come from users."""
    return page_template(__package__, "page.html.j2").render(
        fleet=fleet,
        headline=headline(fleet),
        changes=[change_in_words(one) for one in changes(fleet)],
        flights=[row for row in rows if row["status"] == "diagnosed"],
        refusals=[row for row in rows if row["status"] == "refused"],
        kinds=_KINDS,
        tones=TONES,
        missing=MISSING,
        short=short,
        slope=_slope,
        meaning=coefficient_meaning,
        picture=small_picture,
        in_words=in_words,
        coefficients=_coefficients,
        least_flights=LEAST_FLIGHTS,
        false_discoveries=FALSE_DISCOVERIES,
        command=as_text(command),
        shared_style=page_file("page.css"),
        version=__version__,
    )


def changes(fleet: Fleet) -> list[Trend | Appearance]:
    """Return the drifts and appearances that are told."""
    every: list[Trend | Appearance] = [*fleet.trends, *fleet.appearances]
    return [one for one in every if one.told]


def headline(fleet: Fleet) -> str:
    """Return the first sentence."""
    logs = sum(sum(c.values()) for c in fleet.individuals.values())
    refused = sum(c["refused"] for c in fleet.individuals.values())
    every = [one.of.id if isinstance(one, Trend) else one.id for one in changes(fleet)]
    who = list(dict.fromkeys(every))
    text = f"{_count(logs, 'log')} of {_count(len(fleet.individuals), 'vehicle')}"
    text += f", {refused} refused: " if refused else ": "
    if logs == refused:
        return f"{text}none could be diagnosed."
    if not who:
        return f"{text}no effect changed from flight to flight as far as these flights can tell."
    shown = in_words(who if len(who) <= 3 else [*who[:3], f"{len(who) - 3} more"])
    return f"{text}effects changed from flight to flight on {shown}."


def _count(number: int, word: str) -> str:
    return f"{number} {word}{'' if number == 1 else 's'}"


def change_in_words(one: Trend | Appearance) -> str:
    """Return a sentence on what changed."""
    p = f"adjusted p = {short(one.adjusted_p)}"
    if isinstance(one, Appearance):
        when = "later" if one.later else "earlier"
        return (
            f"{one.id}: {one.effect} is named in {len(one.named)} of {one.among} flights, the "
            f"{when} ones ({p})."
        )
    of, ends = one.of, one.ends or (math.nan, math.nan)
    unit = "" if of.unit == "1" else f" {of.unit}"
    sure = " Few of these flights are sure of the effect's name." if one.tentative else ""
    return (
        f"{of.id}: {of.coefficient} of {of.effect} went from {short(ends[0])} to "
        f"{short(ends[1])}{unit} over {len(one.points)} flights, {_slope(one)} a flight "
        f"({p}).{sure}"
    )


def _coefficients(effect: Mapping[str, Any]) -> str:
    """Return a named effect's coefficients with their deviations and units."""
    numbers = []
    for name, value in effect["coefficients"].items():
        unit = effect["units"].get(name, "")
        known = (math.nan if v is None else v for v in (value, effect["std"].get(name)))
        numbers.append(f"{name} {with_std(*known)}{'' if unit == '1' else f' {unit}'}")
    return ", ".join(numbers)


def short(value: float | None) -> str:
    """Return a number with three digits, with an exponent where it needs one."""
    if value is None or not math.isfinite(value):
        return MISSING
    return f"{value:.3g}".replace("-", _MINUS)


def _slope(one: Trend) -> str:
    low, high = one.per_flight_ci95 or (None, None)
    return f"{short(one.per_flight)} [{short(low)}, {short(high)}]"


def small_picture(one: Trend) -> dict[str, Any] | None:
    """Return the points, bars and line (pixels) of a coefficient over flights; None without a
    number.
    """
    x, y, s, sure = one.points[np.isfinite(one.points[:, 1])].T
    if not len(y):
        return None
    s = np.nan_to_num(s)
    # a flight with a huge deviation must not flatten the others
    reach = np.minimum(1.96 * s, 3.0 * (np.ptp(y) + np.median(s)))
    first, width = x[0], np.ptp(x) or 1.0
    low, high = np.min(y - reach), np.max(y + reach)
    span = (high - low) or abs(high) or 1.0
    across = np.round(_EDGE + (x - first) / width * (_WIDTH - 2 * _EDGE), 1)
    # each flight's value and the ends of its bar, then the line's
    levels = np.array([*y, *(y + reach), *(y - reach), *(one.ends or ())])
    up = np.round(_HEIGHT - _EDGE - (levels - low) / span * (_HEIGHT - 2 * _EDGE), 1)
    values, tops, feet, line = np.split(up, [len(y), 2 * len(y), 3 * len(y)])
    return {
        "points": list(zip(across, values, tops, feet, sure, strict=True)),
        "line": (across[0], line[0], across[-1], line[1]) if len(line) else None,
        "alt": f"{len(y)} values over flights {x[0]:.0f} to {x[-1]:.0f}",
        "width": _WIDTH,
        "height": _HEIGHT,
    }
