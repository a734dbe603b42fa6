"""Sizes of a flight's numbers: likely units, and limits of any flight.

The guess of a map, the reading of a log and its screening decide here, with the same sentences.
"""

import re
from dataclasses import replace
from itertools import combinations

import numpy as np

from ...dynamics.vehicle import Vehicle
from ...runtime.errors import InputError
from .column_names import WORDS, Group
from .flight_log import FlightLog, SomeVehicle, parts_of
from .flight_phases import carrying, usual_thrust
from .log_map import UNITS
from .table import Array, Lines, Mask, Pair, finite_rows

# sizes of a likely unit, and of a certain one: s of a row, V of a battery, m/s2 of gravity
_LIKELY = {"time": (0.0002, 0.2), "battery": (2.7, 100.0), "accelerometer": (8.335, 11.278)}
_CERTAIN = _LIKELY | {"time": (0.0004, 1.0 / 15.0), "battery": (2.7, 60.0)}
# of rotors, in words, and in rad/s
_SPEEDS = {
    "rad/s": ("", 1.0),
    "rpm": ("revolutions per minute", 0.10471975511965977),
    "Hz": ("revolutions per second", 6.283185307179586),
    "deg/s": ("degrees per second", 0.017453292519943295),
}
_SHORTEST_PERIOD = 1.0e-5  # s, of the median step: 100 kHz, far above any pose's rate
# s, of any step. A log in nanoseconds has steps of 1e7; a step of a year is no flight
_LONGEST_STEP = 1.0e12
LARGEST = 1.0e9  # SI units, all other numbers; millimetres or rpm stay far below
# median thrust by weight; beyond, another vehicle may have flown
DOUBTFUL = 0.5, 2.0
# rad/s: the largest drones' rotors (1.4 m across) hover at 150; slower, the unit is wrong
_SLOW = 100.0
# ratio of two rotors' medians in flight, at most: to 1.09 on 96 sound flights, from 1.9 on where a
# rotor reads half its speed. A propeller of half the thrust turns at 1.41
_UNEVEN = 1.5


def within(value: float, limits: Pair) -> bool:
    """Return whether a value lies between two limits."""
    return limits[0] <= value <= limits[1]


def likely_unit(section: str, size: float) -> tuple[str, bool]:
    """Return the first unit of a section with a likely size, or the first of all, and whether the
    unit is certain. The size is a battery's median voltage, the time's median step, or an
    accelerometer's median length.
    """
    sizes = {u: size * one for u, one in UNITS[section].items() if u not in ("min", "raw")}
    likely = [unit for unit in sizes if within(sizes[unit], _LIKELY[section])]
    unit = [*likely, *sizes][0]
    return unit, within(sizes[unit], _CERTAIN[section])


def time_doubt(step: float) -> str:
    """Return a doubt on the time's unit by a median step (s), or nothing."""
    names = {"s": "seconds", "ms": "milliseconds", "us": "microseconds", "ns": "nanoseconds"}
    unit, is_sure = likely_unit("time", step)
    words = (
        f"t looks like {names[unit]}: its median step is {step:.4g}; expected seconds: "
        f"divide t by {1.0 / UNITS['time'][unit]:g}"
    )
    return words if is_sure and unit != "s" else ""


def _thrust_by_weight(rotor_speeds: Array, vehicle: Vehicle) -> float:
    """Return the median thrust of turning rotors (N, 4) in rad/s, by the vehicle's weight; 1 where
    none turns.
    """
    if not rotor_speeds.size:
        return 1.0
    with np.errstate(over="ignore"):
        thrust = rotor_speeds**2 @ vehicle.k / vehicle.weight
    return usual if np.isfinite(usual := usual_thrust(thrust)) else 1.0


def _carrying_units(thrust: float) -> Lines:
    """Return the units of rotor speeds able to carry the vehicle, by the median thrust by weight of
    the numbers as rad/s.
    """
    # mass and thrust curve may be off
    return [u for u, (_, one) in _SPEEDS.items() if within(thrust * one**2, (0.55, 1.8))]


