"""What the columns of a flight may mean, enumerated: each reading writes its own sentence.

A reading assigns frames, the order and sense of the attitude, a unit of length and rotors to
columns. ``evidence`` says how well a flight agrees with each.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from itertools import permutations, product

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from .log_map import ANGLE_UNITS
from .rotor_orders import ORDERS, Order

Array = NDArray[np.float64]

_I = np.eye(3)
_DOWN = np.diag([1.0, -1.0, -1.0])  # forward, left, up <-> forward, right, down; the worlds alike
_Y_UP = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])  # from a world with y up
_SWAP_YZ = _I[[0, 2, 1]]


@dataclass(frozen=True, eq=False)
class Frames:
    """Axes of the position's world, of the attitude's world and of the body.

    Attributes:
        fact: words for the axes; empty for the kit's own.
        advice: words for the columns that were expected.
        position: (3, 3) from the columns' world to the kit's (z up), of positions.
        world: (3, 3) the same, of the attitude.
        body: (3, 3) from the kit's body axes (forward, left, up) to those of the attitude.
        names: of world and body in a map; empty where a map has no names for the axes.
    """

    fact: str = ""
    advice: str = ""
    position: Array = field(default_factory=lambda: _I)
    world: Array = field(default_factory=lambda: _I)
    body: Array = field(default_factory=lambda: _I)
    names: tuple[str, str] = ("", "")


_ROTATE = "expected z up: p = (px, -pz, py)"
PLAIN = Frames(names=("enu", "flu"))
NED = Frames(
    "the world is z down (north, east, down) and the body z down (forward, right, down)",
    "expected z up: turn py, pz, qy and qz over (their signs) if the body axes are forward, right, "
    "down",
    *(_DOWN, _DOWN, _DOWN),
    ("ned", "frd"),
)
Z_DOWN = Frames(
    "the world is z down while the body axes are forward, left, up",
    "expected z up: negate py and pz, and take (-qx, qw, -qz, qy) as the quaternion "
    "(qw, qx, qy, qz)",
    *(_DOWN, _DOWN, _I),
    ("ned", "flu"),
)
FRD_BODY = Frames(
    "the body axes are forward, right, down in a world that is z up",
    "expected forward, left, up: take (-qx, qw, qz, -qy) as the quaternion (qw, qx, qy, qz)",
    *(_I, _I, _DOWN),
    ("enu", "frd"),
)
MAP_FRAMES = (PLAIN, NED, FRD_BODY, Z_DOWN)  # that a map has names for
_Y_UP_WORLD = Frames(
    "the world is y up, as motion capture often is, with body axes forward, left, up",
    f"{_ROTATE}, and the attitude turned by 90 degrees about x likewise",
    *(_Y_UP, _Y_UP, _I),
)
_Y_UP_BODY = Frames(
    "the world and the body are y up, as motion capture often is",
    f"{_ROTATE} and the quaternion (qw, qx, -qz, qy)",
    *(_Y_UP, _Y_UP, _Y_UP.T),
)
_NED_ATTITUDE = Frames(
    "the attitude is z down (north, east, down; forward, right, down) but the position z up",
    "expected z up: negate qy and qz",
    *(_I, _DOWN, _DOWN),
)
_YZ_SWAPPED = Frames(
    "y and z are swapped, in position and quaternion",
    "expected z up: swap py and pz, and qy and qz",
    *(_SWAP_YZ, _SWAP_YZ, _SWAP_YZ),
)
_POSITION_FACTS = {  # by the columns that are x, y, z of the attitude's world
    "px, -py, -pz": "the position is z down (north, east, down) but the attitude z up",
    "px, -pz, py": "the position is y up but the attitude z up",
    "px, py, -pz": "the position's z points down: negate pz",
    "-px, py, pz": "px points the other way than the attitude's world: negate px",
    "px, -py, pz": "py points the other way than the attitude's world: negate py",
    "px, pz, py": "py and pz are swapped, the attitude is not",
    "py, px, pz": "px and py are swapped against the attitude",
    "pz, py, px": "px and pz are swapped, the attitude is not",
    "-px, -py, pz": "the position's world is turned against the attitude's by 180 degrees about z",
    "py, -px, pz": "the position's world is turned against the attitude's by 90 degrees about z",
    "-py, px, pz": "the position's world is turned against the attitude's by -90 degrees about z",
}


def _positions() -> Iterator[Frames]:
    """Yield the 47 other ways in which px, py, pz may lie along axes of the attitude's world."""
    for columns, signs in product(permutations(range(3)), product((1.0, -1.0), repeat=3)):
        turn = np.diag(signs) @ _I[list(columns)]
        if np.array_equal(turn, _I):
            continue
        axes = ", ".join(
            f"{'-' if sign < 0 else ''}p{'xyz'[column]}"
            for sign, column in zip(signs, columns, strict=True)
        )
        other = "px, py, pz lie along other axes than the attitude's world"
        fact = _POSITION_FACTS.get(axes, other)
        yield Frames(fact, f"expected both in one world frame, z up: p = ({axes})", position=turn)


