"""A log's statements on its vehicle (airframe, outputs, turning rotors), and orders of motors.

This kit knows quadrotors alone. Every reader fills the same form from its log, and one gate refuses
other vehicles, before four of six motors are taken for a quadrotor's.

An order gives the motor of each of the kit's rotors: 1 front-left, 2 rear-left, 3 rear-right,
4 front-right. ``column_words.yaml`` states the vehicles' orders by name, and their sources.
"""

import re
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import takewhile

import numpy as np

from ...dynamics.vehicle import Vehicle
from ...runtime.errors import InputError, unknown_name
from .column_names import WORDS
from .table import ArrayMap, Lines, Names, Pair, Table, Texts, finite_rows

Order = tuple[int, ...]  # four

PLACES = ("front-left", "rear-left", "rear-right", "front-right")  # of rotors 1 to 4

ORDERS: dict[str, Order] = {name: tuple(order) for name, order in WORDS["rotor_orders"].items()}

QUADROTOR = "a quadrotor"
# motors 1 to 4 of PX4's and ArduPilot's plus: right, left, front, rear; x forward, y left
PLUS = ((0.0, -1.0), (0.0, 1.0), (1.0, 0.0), (-1.0, 0.0))


def rotor_order(value: object) -> Order:
    """Return the motor, from 1, of each of the kit's rotors.

    Args:
        value: a name of ``ORDERS``, or the four motors' numbers, front-left first.

    Raises:
        InputError: neither.
    """
    if isinstance(value, str):
        if value not in ORDERS:
            raise unknown_name("rotor order", value, ORDERS)
        return ORDERS[value]
    if isinstance(value, list | tuple) and sorted(map(str, value)) == ["1", "2", "3", "4"]:
        return tuple(map(int, value))
    raise InputError(
        f"{value!r}; expected one of {', '.join(ORDERS)}, or the numbers of the motors "
        f"at the {', '.join(PLACES)}, such as [3, 2, 4, 1]"
    )


def order_words(order: Order, named: Names = PLACES) -> str:
    """Return an order in words, by the places of the kit's rotors."""
    places = sorted(zip(order, named, strict=True))
    return f"motors {', '.join(f'{motor} {place}' for motor, place in places)}"


def order_names(order: Order) -> Lines:
    """Return the names of an order, if any."""
    return [name for name, known in ORDERS.items() if known == order]


@dataclass(frozen=True)
class WhatFlew:
    """A log's statements on its vehicle; empty and None: nothing."""

    airframe: str = ""  # in words, such as "a hexarotor"
    by: str = ""  # the parameter, message or header stating the airframe
    rotors: int | None = None  # how many it has
    outputs: str = ""  # protocol and range of the motors' outputs, in words

    def check(self, path: object) -> None:
        """Check a log for a quadrotor.

        Raises:
            InputError: the log states another vehicle.
        """
        count = WORDS["airframes"].get(self.airframe) if self.rotors is None else self.rotors
        with_rotors = "" if count in (None, 4) else f" with {count} rotors"
        if self.airframe not in ("", QUADROTOR) or with_rotors:
            raise InputError(
                f"{path}: {self.by} says {self.airframe or 'a vehicle'}{with_rotors}; expected a "
                "quadrotor"
            )

    def rows(self) -> list[tuple[str, str, str]]:
        """Return the statements as rows of a table: name, value, and source."""
        told = [
            ("airframe", self.airframe.partition(" ")[2], self.by),
            ("rotors", str(self.rotors or ""), self.by),
            ("outputs", self.outputs, ""),
        ]
        return [row for row in told if row[1]]


UNSTATED = WhatFlew()


def more_rotors(columns: Names, source: Table | ArrayMap, are_speeds: bool = False) -> str:
    """Return words on more than four rotors, or nothing: columns go on with the numbers of four
    motors', and turn as they do. Without a motor's name an output may be a servo's, and counts if a
    sum of the four: all are mixed of thrust, roll, pitch and yaw.

    Args:
        columns: the four.
        source: all columns (N,), by their names.
        are_speeds: the four are measured speeds; a servo has none.

    Raises:
        InputError: a table cannot be read.
    """
    turning = [*columns]
    others = source.numeric or source.header if isinstance(source, Table) else [*source]
    for name in _numbered_on(columns, others):
        data = source.read([*columns, name]) if isinstance(source, Table) else source
        rows = np.column_stack([data[column] for column in (*columns, name)])
        rows = rows[finite_rows(rows)]
        four, fifth = rows[:, :4], rows[:, 4]
        if len(rows) < 30 or np.ptp(fifth) == 0.0:
            continue
        size = abs(np.median(fifth) / max(np.median(abs(four)), 1e-12))
        moves = fifth - fifth.mean()
        left = np.linalg.lstsq(four - four.mean(axis=0), moves)[1]
        is_motor = are_speeds or re.search(WORDS["motor_words"], name.lower())
        # the four explain half of its variance, and its median is like theirs. Without a residual,
        # columns depend on each other
        if (is_motor or left.sum() / (moves**2).sum() < 0.5) and 0.5 <= size <= 2.0:
            turning.append(name)
    if len(turning) == len(columns):
        return ""
    return f"{len(turning)} rotors turn ({', '.join(turning)}); expected the four of a quadrotor"


def _numbered_on(columns: Names, others: Texts) -> Lines:
    """Return the other columns with the next numbers up in the four columns' names."""
    for found in zip(*(re.finditer(r"\d+", name) for name in columns), strict=False):
        numbers = {match[0] for match in found}
        if len(numbers) == len(columns):
            first, last = found[0], max(map(int, numbers))
            before, behind = first.string[: first.start()], first.string[first.end() :]
            following = (f"{before}{n:0{len(first[0])}d}{behind}" for n in range(last + 1, 16))
            return list(takewhile(others.__contains__, following))
    return []


def slots_of_motors(functions: Sequence[int], first: int) -> list[int]:
    """Return the slots of motors 1 to 4, by each slot's function number, with ``first`` for motor
    1; none: not all are there.
    """
    motors = range(first, first + 4)
    return [functions.index(motor) for motor in motors] if {*motors} <= {*functions} else []


def order_by_places(places: Sequence[Pair], vehicle: Vehicle | None = None) -> Order | None:
    """Return the motor, from 1, of each of the vehicle's rotors, by directions from the centre;
    None: no match.

    Args:
        places: (x forward, y left) of motors 1 to 4, in any unit.
        vehicle: with rotors wherever its file has them; None: one in each quadrant.
    """
    motors = np.arctan2(*np.transpose(places)[::-1])
    # from forward to the left
    wanted = np.radians([45.0, 135.0, 225.0, 315.0])
    if vehicle is not None:
        wanted = np.arctan2(*vehicle.positions.T[1::-1])
    off = abs(np.angle(np.exp(1j * (wanted[:, None] - motors))))
    nearest = 1 + off.argmin(axis=1)
    if np.degrees(off.min(axis=1).max()) > 30.0 or len({*nearest}) < len(nearest):
        return None
    return tuple(nearest.tolist())