def rotor_doubt(thrust: float, vehicle: Vehicle) -> str:
    """Return a doubt on rotor speeds in rad/s by a median thrust by weight, or nothing."""
    if within(thrust, (0.2, 5.0)):  # beyond, another vehicle flew
        return ""
    for unit in _carrying_units(thrust):
        name, factor = _SPEEDS[unit]
        what = f"divide by {1 / factor:.4g}" if factor < 1 else f"multiply by {factor:.4g}"
        return (
            f"omega1..omega4 look like {name}: read as rad/s they make {thrust:.3g} times the "
            f"weight of {vehicle.name}; expected rad/s: {what}"
        )
    return (
        f"the rotor speeds make a median thrust of {thrust:.3g} times the weight of "
        f"{vehicle.name}; expected about 1: omega1..omega4 in rad/s, and the vehicle that flew"
    )


def motor_doubts(log: FlightLog) -> Lines:
    """Return doubts on four motors, whatever the vehicle: equal columns, uneven medians in flight,
    and rotors slower than any propeller in hover.
    """
    measured = log.has_rotor_speeds and not log.commanded
    motors = log.rotor_speeds if measured else log.command
    if motors is None or not np.isfinite(motors).all() or not (motors > 0.0).any():
        return []
    what = "rotor speeds" if measured else "motor commands"
    alike = [
        f"{what} of motors {i + 1} and {j + 1} are equal in every row; expected four motors"
        for i, j in combinations(range(4), 2)
        if np.array_equal(motors[:, i], motors[:, j])
        # a column of fewer changes is no measurement, and equal by chance
        and np.count_nonzero(np.diff(motors[:, i])) >= 20
    ]
    doubts = [] if len(alike) == 2 else alike[:1]  # two pairs: a flight in one plane without noise
    medians = np.median(motors[carrying((motors**2).sum(axis=1))], axis=0)
    expected = ""
    if medians.max() > _UNEVEN * medians.min():
        expected = f"a ratio of at most {_UNEVEN:g}"
    elif medians.max() < _SLOW:
        expected = f"at least {_SLOW:g}: no rotor carries a drone at less. Check the unit"
    if measured and expected:
        listed = ", ".join(f"{x:.3g}" for x in medians)
        doubts.append(
            f"medians of the four rotor speeds in flight are {listed} rad/s; expected {expected}"
        )
    return doubts


def motor_unit(
    group: Group, values: Array, vehicle: SomeVehicle, power: float = np.nan
) -> tuple[str, str, bool, str]:
    """Return whether columns are rotors or commands, their unit, whether the unit is certain, and
    why. The first matching rule decides. The specific force grows with ``power`` of the columns;
    NaN: unknown.
    """
    # the last word of a path such as /fmu/out/esc_status/rotor_speed.00
    names = " ".join(re.sub(r"^.*/(?=.*[a-z])", "", name.lower()) for name in group.columns)
    turning = abs(values[np.isfinite(values) & (values != 0.0)])
    if not turning.size:
        return "commands", "normalised", False, "all are zero"
    low, middle, high = np.quantile(turning, [0.01, 0.5, 1.0]).tolist()
    named = group.unit or next((unit for unit in ("eRPM", "rpm") if unit.lower() in names), "")
    commanded = re.search("|".join(WORDS["command_words"]), names)
    speeds = bool(re.search("omega|speed|rotor|rpm", names))
    speeds |= within(power, (1.5, 2.5)) and not commanded  # about 2: squares
    pulses = low >= 850.0 and high <= 2250.0
    carrier = ""  # the one unit in which the rotors carry the vehicle
    if vehicle is not None and not commanded:
        thrust = _thrust_by_weight(values[finite_rows(values)], vehicle)
        carrying = [unit for unit in _carrying_units(thrust) if unit in UNITS["rotors"]]
        carrier = carrying[0] if len(carrying) == 1 else ""
    # numbers of 1000 to 2000 may be pulses as well, whatever they would carry
    doubt = "pulses in us" if pulses else "percents" if high <= 100.0 else ""
    doubt = "" if speeds else doubt
    by_names, between = "by the columns' names", f"values from {low:.4g} to {high:.4g}"
    if not np.isnan(power):
        between += f", and the specific force grows with their power of {power:.2g}"
    up_to = f"values up to {high:.6g}"
    carries = f"then the rotors carry the weight of {vehicle.name if vehicle else ''}"
    carries += f", though they may be {doubt}" if doubt else ""
    # the vehicle's weight may contradict a name, but poles of eRPM are unknown
    lifts = carrier and named in UNITS["rotors"] and named not in ("eRPM", carrier)
    rules = (
        (lifts, "rotors", carrier, False, f"{carries}, not in {named} as names say"),
        (named in UNITS["rotors"], "rotors", named, True, by_names),
        (high <= 1.0, "commands", "normalised", "omega" not in names, up_to),
        (named in ("us", "percent"), "commands", named, True, by_names),
        (commanded and pulses, "commands", "us", True, between),
        (commanded and high <= 100.0, "commands", "percent", False, up_to),
        (commanded and high <= 65535.0, "commands", "counts", False, up_to),
        (pulses and power >= 2.8, "commands", "us", True, between),
        (carrier, "rotors", carrier, not doubt, carries),
        (
            middle > 20000.0 and high <= 65535.0,
            "commands",
            "counts",
            False,
            f"{up_to}, which may be 16 bits of a command, or rpm",
        ),
        (
            not commanded and middle > 4500.0,
            "rotors",
            "rpm",
            True,
            f"the median is {middle:.5g}, too fast for rad/s",
        ),
        (pulses and not speeds, "commands", "us", False, between),
        (
            middle > 2600.0,  # in rad/s only palm-sized vehicles hover as fast
            "rotors",
            "rpm",
            False,
            f"the median is {middle:.4g}: few rotors turn as fast in rad/s",
        ),
        (True, "rotors", "rad/s", False, f"the median is {middle:.4g}; it might be rpm or Hz"),
    )
    return next(rule[1:] for rule in rules if rule[0])


