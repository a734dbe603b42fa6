"""Whether four columns are rotor speeds or commands, and in which unit: by their names, sizes, and
how the specific force grows with them.
"""

import re
from dataclasses import dataclass

import numpy as np

from ...dynamics.vehicle import Vehicle
from .column_names import Group, words
from .log_map import UNITS
from .magnitudes import carrying_units, thrust_by_weight, within
from .table import Array


@dataclass(frozen=True)
class MotorSettings:
    """When the unit of four motors' columns is told."""

    rpm: float = 4500.0  # median above which no unit but rpm is left: no propeller turns at that
    # rate in rad/s
    fast: float = 2600.0  # median above which rpm is likelier: no hover but a palm-sized vehicle's
    counts: float = 20_000.0  # median above which rpm may also be a command of 16 bits
    # power by which the specific force grows: of rotor speeds, and from which on of pulses
    squares: tuple[float, float] = (1.5, 2.5)
    offset: float = 2.8


MOTOR = MotorSettings()


def motor_unit(
    group: Group, values: Array, vehicle: Vehicle | None, power: float = np.nan
) -> tuple[str, str, bool, str]:
    """Return whether columns are rotors or commands, their unit, if that is certain, and why: by
    the first rule that holds. ``power`` is that by which the specific force grows with them; NaN:
    unknown.
    """
    # of a path such as /fmu/out/esc_status/rotor_speed.00 the last word
    names = " ".join(re.sub(r"^.*/(?=.*[a-z])", "", name.lower()) for name in group.columns)
    turning = np.abs(values[np.isfinite(values) & (values != 0.0)])
    if not turning.size:
        return "commands", "normalised", False, "all are zero"
    low, middle, high = (float(x) for x in np.quantile(turning, [0.01, 0.5, 1.0]))
    named = group.unit or next((unit for unit in ("eRPM", "rpm") if unit.lower() in names), "")
    commanded = any(word in names for word in words()["command_words"])
    speeds = any(word in names for word in ("omega", "speed", "rotor", "rpm"))
    speeds |= within(power, MOTOR.squares) and not commanded
    pulses = low >= 850.0 and high <= 2250.0
    carrying: list[str] = []
    if vehicle is not None and not commanded:
        there = values[np.isfinite(values).all(axis=1)]
        carrying = [
            u for u in carrying_units(thrust_by_weight(there, vehicle)) if u in UNITS["rotors"]
        ]
    # numbers of 1000 to 2000 may be pulses as well, whatever they would carry
    doubt = "pulses in us" if pulses else "percents" if high <= 100.0 else ""
    doubt = "" if speeds else doubt
    by_names, between = "by the columns' names", f"values from {low:.4g} to {high:.4g}"
    if not np.isnan(power):
        between += f", and the specific force grows with their power of {power:.2g}"
    up_to = f"values up to {high:.6g}"
    carries = f"in it the rotors carry the weight of {vehicle.name if vehicle else ''}"
    carries += f", though they may be {doubt}" if doubt else ""
    # by the vehicle's weight a name may be wrong, but poles of eRPM are unknown
    lifts = len(carrying) == 1 and named in UNITS["rotors"] and named not in ("eRPM", *carrying)
    rules = (
        (lifts, "rotors", "".join(carrying), False, f"{carries}, not in {named} as names say"),
        (named in UNITS["rotors"], "rotors", named, True, by_names),
        (high <= 1.0, "commands", "normalised", "omega" not in names, up_to),
        (named in ("us", "percent"), "commands", named, True, by_names),
        (commanded and pulses, "commands", "us", True, between),
        (commanded and high <= 100.0, "commands", "percent", False, up_to),
        (commanded and high <= 65535.0, "commands", "counts", False, up_to),
        (pulses and power >= MOTOR.offset, "commands", "us", True, between),
        (len(carrying) == 1, "rotors", "".join(carrying), not doubt, carries),
        (
            not commanded and middle > MOTOR.counts and high <= 65535.5,
            *("commands", "counts", False),
            f"{up_to}, which may be 16 bits of a command, or rpm",
        ),
        (
            not commanded and middle > MOTOR.rpm,
            *("rotors", "rpm", True),
            f"the median is {middle:.5g}, too fast for rad/s",
        ),
        (pulses and not speeds, "commands", "us", False, between),
        (
            middle > MOTOR.fast,
            *("rotors", "rpm", False),
            f"the median is {middle:.4g}: few rotors turn as fast in rad/s",
        ),
    )
    otherwise = f"the median is {middle:.4g}; it might be rpm or Hz"
    return next((rule[1:] for rule in rules if rule[0]), ("rotors", "rad/s", False, otherwise))
