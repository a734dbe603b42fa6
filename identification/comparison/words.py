"""Changes between two sets of flights, and rotor faults within one: sentences, data, pictures."""

from collections.abc import Sequence
from operator import itemgetter
from pathlib import Path
from typing import Any

import numpy as np

from ...runtime.drawing import AFTER, BEFORE, BLACK, GREY, new_figure, room_above, styled
from ...runtime.page_files import page_template, write_json, write_png
from ...runtime.plain_values import plain
from ..logs.table import Data
from ..logs.what_flew import PLACES
from .change import SURE, Change
from .fault_detection import ROTORS, RotorFault


def _headline(**given: Any) -> str:
    """Return the sentence on a finding with some ``chances``."""
    return page_template(__package__, "templates/headline.j2", html=False).render(**given)


def change_headline(change: Change) -> str:
    """Return a sentence on the change, with its probability."""
    return _headline(chances=change.probabilities, change=change, sure=SURE)


def change_data(change: Change) -> Data:
    """Return the finding as plain data."""
    return dict(plain({"headline": change_headline(change), **change._asdict()}))


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
    for trims, colour, label in ((change.before, BEFORE, "before"), (change.after, AFTER, "after")):
        # seen from above, front up: the vehicle's left is the picture's
        x, y, *_ = 100.0 * np.transpose([trim.features for trim in trims])
        left.plot(-x, y, "o", color=colour, label=label, ms=7, alpha=0.8)
    left.grid()
    left.set(
        xlabel="left  -  thrust asked for, % of the total  -  right",
        ylabel="rear  -  % of the total  -  front",
        title="how each flight's rotors share the work",
    )
    left.legend()
    left.axis("equal")
    names, chances = zip(*sorted(change.probabilities.items(), key=itemgetter(1)), strict=True)
    right.barh(names, chances, color=[*[GREY] * (len(names) - 1), AFTER])
    right.axvline(SURE, color=BLACK, ls="--")
    right.set(
        xlim=(0.0, 1.0),
        xlabel="probability that something changed there",
        title=f"sure from {SURE:g} (dashed)",
    )
    return figure


def _in_words(fault: RotorFault, cause: str) -> str:
    """Return a cause; a rotor's with its place, and the log's own name if any."""
    if cause not in ROTORS:
        return cause
    names, i = fault.samples.motor_names, ROTORS.index(cause)
    return f"a fault of {cause} ({PLACES[i]}{f'; {names[i]} in the log' if names else ''})"


def fault_headline(fault: RotorFault) -> str:
    """Return a sentence on the rotor fault, its time and size, with its probability."""
    chances = {_in_words(fault, cause): p for cause, p in fault.probabilities.items()}
    return _headline(chances=chances, fault=fault, cause=_in_words(fault, fault.found))


def fault_data(fault: RotorFault) -> Data:
    """Return the finding as plain data."""
    data = {"headline": fault_headline(fault), **fault._asdict()}
    del data["samples"]
    return dict(plain(data))


def write_faults(faults: Sequence[RotorFault], folder: Path) -> tuple[Path, Path]:
    """Write ``rotor_faults.json`` and ``rotor_faults.png`` into a folder and return their paths.

    Raises:
        InputError: a file cannot be written.
    """
    return _written(folder / "rotor_faults.json", [*map(fault_data, faults)], _draw_faults(faults))


@styled()
def _draw_faults(faults: Sequence[RotorFault]) -> Any:
    figure = new_figure(3.4 * len(faults))
    rows = figure.subplots(len(faults), 2, squeeze=False)
    for fault, (left, right) in zip(faults, rows, strict=True):
        t, chance = fault.samples.t, fault.probabilities[fault.found]
        left.plot(t, fault.samples.angular_acceleration, label=["about x", "about y", "about z"])
        left.set(ylabel="angular acceleration, rad/s2", title=Path(fault.log).name)
        right.plot(t, fault.samples.command.at(t), label=ROTORS)
        title = f"{_in_words(fault, fault.found)}: {chance:.3f}"
        right.set(ylabel="command, in parts of the median", title=title)
        for panel in (left, right):
            room_above(panel)
            panel.legend(loc="upper left", ncols=4)
            panel.set_xlabel("t, s (the log's clock)")
            if fault.rotor:
                panel.axvline(fault.onset_s, color=BLACK, ls="--")
                panel.set_xlim(fault.onset_s - 3.0, t[-1] + 0.1)
    return figure
