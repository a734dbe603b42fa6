"""Possible meanings of a flight's columns: each reading writes its own sentence.

A reading assigns frames, the order and sense of the attitude, a unit of length, rotors and a clock
to columns. ``evidence`` compares a flight with each.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from itertools import permutations, product
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from ...runtime.yaml_file import read_yaml
from ..motion.smoothing import resampled
from .channels import quaternions, scaled
from .flight_log import FlightLog
from .log_map import SENSES, UNITS, Attitude
from .table import Array, Data, Lines, Mask, NamedTexts, Names, finite_rows, lengths
from .what_flew import ORDERS, Order, order_names

_I = np.eye(3)
_STATED: Data = read_yaml(Path(__file__).with_name("conventions.yaml"), "conventions")


@dataclass(frozen=True, eq=False)
class Frames:
    """Axes of the position's world, of the attitude's world and of the body."""

    fact: str = ""  # words for the axes; empty for the kit's own
    # (3, 3) each: from the columns' world to the kit's (z up), of positions and of attitudes; and
    # from the kit's body axes (forward, left, up) to those of the attitude
    position: Array = field(default_factory=lambda: _I)
    world: Array = field(default_factory=lambda: _I)
    body: Array = field(default_factory=lambda: _I)
    map_world: str = ""  # names in a map; empty: a map has none
    map_body: str = ""
    unusual: bool = False  # axes of no usual convention


def _axes(text: str) -> Array:
    """Return the matrix (3, 3) of a text such as ``x -y -z``, from x, y and z to these axes."""
    rows = [_I["xyz".index(axis[-1])] * (-1.0 if "-" in axis else 1.0) for axis in text.split()]
    return np.array(rows) + 0.0  # no negative zeros


def _frames(stated: Data) -> Frames:
    axes = {name: _axes(stated[name]) for name in {"position", "world", "body"} & stated.keys()}
    return Frames(**stated | axes)


_USUAL_FRAMES = tuple(map(_frames, _STATED["frames"]))
MAP_FRAMES = tuple(frames for frames in _USUAL_FRAMES if frames.map_world)  # with names in a map


_FACTS: NamedTexts = _STATED["positions"]
_ALONG = [  # the 47 other directions of px, py, pz along axes of the attitude's world
    " ".join(map("".join, zip(signs, axes, strict=True)))
    for axes, signs in product(permutations("xyz"), product(("", "-"), repeat=3))
][1:]
_POSITIONS = [
    Frames(
        _FACTS.get(text, "px, py, pz lie along other axes than the attitude's world"),
        _axes(text),
        unusual=text not in _FACTS,
    )
    for text in _ALONG
]
ROTORS: Order = ORDERS["windwrench"]


@dataclass(frozen=True, eq=False)
class SensorReading:
    """One way to read an inertial sensor."""

    says: str = ""  # the columns' look, the expected columns, and the remedy
    turn: Array = field(default_factory=lambda: _I)  # (3, 3), multiplies the columns
    lacks_gravity: bool = False  # an acceleration in place of the specific force
    unit: str = ""  # of the columns, in a map
    body: str = ""  # axes of the columns, in a map


AS_DECLARED = SensorReading()


def _sensor(says: str, scale: float = 1.0, axes: str = "x y z", **more: Any) -> SensorReading:
    return SensorReading(says, scale * _axes(axes), **more)


GYRO_READINGS = tuple(_sensor(**stated) for stated in _STATED["gyro"])
ACCELEROMETER_READINGS = tuple(_sensor(**stated) for stated in _STATED["accelerometer"])

AS_WRITTEN = Attitude(())  # without columns


@dataclass(frozen=True, eq=False)
class Convention:
    """One way to read a flight's columns: frames, units, order, sense, clock and sensors."""

    attitude: Attitude = AS_WRITTEN
    frames: Frames = MAP_FRAMES[0]
    length: str = "m"  # unit of the position
    gyro: SensorReading = AS_DECLARED
    rotors: Order = ROTORS  # the kit's rotor, from 1, in each column
    mirrored: bool = False  # rotors turn against the declared spin
    late: float = 0.0  # s, delay of the rotors' columns against the motion
    unlikely: float = 0.0  # log-likelihood ratio against an unusual convention

    @property
    def moves(self) -> tuple[Attitude, Frames, str, SensorReading]:
        """The fields for motion: the first four."""
        return self.attitude, self.frames, self.length, self.gyro

    @property
    def pitch_sign(self) -> int:
        """Sign of the angle about y."""
        return -1 if self.attitude.signs else 1

    @property
    def motors(self) -> Order:
        """Motor, from 1, of each of the kit's rotors."""
        return tuple(self.rotors.index(rotor) + 1 for rotor in ROTORS)

    @property
    def says(self) -> str:
        """The columns' look, the expected columns, and the remedy, in words."""
        words = [f"gx, gy, gz {self.gyro.says}"] if self.gyro.says else []
        if self.late:
            late, sooner = ("late", "earlier") if self.late > 0.0 else ("early", "later")
            seconds = f"{abs(self.late):.2f} s"
            words.append(
                f"the rotor speeds come {seconds} too {late} against the motion; expected both on "
                "one clock: put omega1..omega4 (or the commands behind them) "
                f"{seconds} {sooner}"
            )
        if self.length != "m":
            name = {"mm": "millimetres", "cm": "centimetres", "ft": "feet"}[self.length]
            words.append(
                f"px, py, pz look like {name}; expected metres: divide them by "
                f"{1.0 / UNITS['position'][self.length]:.4g}"
            )
        words += self._pose_words()
        if self.rotors != ROTORS:
            known = " or ".join(order_names(self.motors))
            words.append(
                f"the rotors look permuted: omega1..omega4 are rotors "
                f"{','.join(map(str, self.rotors))} of this vehicle"
                f"{known and f' (the order {known})'}"
                "; expected 1 front-left, 2 rear-left, 3 rear-right, 4 front-right: reorder the "
                "columns"
            )
        if self.mirrored:
            words.append(
                "the rotors turn against the declared spin: mirror spin in the vehicle file"
            )
        if self.rotors == (3, 4, 1, 2) and not self.mirrored:
            words.append(
                "body axes that point backward and right instead of forward and left look the same"
            )
        return "; ".join(words)

    def _pose_words(self) -> Lines:
        orders = {
            "xyzw": "the quaternion is scalar last",
            "zwxy": "the quaternion is scalar first under the headers of scalar last",
        }
        order, sense = self.attitude.order, ""
        if self.attitude.sense != SENSES[0]:
            sense = "world to body" if order in orders else "the quaternion is world to body"
        facts = orders.get(order, ""), sense, self.frames.fact
        if not any(facts):
            return []
        position = _combined(self.frames.position, ("px", "py", "pz"))
        quaternion = _quaternion(self)
        take = [f"{position} as the position"] if position != "(px, py, pz)" else []
        if quaternion != "(qw, qx, qy, qz)":
            take.append(f"{quaternion} as the quaternion (qw, qx, qy, qz)")
        return [
            " and ".join(filter(None, facts)),
            "expected one world, z up, body axes forward, left, up, and a quaternion scalar first, "
            f"body to world: take {' and '.join(take)}",
        ]


