"""The page of a fleet: one HTML file that needs nothing else. Its script only sorts and searches;
without it all of the page is there.
"""

import math
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from ... import __version__
from ...runtime.page_files import page_template
from ...runtime.whole_files import replaced
from ..report.files import printable
from ..report.words import MISSING, coefficient_meaning, in_words, with_std
from .drift import DRIFT, Appearance, Fleet, Trend

_KINDS = {
    "input": "the log or its vehicle cannot be used",
    "time": "it took too long",
    "memory": "it needs too much memory",
    "died": "its process died",
    "error": "an error of this program",
}
_TONES = {"explained": "good", "nothing to explain": "good", "unexplained": "bad"}
_MINUS = "−"
_WIDTH, _HEIGHT, _EDGE = 132.0, 34.0, 4.0  # of a small picture, pixels
_MOST_POINTS = 200  # in it


def write_page(
    fleet: Fleet, rows: Callable[[], Iterable[Mapping[str, Any]]], path: Path, command: str
) -> None:
    """Write the page, whole or not at all, a flight at a time. Every text is escaped: names come
    from users.

    Raises:
        InputError: it cannot be written.
    """
    counts = fleet.individuals.values()
    diagnosed = sum(c["diagnosed"] for c in counts)
    refused = sum(c["refused"] for c in counts)
    parts = page_template(__package__, "page.html.j2").generate(
        headline=headline(fleet),
        logs=diagnosed + refused,
        diagnosed=diagnosed,
        refused=refused,
        individuals=len(fleet.individuals),
        verdicts=fleet.verdicts,
        changes=[change_in_words(one) for one in changes(fleet)],
        kinds=[(count, _KINDS.get(kind, kind)) for kind, count in fleet.refused.items()],
        trends=fleet.trends,
        flights=(row for row in rows() if row["status"] == "diagnosed"),
        refusals=(row for row in rows() if row["status"] == "refused"),
        reasons=_KINDS,
        tones=_TONES,
        missing=MISSING,
        short=short,
        slope=_slope,
        meaning=coefficient_meaning,
        picture=small_picture,
        in_words=in_words,
        coefficients=_coefficients,
        rate=f"{100 * DRIFT.false_discoveries:g}",
        least=DRIFT.least_flights,
        command=printable(command),
        version=__version__,
    )
    with replaced(path) as partial, open(partial, "w", encoding="utf-8") as file:
        file.writelines(parts)


def changes(fleet: Fleet) -> list[Trend | Appearance]:
    """Return the drifts and appearances that are told."""
    return [
        *(one for one in fleet.trends if one.drifts),
        *(one for one in fleet.appearances if one.changed),
    ]


def headline(fleet: Fleet) -> str:
    """Return the first sentence."""
    logs = sum(sum(c.values()) for c in fleet.individuals.values())
    refused = sum(c["refused"] for c in fleet.individuals.values())
    found = changes(fleet)
    who = list(dict.fromkeys(_id(one) for one in found))
    vehicles = len(fleet.individuals)
    text = f"{_count(logs, 'log')} of {_count(vehicles, 'vehicle')}"
    text += f", {refused} refused" if refused else ""
    if logs == refused:
        return f"{text}: none could be diagnosed."
    if not found:
        return f"{text}: no effect changed from flight to flight as far as these flights can tell."
    shown = in_words(who[:3] if len(who) <= 3 else [*who[:3], f"{len(who) - 3} more"])
    return f"{text}: effects changed from flight to flight on {shown}."


def _id(one: Trend | Appearance) -> str:
    return one.series.id if isinstance(one, Trend) else one.id


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
    series, ends = one.series, one.ends or (math.nan, math.nan)
    unit = "" if series.unit == "1" else f" {series.unit}"
    sure = " Few of these flights are sure of the effect's name." if one.tentative else ""
    return (
        f"{series.id}: {series.coefficient} of {series.effect} went from {short(ends[0])} to "
        f"{short(ends[1])}{unit} over {len(series.flights)} flights, {_slope(one)} a flight "
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
    x, y, s, sure = one.series.arrays()
    good = np.isfinite(y)
    x, y, s, sure = x[good], y[good], np.nan_to_num(s[good]), sure[good]
    if not len(y):
        return None
    if len(y) > _MOST_POINTS:
        keep = np.unique(np.linspace(0, len(y) - 1, _MOST_POINTS).astype(int))
        x, y, s, sure = x[keep], y[keep], s[keep], sure[keep]
    # a flight with a huge deviation must not flatten the others
    reach = np.minimum(1.96 * s, 3.0 * (np.ptp(y) + np.median(s)))
    low, high = float(np.min(y - reach)), float(np.max(y + reach))
    first = float(x[0])
    span, width = (high - low) or abs(high) or 1.0, float(np.ptp(x)) or 1.0

    def across(v: float) -> float:
        return round(_EDGE + (v - first) / width * (_WIDTH - 2 * _EDGE), 1)

    def up(v: float) -> float:
        return round(_HEIGHT - _EDGE - (v - low) / span * (_HEIGHT - 2 * _EDGE), 1)

    points = [
        {"x": across(a), "y": up(b), "top": up(b + r), "foot": up(b - r), "sure": bool(c)}
        for a, b, r, c in zip(x, y, reach, sure, strict=True)
    ]
    line = None
    if one.ends is not None:
        line = {"x1": points[0]["x"], "y1": up(one.ends[0]), "x2": points[-1]["x"]}
        line["y2"] = up(one.ends[1])
    alt = f"{len(y)} values over flights {x[0]:.0f} to {x[-1]:.0f}"
    return {"points": points, "line": line, "alt": alt, "width": _WIDTH, "height": _HEIGHT}