POSITION_FRAMES = tuple(_positions())

# rotors (1 front-left, 2 rear-left, 3 rear-right, 4 front-right) in the order in which others count
# them
_KNOWN_ORDERS = {
    (3, 4, 2, 1): "Betaflight's order",
    (4, 2, 1, 3): "the order of PX4 and ArduPilot, quad x",
    (4, 3, 2, 1): "the Crazyflie's order, clockwise from front-right",
    (1, 4, 3, 2): "clockwise from front-left, as on the AR.Drone",
    (4, 1, 2, 3): "anticlockwise from front-right, as DJI counts",
}
ROTORS: Order = ORDERS["windwrench"]


@dataclass(frozen=True, eq=False)
class SensorReading:
    """One way to read an inertial sensor.

    Attributes:
        says: what the columns look like, what was expected, and what to do.
        turn: (3, 3) by which the columns are multiplied.
        lacks_gravity: the columns hold an acceleration in place of the specific force.
    """

    says: str = ""
    turn: Array = field(default_factory=lambda: _I)
    lacks_gravity: bool = False


AS_DECLARED = SensorReading()
BODY_AXES = {"flu": _I, "frd": _DOWN}  # by which the readings of a sensor are multiplied
_FRD = "those of body axes forward, right, down; expected forward, left, up: negate y and z"


def _sensor_readings(units: dict[str, float], inverted: str = "") -> tuple[SensorReading, ...]:
    """Return the readings of a sensor in units of other sizes and in other axes."""
    found = [SensorReading(f"look like {name}", size * _I) for name, size in units.items()]
    found.append(SensorReading(f"look like {_FRD}", _DOWN))
    found += [
        SensorReading(f"look like {name}, and like {_FRD}", size * _DOWN)
        for name, size in units.items()
    ]
    return (*found, SensorReading(f"look inverted{inverted}: negate all three", -_I))


GYRO_READINGS = _sensor_readings(
    {"degrees per second; expected rad/s: multiply by 0.0174533": ANGLE_UNITS["deg"]}
)
ACCELEROMETER_READINGS = (
    *_sensor_readings(
        {
            "g; expected m/s2: multiply by 9.80665": 9.80665,
            "milli-g; expected m/s2: multiply by 0.00980665": 9.80665e-3,
        },
        " (gravity, not specific force)",
    ),
    SensorReading(
        "look like an acceleration without gravity; expected the specific force that an "
        "accelerometer measures, 9.81 m/s2 along z in a hover",
        lacks_gravity=True,
    ),
)