def unit_doubts(log: FlightLog, vehicle: SomeVehicle) -> Lines:
    """Return doubts on a log's units by the sizes of its numbers.

    Raises:
        InputError: a number is beyond any flight's; the message names the number.
    """
    step = np.diff(log.t)
    where, longest = f"{log.source}: column", step.argmax()
    if not log.period >= _SHORTEST_PERIOD:
        raise InputError(
            f"{where} t: the median time step is {log.period:.3g} s; expected at least "
            f"{_SHORTEST_PERIOD:g} s"
        )
    if not step[longest] <= _LONGEST_STEP:
        raise InputError(
            f"{where} t, row {longest + 2}: {step[longest]:.3g} s after the row before; expected "
            f"at most {_LONGEST_STEP:g} s"
        )
    for names, values in parts_of(log)[1:]:
        columns = values.reshape(len(log.t), -1)
        for row, i in np.argwhere(abs(columns) > LARGEST)[:1]:  # False where NaN
            raise InputError(
                f"{where} {names[i]}, row {row + 1}: {columns[row, i]:.3g}; expected a number "
                f"within {LARGEST:g}"
            )
    doubts = [time_doubt(log.period), *motor_doubts(log)]
    spread = np.ptp(log.position[log.valid], axis=0).max() if log.has_pose else 0.0
    if spread > 300.0:
        doubts.append(
            f"positions spread over {spread:.0f} m: are px, py, pz in millimetres? Expected metres"
        )
    if vehicle is not None and log.has_rotor_speeds:
        doubts.append(rotor_doubt(_thrust_by_weight(log.rotor_speeds, vehicle), vehicle))
    return [doubt for doubt in doubts if doubt]


def interpolated(log: FlightLog, broken: Mask) -> FlightLog:
    """Return a log with lines between the other rotor speeds where they are ``broken`` (N, 4)."""
    speeds = log.rotor_speeds.copy()
    for column, wrong in zip(speeds.T, broken.T, strict=True):
        column[wrong] = np.interp(log.t[wrong], log.t[~wrong], column[~wrong])
    return replace(log, rotor_speeds=speeds)


def without_broken_speeds(log: FlightLog) -> tuple[FlightLog, Lines]:
    """Return a log without broken rotor speeds, and a doubt where there are some: no rotor triples
    its speed in a sample or two and falls back. Neighbours are interpolated.
    """
    if not log.has_rotor_speeds or log.commanded:
        return log, []
    high = np.nanquantile(log.rotor_speeds, 0.99, axis=0)
    # 3 times the speed: 9 times the thrust
    fast = log.rotor_speeds > 3.0 * np.where(high > 0.0, high, np.inf)
    # a sample counts if the third before it and the third behind it are sound
    far = np.pad(fast, ((3, 3), (0, 0)))
    broken = fast & ~far[:-6] & ~far[6:]
    if not broken.any():
        return log, []
    return interpolated(log, broken), [
        f"{broken.sum()} rotor speeds are broken, up to {log.rotor_speeds[broken].max():.0f} rad/s "
        f"where 99 % are below {high.max():.0f}: they were interpolated"
    ]