def _combined(matrix: Array, columns: Names) -> str:
    """Return the products of a matrix's rows and columns in words, up to one positive factor."""
    rows = []
    for row in np.round(matrix, 6):
        terms = "".join(
            f" {'-' if x < 0 else '+'} {name}" for x, name in zip(row, columns, strict=True) if x
        )
        rows.append(f"{'-' if terms[1] == '-' else ''}{terms[3:]}")
    return f"({', '.join(rows)})"


def _quaternion(reading: Convention) -> str:
    """Return in words the kit's quaternion of the columns qw, qx, qy, qz."""
    frames = reading.frames
    mirror = np.linalg.det(frames.world)  # the body's too: a mirrored rotation is one again
    world, body = (Rotation.from_matrix(mirror * turn) for turn in (frames.world, frames.body))
    columns = as_written(np.eye(4), reading.attitude)[1]
    made = (world * columns * body).as_quat(scalar_first=True).T
    first = made[0][abs(made[0]) > 0.1][0]
    text = _combined(made * np.sign(first), ("qw", "qx", "qy", "qz"))
    return text if abs(first) > 0.9 else f"0.7071 {text}"


DECLARED = Convention()
# penalties in log-likelihood ratios: the declared reading is right far more often, and there are
# some 60 different time offsets
OTHER, OFFSET = 8.0, 12.0


def _each(**aspects: Sequence[Any]) -> list[Convention]:
    """Return the readings of all combinations of aspects."""
    return [
        Convention(**dict(zip(aspects, way, strict=True))) for way in product(*aspects.values())
    ]


