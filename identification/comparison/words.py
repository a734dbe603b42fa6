"""Changes between two sets of flights, and rotor faults within one: sentences, data, pictures."""

from collections.abc import Sequence
from operator import itemgetter
from pathlib import Path
from typing import Any

import numpy as np

from ...runtime.drawing import (
    AFTER,
    BEFORE,
    BLACK,
    GREY,
    PALE,
    new_figure,
    room_above,
    styled,
)
from ...runtime.page_files import write_json, write_png
from ...runtime.plain_values import plain
from ..logs.table import Data, Values
from ..logs.what_flew import PLACES
from .change import NOWHERE, SOMETHING_ELSE, SURE, Change
from .fault_detection import ALL, NOTHING, OTHER, RotorFault
from .trim import Trim

_FOUND = {str(i): f"rotor {i}" for i in range(1, 5)}
# sentences with a place for the probability
_NO_ROTOR = {
    NOTHING: "No rotor lost thrust {}.",
    OTHER: "No rotor fault explains what happened: a force or torque began that no rotor makes, "
    "a gust, a load or a collision {}.",
    ALL: "All rotors lost thrust at once {}: the battery, the air, or the vehicle.",
}
_NAMED = 0.05  # least probability of a rival in the sentence
_SAID = ("place", "sure", "weaker", "carries_more", "amount", "amount_std")


def _undecided(chances: Values) -> str:
    """Return a sentence on an unsure finding and its rivals."""
    likeliest = (
        f"{name} {p:.2f}"
        for name, p in sorted(chances.items(), key=itemgetter(1), reverse=True)
        if p >= _NAMED
    )
    return f"Undecided, by probability: {', '.join(likeliest)}."


def change_headline(change: Change) -> str:
    """Return a sentence on the change, with its probability."""
    place = change.place
    chance = f"{change.places[place]:.2f}"
    if not change.sure:
        told = _undecided(change.places)
        return told if place == NOWHERE else f"{told} If the first: {_kind(change)}"
    if place == NOWHERE:
        return f"Nothing changed (probability {chance})."
    return f"Changed: {place}, probability {chance}; {_kind(change)}"


def _kind(change: Change) -> str:
    size = f"{100 * change.amount:.0f} ± {100 * change.amount_std:.0f} %"
    if change.place == SOMETHING_ELSE:
        return "the rotors share the work otherwise than one weaker rotor or one weight would ask."
    if change.place == "all rotors":
        return (
            f"all rotors are asked for {size} more: a heavier vehicle, a weaker battery, thin air."
        )
    if change.weaker >= SURE:
        return f"that rotor delivers {size} less for what it is asked."
    if change.carries_more >= SURE:
        return f"the vehicle carries {size} of its weight more there."
    return (
        f"the rotor delivers {size} less (probability {change.weaker:.2f}), or the vehicle carries "
        f"as much more there ({change.carries_more:.2f}): these look alike."
    )


def change_data(change: Change) -> Data:
    """Return the finding as plain data."""

    def flight(trim: Trim) -> Data:
        return {
            "log": trim.name,
            "seconds": trim.seconds,
            "thrust_share": trim.thrust / trim.thrust.sum(),
            "total": trim.thrust.sum(),
            "std": np.sqrt(trim.noise),
            "voltage": trim.voltage,
        }

    names = ("left_less_right", "front_less_rear", "diagonals", "log_total")
    data: Data = plain(
        {
            "headline": change_headline(change),
            "probabilities": change.places,
            **{key: getattr(change, key) for key in _SAID},
            "difference": dict(zip(names, change.difference, strict=True)),
            "difference_std_if_unchanged": dict(zip(names, change.std, strict=True)),
            "before": [*map(flight, change.before)],
            "after": [*map(flight, change.after)],
        }
    )
    return data


def write_change(change: Change, folder: Path) -> tuple[Path, Path]:
    """Write ``change.json`` and ``change.png`` into a folder and return their paths.

    Raises:
        InputError: a file cannot be written.
    """
    return _written(folder / "change.json", change_data(change), _draw_change(change))


def _written(path: Path, data: Any, figure: Any) -> tuple[Path, Path]:
    """Write data, and a figure beside them; return both paths."""
    picture = path.with_suffix(".png")
    write_json(data, path)
    write_png(figure, picture)
    return path, picture


