"""What changed between two sets of flights, in sentences, as data and as a picture."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ...runtime.page_files import write_json, write_png
from .change import NOWHERE, SOMETHING_ELSE, Change
from .trim import Trim

_NAMED = 0.05  # probability from which another place is mentioned


def headline(change: Change) -> str:
    """Return the finding, as sure as it is."""
    place, chance = change.place, change.places[change.place]
    if place == NOWHERE:
        if change.sure:
            return f"Nothing changed (probability {chance:.2f})."
        other = max(
            (name for name in change.places if name != NOWHERE), key=change.places.__getitem__
        )
        return (
            f"Cannot tell whether anything changed: nothing with probability {chance:.2f}; if "
            f"something did, it is likeliest at {other} ({change.places[other]:.2f})."
        )
    others = [
        f"{name} ({p:.2f})"
        for name, p in sorted(change.places.items(), key=lambda item: -item[1])
        if name != place and p >= _NAMED
    ]
    if change.sure:
        return f"Changed: {place} (probability {chance:.2f}). {_kind(change)}"
    return f"Cannot tell {place} ({chance:.2f}) from {' or '.join(others)}. {_kind(change)}"


def _kind(change: Change) -> str:
    size = f"{100 * change.amount:.0f} % (+- {100 * change.amount_std:.0f})"
    if change.place == SOMETHING_ELSE:
        return "The rotors share the work otherwise than one weaker rotor or one weight would ask."
    if change.place == "all rotors":
        return (
            f"All rotors are asked for {size} more: a heavier vehicle, a weaker battery, thin air."
        )
    if not change.place.startswith("rotor"):
        return f"The vehicle carries {size} of its weight more at that side."
    if change.weaker >= 0.95:
        return f"That rotor delivers {size} less for what it is asked."
    if change.carries_more >= 0.95:
        return f"The vehicle carries {size} of its weight more there."
    return (
        f"Either that rotor delivers less (probability {change.weaker:.2f}) or the vehicle carries "
        f"more there ({change.carries_more:.2f}), by about {size}; these look alike."
    )


def change_data(change: Change) -> dict[str, Any]:
    """Return the finding as plain data."""

    def flights(trims: Sequence[Trim]) -> list[dict[str, Any]]:
        return [
            {
                "log": trim.name,
                "seconds": trim.seconds,
                "thrust_share": (trim.thrust / trim.total).tolist(),
                "total": trim.total,
                "std": np.sqrt(np.diagonal(trim.noise)).tolist(),
                "voltage": trim.voltage,
            }
            for trim in trims
        ]

    names = ("left_less_right", "front_less_rear", "diagonals", "log_total")
    return {
        "headline": headline(change),
        "place": change.place,
        "sure": change.sure,
        "probabilities": change.places,
        "weaker": change.weaker,
        "carries_more": change.carries_more,
        "amount": change.amount,
        "amount_std": change.amount_std,
        "difference": dict(zip(names, change.difference.tolist(), strict=True)),
        "difference_std_if_unchanged": dict(zip(names, change.std.tolist(), strict=True)),
        "before": flights(change.before),
        "after": flights(change.after),
    }


def write_change(change: Change, folder: Path) -> tuple[Path, Path]:
    """Write ``change.json`` and ``change.png`` into a folder and return their paths.

    Raises:
        InputError: a file cannot be written.
    """
    data, picture = folder / "change.json", folder / "change.png"
    write_json(change_data(change), data)
    write_png(_draw(change), picture)
    return data, picture


def _draw(change: Change) -> Any:
    from matplotlib.figure import Figure

    figure = Figure(figsize=(11.0, 4.8), layout="constrained")
    left, right = figure.subplots(1, 2)
    for trims, colour, label in (
        (change.before, "#30638e", "before"),
        (change.after, "#d1495b", "after"),
    ):
        # as seen from above, front up: what lies to the left is drawn to the left
        x = [-100 * trim.shares[0] for trim in trims]
        y = [100 * trim.shares[1] for trim in trims]
        left.plot(x, y, "o", color=colour, label=label, ms=7, alpha=0.8)
    left.axhline(0.0, color="#c9c9c9", lw=1)
    left.axvline(0.0, color="#c9c9c9", lw=1)
    left.set_xlabel("left  -  thrust asked for, % of the total  -  right")
    left.set_ylabel("rear  -  % of the total  -  front")
    left.set_title("how each flight's rotors share the work", fontsize=10)
    left.legend(frameon=False)
    left.axis("equal")
    names = sorted(change.places, key=change.places.__getitem__)
    chances = [change.places[name] for name in names]
    right.barh(names, chances, color=["#d1495b" if n == change.place else "#8a8a8a" for n in names])
    right.set_xlim(0.0, 1.0)
    right.axvline(change.sure_from, color="#4a4a4a", lw=1, ls="--")
    right.set_xlabel("probability that something changed there")
    right.set_title(f"sure from {change.sure_from:g} (dashed)", fontsize=10)
    return figure