def _weighed(readings: Sequence[Convention], world: str = "enu") -> list[Convention]:
    """Return readings with a penalty of 1 for each less usual convention; ``world``: the usual."""
    return [
        replace(
            r,
            unlikely=r.unlikely
            + (r.attitude.order != "wxyz")
            + (r.attitude.euler == "xyz")
            + bool(r.attitude.signs)
            + (r.attitude.sense != SENSES[0])
            + (r.frames.map_world != world)
            + r.frames.unusual,
        )
        for r in readings
    ]


ROTOR_READINGS = [  # two departures at once are as unlikely as both
    replace(r, unlikely=OTHER * (r.mirrored + (r.rotors != ROTORS)))
    for r in _each(mirrored=(False, True), rotors=tuple(permutations(ROTORS)))[1:]
]


def _quaternions(orders: Names) -> list[Attitude]:
    return [Attitude((), order=order, sense=sense) for order, sense in product(orders, SENSES)]


def log_readings(has_pose: bool) -> list[Convention]:
    """Return the readings of the kit's own columns, the one as declared first.

    Args:
        has_pose: whether the motion is a pose's, else a gyro's.
    """
    others = _each(gyro=GYRO_READINGS)
    if has_pose:
        attitudes = _quaternions(("wxyz", "xyzw", "zwxy"))
        others = _each(attitude=attitudes, frames=_USUAL_FRAMES)[1:]
        others.append(Convention(attitudes[1], _frames(_STATED["mirrored"])))
        others += _each(frames=_POSITIONS) + _each(length=("cm", "mm", "ft"))
    others = [replace(reading, unlikely=OTHER) for reading in others]
    return [DECLARED, *_weighed(others), *ROTOR_READINGS]


def table_readings(orders: Names, units: Names, length: str, hint: str) -> list[Convention]:
    """Return the readings of a table's pose within a map's words.

    Args:
        orders: orders of a quaternion's columns, the usual first; empty: angles.
        units: of angles.
        length: unit of the position by the columns' names; others have a penalty.
        hint: the world by the columns' names; empty: none.
    """
    angles = [
        Attitude((), unit, euler=euler, signs=signs, sense=sense)
        for euler, unit, signs, sense in product(("zyx", "xyz"), units, ((), (1, -1, 1)), SENSES)
    ]
    known = ("ft",) if length == "ft" else ("m", "cm", "mm")
    readings = _each(attitude=_quaternions(orders) or angles, frames=MAP_FRAMES, length=known)
    named = [
        replace(r, unlikely=OTHER * (length in known and r.length != length)) for r in readings
    ]
    return _weighed(named, hint or "enu")


def applied(log: FlightLog, reading: Convention) -> FlightLog:
    """Return a log with the advice of a reading taken; the vehicle's spin is no part of a log."""
    speeds, parts = log.rotor_speeds[:, np.argsort(reading.rotors)], Data()
    if reading.late:
        speeds = resampled(log.t + reading.late, log.t, speeds)
    if reading.gyro.says:
        assert log.gyro is not None
        parts["gyro"] = log.gyro @ reading.gyro.turn.T
    if log.has_pose:
        quaternion = np.full_like(log.quaternion, np.nan)
        good, turned = rotations(log.quaternion, reading)
        quaternion[good] = turned.as_quat(scalar_first=True)
        turn = reading.frames.position.T * UNITS["position"][reading.length]
        parts |= {"position": log.position @ turn, "quaternion": quaternion}
    return replace(log, rotor_speeds=speeds, **parts)


def rotations(columns: Array, reading: Convention) -> tuple[Mask, Rotation]:
    """Return the rows (N,) with an attitude, and their rotations by a reading, body to world in the
    kit's frames.
    """
    good, rotation = as_written(columns, reading.attitude)
    frames = reading.frames
    return good, Rotation.from_matrix(frames.world @ rotation.as_matrix() @ frames.body)


def as_written(columns: Array, attitude: Attitude) -> tuple[Mask, Rotation]:
    """Return the same, body to world, in the columns' own frames."""
    good = finite_rows(columns)
    if not attitude.euler:
        good &= np.isclose(lengths(columns), 1.0, atol=0.5)
    turns = quaternions(attitude, scaled(attitude, columns[good]))
    rotation = Rotation.from_quat(turns, scalar_first=True)
    return good, rotation if attitude.sense == SENSES[0] else rotation.inv()