@styled()
def _draw_change(change: Change) -> Any:
    figure = new_figure(4.0)
    left, right = figure.subplots(1, 2)
    for trims, colour, label in (
        (change.before, BEFORE, "before"),
        (change.after, AFTER, "after"),
    ):
        # seen from above, front up: the vehicle's left is the picture's
        x, y = np.transpose([[-100.0, 100.0] * trim.features[:2] for trim in trims])
        left.plot(x, y, "o", color=colour, label=label, ms=7, alpha=0.8)
    left.axhline(0.0, color=PALE, lw=1)
    left.axvline(0.0, color=PALE, lw=1)
    left.set(
        xlabel="left  -  thrust asked for, % of the total  -  right",
        ylabel="rear  -  % of the total  -  front",
        title="how each flight's rotors share the work",
    )
    left.legend()
    left.axis("equal")
    names, chances = zip(*sorted(change.places.items(), key=itemgetter(1)), strict=True)
    right.barh(names, chances, color=[AFTER if n == change.place else GREY for n in names])
    right.axvline(SURE, color=BLACK, lw=1, ls="--")
    right.set(
        xlim=(0.0, 1.0),
        xlabel="probability that something changed there",
        title=f"sure from {SURE:g} (dashed)",
    )
    return figure


def _place_of(fault: RotorFault, rotor: int) -> str:
    """Return the number of a rotor (1 to 4), its place, and the log's own name if any."""
    names = fault.samples.channels.motor_names
    own = "" if names is None else f"; {names[rotor - 1]} in the log"
    return f"{rotor} ({PLACES[rotor - 1]}{own})"


def fault_headline(fault: RotorFault) -> str:
    """Return a sentence on the rotor fault, its time and size, with its probability."""
    likeliest = fault.likeliest
    chance = fault.probabilities[likeliest]
    sure = f"(probability {chance:.2f})" if chance < 0.9995 else "(probability above 0.999)"
    if not fault.sure:
        return _undecided({_finding(fault, k): p for k, p in fault.probabilities.items()})
    if likeliest in _NO_ROTOR:
        return _NO_ROTOR[likeliest].format(sure)
    when, low, high = fault.onset
    lost, most, least = (100 - 100 * share for share in fault.remaining)
    return (
        f"Rotor {_place_of(fault, fault.rotor)} lost {lost:.0f} % of its thrust "
        f"({least:.0f} to {most:.0f}) at t = {when:.3f} s ({low:.3f} to {high:.3f}, "
        f"the log's clock) {sure}."
    )


def _finding(fault: RotorFault, name: str) -> str:
    return f"a fault of rotor {_place_of(fault, int(name))}" if name in _FOUND else name


def fault_data(fault: RotorFault) -> Data:
    """Return the finding as plain data."""
    channels = fault.samples.channels
    onset, *onset_ci95 = fault.onset
    remaining, *remaining_ci95 = fault.remaining
    of_rotor = {
        "rotor": fault.rotor,
        "motor": channels.motor_names and channels.motor_names[fault.rotor - 1],
        "onset_s": onset,
        "onset_ci95_s": onset_ci95,
        "remaining": remaining,
        "remaining_ci95": remaining_ci95,
    }
    return {
        "log": channels.name,
        "headline": fault_headline(fault),
        "found": _FOUND.get(fault.likeliest, fault.likeliest),
        "sure": fault.sure,
        "probabilities": {_FOUND.get(k, k): p for k, p in fault.probabilities.items()},
        **(of_rotor if fault.likeliest in _FOUND else dict.fromkeys(of_rotor)),
        "flight_s": fault.seconds,
        "ended_because": fault.samples.ended or None,
    }


def write_faults(faults: Sequence[RotorFault], folder: Path) -> tuple[Path, Path]:
    """Write ``rotor_faults.json`` and ``rotor_faults.png`` into a folder and return their paths.

    Raises:
        InputError: a file cannot be written.
    """
    data = [*map(fault_data, faults)]
    return _written(folder / "rotor_faults.json", data, _draw_faults(faults))


@styled()
def _draw_faults(faults: Sequence[RotorFault]) -> Any:
    figure = new_figure(3.4 * len(faults))
    axes = figure.subplots(len(faults), 2, squeeze=False)
    for fault, (left, right) in zip(faults, axes, strict=True):
        samples = fault.samples
        channels = samples.channels
        for panel, what, lines, kind, names in (
            (left, "angular acceleration, rad/s2", samples.angular_acceleration, "about", "xyz"),
            (right, "command", channels.command.at(samples.t), "rotor", "1234"),
        ):
            panel.plot(samples.t, lines, lw=1, label=[f"{kind} {name}" for name in names])
            room_above(panel)
            panel.legend(loc="upper left", ncols=len(names))
            panel.set(xlabel="t, s (the log's clock)", ylabel=what)
            if fault.likeliest in _FOUND:
                panel.axvline(fault.onset[0], color=BLACK, lw=1, ls="--")
                panel.set_xlim(fault.onset[0] - 3.0, samples.t[-1] + 0.1)
        left.set_title(Path(channels.name).name)
        likeliest = fault.likeliest
        right.set_title(f"{_finding(fault, likeliest)}: {fault.probabilities[likeliest]:.3f}")
    return figure