@dataclass(frozen=True, eq=False)
class Reading:
    """One way to read a flight's columns.

    Attributes:
        order: which of w, x, y, z the columns of a quaternion hold.
        euler: order of turns of angles about x, y, z; empty: a quaternion.
        unit: of the angles.
        pitch_sign: of the angle about y.
        sense: of the attitude.
        frames: axes of worlds and body.
        length: unit of the position.
        rotors: the kit's rotor, from 1, in each column.
        mirrored: rotors turn against the declared spin.
        gyro: reading of the gyro's columns.
        unusual: how many of these are less usual than their alternatives.
    """

    order: str = "wxyz"
    euler: str = ""
    unit: str = "rad"
    pitch_sign: int = 1
    sense: str = "body_to_world"
    frames: Frames = PLAIN
    length: str = "m"
    rotors: Order = ROTORS
    mirrored: bool = False
    gyro: SensorReading = AS_DECLARED
    unusual: int = 0

    @property
    def attitude(self) -> tuple[str, str, str, int]:
        """What turns columns into rotations."""
        return self.order, self.euler, self.unit, self.pitch_sign

    @property
    def world(self) -> str:
        """Name of the world in a map."""
        return self.frames.names[0]

    @property
    def body(self) -> str:
        """Name of the body axes in a map."""
        return self.frames.names[1]

    @property
    def turns_rotors(self) -> bool:
        """Whether the rotors are others than the declared ones."""
        return self.rotors != ROTORS or self.mirrored

    @property
    def motors(self) -> Order:
        """Motor, from 1, of each of the kit's rotors."""
        a, b, c, d = (self.rotors.index(rotor) + 1 for rotor in ROTORS)
        return a, b, c, d

    @property
    def says(self) -> str:
        """What the columns look like, what was expected, and what to do."""
        if self.gyro.says:
            return f"gx, gy, gz {self.gyro.says}"
        if self.length != "m":
            name, divisor = {"mm": ("milli", 1000), "cm": ("centi", 100)}[self.length]
            return f"px, py, pz look like {name}metres; expected metres: divide them by {divisor}"
        if self.turns_rotors:
            return "; ".join(self._rotor_words())
        facts, advice = [], []
        if self.order == "xyzw":
            facts.append("the quaternion is scalar last")
            advice.append(
                "expected scalar first: qx, qy, qz, qw stand in the columns qw, qx, qy, qz; "
                "reorder the columns"
            )
        if self.order == "zwxy":
            facts.append("the quaternion is scalar first under the headers of scalar last")
            advice.append("qw, qx, qy, qz stand in the columns qx, qy, qz, qw; rename the columns")
        if self.sense == "world_to_body":
            facts.append("world to body" if facts else "the quaternion is world to body")
            advice.append("expected body to world: negate qx, qy and qz")
        if self.frames.fact:
            facts.append(self.frames.fact)
            advice.append(self.frames.advice)
        return f"{' and '.join(facts)}; {', then '.join(advice)}"

    def _rotor_words(self) -> list[str]:
        words = []
        if self.rotors != ROTORS:
            known = _KNOWN_ORDERS.get(self.rotors, "")
            words.append(
                f"the rotors look permuted: omega1..omega4 are rotors "
                f"{','.join(map(str, self.rotors))} of this vehicle{f' ({known})' if known else ''}"
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
        return words


DECLARED = Reading()


def pose_readings() -> list[Reading]:
    """Return the readings of a pose in the kit's columns, the one as declared left out."""
    usual = (PLAIN, NED, Z_DOWN, FRD_BODY, _NED_ATTITUDE, _Y_UP_WORLD, _Y_UP_BODY)
    found = [
        Reading(order=order, sense=sense, frames=frames)
        for order, sense, frames in product(
            ("wxyz", "xyzw", "zwxy"), ("body_to_world", "world_to_body"), usual
        )
    ][1:]
    # an exchange of two axes mirrors the rotation, too: its inverse is what turns as the body does
    found.append(Reading(sense="world_to_body", frames=_YZ_SWAPPED))
    found += [Reading(frames=frames) for frames in POSITION_FRAMES]
    found += [Reading(length=length) for length in ("cm", "mm")]
    return [replace(reading, unusual=_unusual(reading)) for reading in found]


def _unusual(reading: Reading) -> int:
    departs = (reading.order != "wxyz") + (reading.sense != "body_to_world")
    other = "lie along other axes" in reading.frames.fact
    return departs + (reading.frames is not PLAIN) + other


def gyro_readings() -> list[Reading]:
    """Return the other readings of a gyro."""
    return [Reading(gyro=reading) for reading in GYRO_READINGS]


def rotor_readings() -> list[Reading]:
    """Return the 47 other orders and senses of the rotors."""
    return [
        Reading(rotors=(a, b, c, d), mirrored=mirrored)
        for mirrored in (False, True)
        for a, b, c, d in permutations(ROTORS)
    ][1:]


def table_readings(
    orders: Sequence[str], units: Sequence[str], lengths: Sequence[str], hint: str
) -> list[Reading]:
    """Return the readings of a table's pose that a map can express.

    Args:
        orders: of a quaternion's columns, the usual first; nothing where they hold angles.
        units: of angles.
        lengths: units of the position.
        hint: the world that names speak for; empty: none.
    """
    attitudes: list[tuple[str, str, str, int]] = [(order, "", "rad", 1) for order in orders]
    if not orders:
        attitudes = [("wxyz", *a) for a in product(("zyx", "xyz"), units, (1, -1))]
    found = []
    for (order, euler, unit, sign), sense, frames, length in product(
        attitudes, ("body_to_world", "world_to_body"), MAP_FRAMES, lengths
    ):
        unusual = (
            (bool(orders) and order != orders[0])
            + (euler == "xyz")
            + (sign < 0)
            + (sense != "body_to_world")
            + (frames.names[0] != (hint or "enu"))
            + (frames not in (PLAIN, NED))
        )
        found.append(Reading(order, euler, unit, sign, sense, frames, length, unusual=unusual))
    return found


def rotations(columns: Array, reading: Reading) -> tuple[NDArray[np.bool_], Rotation]:
    """Return in which rows (N,) of an attitude's columns there is one, and the rotations of these
    rows by a reading, body to world in the kit's frames.
    """
    good, rotation = as_written(columns, reading)
    if reading.sense == "world_to_body":
        rotation = rotation.inv()
    frames = reading.frames
    return good, Rotation.from_matrix(frames.world @ rotation.as_matrix() @ frames.body)


def as_written(columns: Array, reading: Reading) -> tuple[NDArray[np.bool_], Rotation]:
    """Return the same in the columns' own frames and sense."""
    good: NDArray[np.bool_] = np.asarray(np.isfinite(columns).all(axis=1))
    if reading.euler:
        angles = columns[good] * ANGLE_UNITS[reading.unit] * [1.0, reading.pitch_sign, 1.0]
        axes = ["xyz".index(axis) for axis in reading.euler]
        return good, Rotation.from_euler(reading.euler.upper(), angles[:, axes])
    good &= np.linalg.norm(np.nan_to_num(columns), axis=1) > 0.5
    return good, Rotation.from_quat(columns[good][:, [reading.order.index(a) for a in "xyzw"]])
