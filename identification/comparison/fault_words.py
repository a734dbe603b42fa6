"""What a search for rotor faults found, in sentences, as data and as a picture."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ...runtime.page_files import write_json, write_png
from .fault_channels import Samples
from .fault_detection import ALL, NOTHING, OTHER, RotorFault

_PLACES = ("front-left", "rear-left", "rear-right", "front-right")
_NAMED = 0.05  # probability from which a rival is mentioned


def place_of(fault: RotorFault, rotor: int) -> str:
    """Return the name of a rotor (1 to 4), and the log's own name where it has one."""
    own = "" if fault.motor_names is None else f"; {fault.motor_names[rotor - 1]} in the log"
    return f"rotor {rotor} ({_PLACES[rotor - 1]}{own})"


def headline(fault: RotorFault) -> str:
    """Return the finding, as sure as it is."""
    likeliest = fault.likeliest
    chance = fault.probabilities[likeliest]
    sure = f"(probability {chance:.2f})" if chance < 0.9995 else "(probability above 0.999)"
    rivals = [
        f"{_what(fault, name)} ({p:.2f})"
        for name, p in sorted(fault.probabilities.items(), key=lambda item: -item[1])
        if name != likeliest and p >= _NAMED
    ]
    if not fault.sure:
        return (
            f"Cannot tell {_what(fault, likeliest)} ({chance:.2f}) from "
            f"{' or '.join(rivals) or 'the other possibilities'}."
        )
    if likeliest == NOTHING:
        return f"No rotor lost thrust {sure}."
    if likeliest == OTHER:
        return (
            f"No rotor fault explains what happened: a force or torque began that no rotor makes, "
            f"a gust, a load or a collision {sure}."
        )
    if likeliest == ALL:
        return f"All rotors lost thrust at once {sure}: the battery, the air, or the vehicle."
    when, low, high = fault.onset
    left, least, most = (100 * share for share in fault.remaining)
    return (
        f"{_capital(place_of(fault, fault.rotor))} lost {100 - left:.0f} % of its thrust "
        f"({100 - most:.0f} to {100 - least:.0f}) at t = {when:.3f} s ({low:.3f} to {high:.3f}, "
        f"the log's clock) {sure}."
    )


def _capital(text: str) -> str:
    return text[0].upper() + text[1:]


def _what(fault: RotorFault, name: str) -> str:
    if name == NOTHING:
        return "nothing"
    if name in (ALL, OTHER):
        return f"{name}"
    return f"a fault of {place_of(fault, int(name))}"


def fault_data(fault: RotorFault) -> dict[str, Any]:
    """Return the finding as plain data."""
    names = {str(i): f"rotor {i}" for i in range(1, 5)}
    found = fault.likeliest in names
    return {
        "log": fault.name,
        "headline": headline(fault),
        "found": names.get(fault.likeliest, fault.likeliest),
        "sure": fault.sure,
        "probabilities": {names.get(k, k): p for k, p in fault.probabilities.items()},
        "rotor": fault.rotor if found else None,
        "motor": fault.motor_names[fault.rotor - 1] if found and fault.motor_names else None,
        "onset_s": fault.onset[0] if found else None,
        "onset_ci95_s": list(fault.onset[1:]) if found else None,
        "remaining": fault.remaining[0] if found else None,
        "remaining_ci95": list(fault.remaining[1:]) if found else None,
        "flight_s": fault.seconds,
        "ended_because": fault.ended or None,
    }


def write_faults(found: Sequence[tuple[RotorFault, Samples]], folder: Path) -> tuple[Path, Path]:
    """Write ``rotor_faults.json`` and ``rotor_faults.png`` into a folder and return their paths.

    Raises:
        InputError: a file cannot be written.
    """
    data, picture = folder / "rotor_faults.json", folder / "rotor_faults.png"
    write_json([fault_data(fault) for fault, _ in found], data)
    write_png(_draw(found), picture)
    return data, picture


def _draw(found: Sequence[tuple[RotorFault, Samples]]) -> Any:
    from matplotlib.figure import Figure

    figure = Figure(figsize=(11.0, 4.2 * len(found)), layout="constrained")
    axes = np.atleast_2d(figure.subplots(len(found), 2, squeeze=False))
    for (fault, samples), (left, right) in zip(found, axes, strict=True):
        for axis, colour in zip(range(3), ("#d1495b", "#30638e", "#8a8a8a"), strict=True):
            left.plot(
                samples.t, samples.angular_acceleration[:, axis], color=colour, lw=1,
                label=f"about {'xyz'[axis]}",
            )  # fmt: skip
        left.set_ylabel("angular acceleration, rad/s2")
        left.legend(frameon=False, loc="upper left", fontsize=8)
        command = samples.channels.command
        for i in range(4):
            u = np.interp(samples.t, samples.channels.command_times, command[:, i])
            right.plot(samples.t, u, lw=1, label=f"rotor {i + 1}")
        right.set_ylabel("command")
        right.legend(frameon=False, loc="upper left", fontsize=8)
        for axis_ in (left, right):
            axis_.set_xlabel("t, s (the log's clock)")
            if fault.likeliest in ("1", "2", "3", "4"):
                axis_.axvline(fault.onset[0], color="#4a4a4a", lw=1, ls="--")
                axis_.set_xlim(fault.onset[0] - 3.0, samples.t[-1] + 0.1)
        left.set_title(Path(fault.name).name, fontsize=9)
        right.set_title(_short(fault), fontsize=9)
    return figure


def _short(fault: RotorFault) -> str:
    chance = fault.probabilities[fault.likeliest]
    return f"{_what(fault, fault.likeliest)}: {chance:.3f}"
