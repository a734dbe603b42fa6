"""Which conventions a log follows, told from its physics: frames, quaternion order, units, order of
rotors, clocks.

Two balances hold in any flight, whatever small effects a vehicle's model lacks. The specific force
points along the thrust axis, ``a + g e3 = R e3 T / m``; and the rotors turn the body,
``J alpha + omega x J omega = tau``. Each balance is tried as the log declares itself and again
under every other reading of its columns that is in common use; the share of variance that a reading
leaves unexplained, low-passed at 3 Hz, says how well it fits. Undeclared effects change these
shares by parts, a wrong convention turns a sign or an axis and leaves more than there was.

A reading is recognised only where it wins clearly and the log as declared fits badly; a hover
decides nothing.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from itertools import permutations, product

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import lsq_linear

from ...dynamics.vehicle import Vehicle
from ..motion.signals import Signals, log_signals
from ..motion.smoothing import CUTOFFS, central_difference, low_pass
from .flight_log import FlightLog

Array = NDArray[np.float64]

_RATE_HZ = 20.0  # of the samples compared
_EDGE = 0.3  # s at either end of a piece, where filters start
_FLYING = 0.5  # of the median thrust: less is take-off, landing or ground
_LEAST_SAMPLES = 60

# what undeclared effects may make of a factor, of a delay (s) and of the vertical (cosine)
_FORCE_GAIN = (0.6, 1.6)
_TORQUE_GAIN = (0.4, 2.5)
_DELAYS = np.linspace(-0.1, 0.1, 9)
_UPRIGHT, _NOT_UPRIGHT = np.cos(np.radians(25.0)), np.cos(np.radians(40.0))

_BAD = 0.5  # share left unexplained from which on the log as declared fits badly
_CONTRADICTS = 1.2  # share of one torque alone that does, be the two others right
_GOOD_FORCE, _GOOD = 0.5, 0.4  # shares of force and of torque up to which another reading fits well
_CLEAR = 0.5  # of the share as declared: leaving less is a clear win
# share of the force as declared, and of that share what another reading leaves at most, where the
# win is decisive: undeclared effects may leave the first, and cannot undo nine tenths of it
_SOME_FORCE, _DECISIVE = 0.2, 0.1
_WORSE = 0.15  # share by which another reading may be worse in the other balance
_WORST = 2.0  # a share beyond says no more
# a share as declared beyond it cannot be made worse: rotor speeds from commands leave such torques
_SAYS_NOTHING = 0.8
_UPSIDE_DOWN = 1.0  # share of the vertical force alone: more than there was
_TIE = 1.25, 0.05  # factor and share within which two readings fit alike

_LONGEST_SHIFT, _SHIFT_STEP = 2.0, 0.02  # s
_SHIFT = 0.1  # s, what motors and radio delay
_SHIFT_CLEAR = 0.12  # s, a shift that they do not explain
_SHIFT_BAD = 0.15  # share left within that, from which another shift is worth a word

_I = np.eye(3)
_DOWN = np.diag(
    [1.0, -1.0, -1.0]
)  # forward, left, up <-> forward, right, down; north, west, up <-> north, east, down
_Y_UP = np.array(
    [[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]]
)  # of a frame whose y points up
_SWAP_YZ = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, 1.0, 0.0]])
_SWAP_XZ = np.array([[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [1.0, 0.0, 0.0]])
_SWAP_XY = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])


@dataclass(frozen=True, eq=False)
class Reading:
    """One way to read a log's columns: what turns the columns into this kit's conventions."""

    kind: str
    says: str  # what the log looks like, and what to do
    quaternion: tuple[int, int, int, int] = (
        0,
        1,
        2,
        3,
    )  # columns qw..qz, from 0, that hold w, x, y, z
    conjugate: bool = False
    position: Array = field(
        default_factory=lambda: _I
    )  # (3, 3) from the log's world to z up, for positions
    world: Array = field(default_factory=lambda: _I)  # (3, 3) the same for the attitude
    body: Array = field(
        default_factory=lambda: _I
    )  # (3, 3) from the body frame x forward, y left, z up to the log's
    scale: float = 1.0  # of positions
    order: tuple[int, ...] = (0, 1, 2, 3)  # rotors, counted from 0, that the columns hold
    mirrored: bool = False  # rotors turn against the declared spin


_Z_DOWN = (
    "expected z up: turn py, pz, qy and qz over (their signs) if the body axes are forward, right, "
    "down"
)
_ROTATE = "expected z up: p = (px, -pz, py)"
_SCALAR_LAST = 3, 0, 1, 2  # the columns qw, qx, qy, qz hold x, y, z, w
_SCALAR_FIRST = 1, 2, 3, 0  # the columns qx, qy, qz, qw hold w, x, y, z
_FROM_LAST = (
    "expected scalar first: qx, qy, qz, qw stand in the columns qw, qx, qy, qz; reorder the columns"
)
_FROM_FIRST = (
    "the quaternion is scalar first under the headers of scalar last: qw, qx, qy, qz stand in the "
    "columns qx, qy, qz, qw; rename the columns"
)
_CONJUGATE = "expected body to world: negate qx, qy and qz"

POSE_READINGS = (
    Reading("scalar last", f"the quaternion is scalar last; {_FROM_LAST}", quaternion=_SCALAR_LAST),
    Reading("conjugate", f"the quaternion is world to body; {_CONJUGATE}", conjugate=True),
    Reading(
        "scalar last, conjugate",
        f"the quaternion is scalar last and world to body; {_FROM_LAST}, then {_CONJUGATE}",
        quaternion=_SCALAR_LAST,
        conjugate=True,
    ),
    Reading(
        "NED",
        f"the world is z down (north, east, down) and the body z down (forward, right, down); "
        f"{_Z_DOWN}",
        position=_DOWN,
        world=_DOWN,
        body=_DOWN,
    ),
    Reading(
        "z down",
        "the world is z down while the body axes are forward, left, up; expected z up: negate py "
        "and pz, and "
        "take (-qx, qw, -qz, qy) as the quaternion (qw, qx, qy, qz)",
        position=_DOWN,
        world=_DOWN,
    ),
    Reading(
        "FRD body",
        "the body axes are forward, right, down in a world that is z up; expected forward, left, "
        "up: take "
        "(-qx, qw, qz, -qy) as the quaternion (qw, qx, qy, qz)",
        body=_DOWN,
    ),
    Reading(
        "NED position",
        "the position is z down (north, east, down) but the attitude z up; expected z up: negate "
        "py and "
        "pz",
        position=_DOWN,
    ),
    Reading(
        "NED attitude",
        "the attitude is z down (north, east, down; forward, right, down) but the position z up; "
        "expected z up: negate qy and qz",
        world=_DOWN,
        body=_DOWN,
    ),
    Reading(
        "pz negated",
        "the position's z points down; expected z up: negate pz",
        position=np.diag([1.0, 1.0, -1.0]),
    ),
    Reading(
        "y up",
        f"the world is y up, as motion capture often is, with body axes forward, left, up; "
        f"{_ROTATE}, and the "
        "attitude turned by 90 degrees about x likewise",
        position=_Y_UP,
        world=_Y_UP,
    ),
    Reading(
        "y up",
        f"the world and the body are y up, as motion capture often is; {_ROTATE} and the "
        f"quaternion "
        "(qw, qx, -qz, qy)",
        position=_Y_UP,
        world=_Y_UP,
        body=_Y_UP.T,
    ),
    Reading(
        "y and z swapped",
        "py and pz are swapped, the attitude is not; expected z up: swap the columns",
        position=_SWAP_YZ,
    ),
    Reading(
        "y and z swapped",
        "y and z are swapped, in position and quaternion; expected z up: swap py and pz, and "
        "qy and qz",
        conjugate=True,
        position=_SWAP_YZ,
        world=_SWAP_YZ,
        body=_SWAP_YZ,
    ),
    Reading(
        "y up position", f"the position is y up but the attitude z up; {_ROTATE}", position=_Y_UP
    ),
    Reading(
        "x and y swapped",
        "px and py are swapped against the attitude; expected both in one world frame: swap the "
        "columns",
        position=_SWAP_XY,
    ),
    Reading(
        "x and z swapped",
        "px and pz are swapped, the attitude is not; expected z up: swap the columns",
        position=_SWAP_XZ,
    ),
    *(
        Reading(
            f"{column} negated",
            f"{column} points the other way than the attitude's world, which mirrors the flight; "
            f"expected both in one world frame: negate {column}",
            position=np.diag(signs),
        )
        for column, signs in (("px", [-1.0, 1.0, 1.0]), ("py", [1.0, -1.0, 1.0]))
    ),
    *(
        Reading(
            "turned position",
            f"the position's world is turned against the attitude's by {angle} degrees about z; "
            f"expected both in one world frame: p = {columns}",
            position=np.array(turn),
        )
        for angle, columns, turn in (
            (180, "(-px, -py, pz)", [[-1.0, 0.0, 0.0], [0.0, -1.0, 0.0], [0.0, 0.0, 1.0]]),
            (90, "(py, -px, pz)", [[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]),
            (-90, "(-py, px, pz)", [[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]),
        )
    ),
    Reading(
        "conjugate, NED",
        f"the world is z down (north, east, down) and the quaternion world to body; {_CONJUGATE}; "
        f"{_Z_DOWN}",
        conjugate=True,
        position=_DOWN,
        world=_DOWN,
        body=_DOWN,
    ),
    Reading(
        "scalar last, NED",
        f"the quaternion is scalar last and the world z down (north, east, down); {_FROM_LAST}; "
        f"{_Z_DOWN}",
        quaternion=_SCALAR_LAST,
        position=_DOWN,
        world=_DOWN,
        body=_DOWN,
    ),
    Reading(
        "scalar last, y up",
        f"the quaternion is scalar last and the world y up, with body axes forward, left, up; "
        f"{_FROM_LAST}; {_ROTATE}, and the attitude turned by 90 degrees about x likewise",
        quaternion=_SCALAR_LAST,
        position=_Y_UP,
        world=_Y_UP,
    ),
    Reading(
        "scalar last, y up",
        f"the quaternion is scalar last, the world and the body y up; {_FROM_LAST}; {_ROTATE} "
        "and the quaternion (qw, qx, -qz, qy)",
        quaternion=_SCALAR_LAST,
        position=_Y_UP,
        world=_Y_UP,
        body=_Y_UP.T,
    ),
    Reading("scalar first", _FROM_FIRST, quaternion=_SCALAR_FIRST),
    Reading(
        "scalar first, conjugate",
        f"{_FROM_FIRST}; and it is world to body; {_CONJUGATE}",
        quaternion=_SCALAR_FIRST,
        conjugate=True,
    ),
    Reading(
        "scalar first, NED",
        f"{_FROM_FIRST}; and the world is z down (north, east, down); {_Z_DOWN}",
        quaternion=_SCALAR_FIRST,
        position=_DOWN,
        world=_DOWN,
        body=_DOWN,
    ),
    Reading(
        "scalar first, y up",
        f"{_FROM_FIRST}; and the world is y up, with body axes forward, left, up; {_ROTATE}, and "
        "the attitude turned by 90 degrees about x likewise",
        quaternion=_SCALAR_FIRST,
        position=_Y_UP,
        world=_Y_UP,
    ),
    Reading(
        "scalar first, y up",
        f"{_FROM_FIRST}; and the world and the body are y up; {_ROTATE} and the quaternion "
        "(qw, qx, -qz, qy)",
        quaternion=_SCALAR_FIRST,
        position=_Y_UP,
        world=_Y_UP,
        body=_Y_UP.T,
    ),
    Reading(
        "mm", "px, py, pz look like millimetres; expected metres: divide them by 1000", scale=1e-3
    ),
    Reading(
        "cm", "px, py, pz look like centimetres; expected metres: divide them by 100", scale=1e-2
    ),
)


def _axes_readings() -> tuple[Reading, ...]:
    """Return what is left of the 48 ways in which the columns px, py, pz may lie along the axes of
    the attitude's world, or against them.
    """
    plain = Reading("", "")
    named = [plain.position] + [
        reading.position
        for reading in POSE_READINGS
        if replace(reading, position=_I, kind="", says="") == replace(plain, position=_I)
    ]
    out = []
    for columns in permutations(range(3)):
        for signs in product((1.0, -1.0), repeat=3):
            turn = np.diag(signs) @ _I[list(columns)]
            if any(np.array_equal(turn, other) for other in named):
                continue
            axes = ", ".join(
                f"{'-' if sign < 0 else ''}p{'xyz'[column]}"
                for sign, column in zip(signs, columns, strict=True)
            )
            out.append(
                Reading(
                    "position along other axes",
                    "px, py, pz lie along other axes than the attitude's world; expected both in "
                    f"one world frame: p = ({axes})",
                    position=turn,
                )
            )
    return tuple(out)


AXES_READINGS = _axes_readings()  # less usual than the others

# rotors (1 front-left, 2 rear-left, 3 rear-right, 4 front-right) in the order in which others count
# them
_KNOWN_ORDERS = {
    (3, 4, 2, 1): "Betaflight's order",
    (4, 2, 1, 3): "the order of PX4 and ArduPilot, quad x",
    (4, 3, 2, 1): "the Crazyflie's order, clockwise from front-right",
    (1, 4, 3, 2): "clockwise from front-left, as on the AR.Drone",
    (4, 1, 2, 3): "anticlockwise from front-right, as DJI counts",
}


def _rotor_reading(order: tuple[int, ...], mirrored: bool) -> Reading:
    says = []
    if order != (0, 1, 2, 3):
        numbers = tuple(i + 1 for i in order)
        known = f" ({_KNOWN_ORDERS[numbers]})" if numbers in _KNOWN_ORDERS else ""
        says.append(
            f"the rotors look permuted: omega1..omega4 are rotors {','.join(map(str, numbers))} of "
            f"this vehicle"
            f"{known}; expected 1 front-left, 2 rear-left, 3 rear-right, 4 front-right: reorder "
            f"the columns"
        )
    if mirrored:
        says.append("the rotors turn against the declared spin: mirror spin in the vehicle file")
    if order == (2, 3, 0, 1) and not mirrored:
        says.append(
            "body axes that point backward and right instead of forward and left look the same"
        )
    return Reading(
        "mirrored spin" if order == (0, 1, 2, 3) else "swapped rotors",
        "; ".join(says),
        order=order,
        mirrored=mirrored,
    )


ROTOR_READINGS = tuple(
    _rotor_reading(order, mirrored)
    for mirrored in (False, True)
    for order in permutations(range(4))
)[1:]


@dataclass(frozen=True, eq=False)
class _Motion:
    """What is compared (n samples in flight), low-passed; of the columns as they stand, one
    quaternion order.
    """

    acceleration: Array  # (n, 3) m/s2
    thrust_frame: (
        Array  # (n, 3, 3) body to world times specific thrust, m/s2, its median scaled to gravity
    )
    rate: Array  # (n, 3) rad/s, body
    angular_acceleration: Array  # (n, 3) rad/s2, body
    inverse_rate: Array  # (n, 3) the same two of the inverse attitude
    inverse_angular_acceleration: Array  # (n, 3)


@dataclass(frozen=True, eq=False)
class _Rotors:
    """Squared rotor speeds (n, 4), low-passed, at the compared times less a delay; NaN outside
    their piece.
    """

    pieces: Sequence[
        tuple[Array, Array, Array]
    ]  # per piece its times, low-passed squares (m, 4) and the compared times

    def at(self, delay: float) -> Array:
        out = []
        for t, squares, chosen in self.pieces:
            out.append(
                np.column_stack(
                    [
                        np.interp(chosen - delay, t, column, left=np.nan, right=np.nan)
                        for column in squares.T
                    ]
                )
            )
        return np.concatenate(out)


@dataclass(frozen=True)
class Fit:
    """How well a reading explains a log: shares of variance left unexplained, and whether it flies
    upright.
    """

    force: float
    vertical: float  # of the force's vertical component alone
    torques: tuple[float, float, float]
    upright: float  # cosine of the mean thrust's angle from the vertical

    @property
    def torque(self) -> float:
        """Mean share of the three torques."""
        return float(np.mean(self.torques))


class Balances:
    """The two balances of a log, ready to be tried under any reading.

    Args:
        log: the flight.
        vehicle: as declared.
        signals: of the log; default: those of its pose.

    Raises:
        InputError: no piece is long enough.
    """

    def __init__(
        self, log: FlightLog, vehicle: Vehicle, signals: Sequence[Signals] | None = None
    ) -> None:
        self._vehicle = vehicle
        self._log = log
        signals = log_signals(log) if signals is None else signals
        self._masks = _flying(signals, vehicle)
        self._motion = {(0, 1, 2, 3): _motion(signals, self._masks, vehicle)}
        self._rotors = _Rotors(
            [
                (
                    s.t,
                    low_pass(np.square(s.rotor_speeds), CUTOFFS.convention_hz, s.period),
                    s.t[mask],
                )
                for s, mask in zip(signals, self._masks, strict=True)
            ]
        )
        self._delayed = [self._rotors.at(delay) for delay in _DELAYS]
        height = np.concatenate(
            [s.position[mask, 2] for s, mask in zip(signals, self._masks, strict=True)]
        )
        self._turned = np.concatenate(
            [
                low_pass(
                    np.unwrap(np.arctan2(s.rotation[:, 1, 0], s.rotation[:, 0, 0])),
                    CUTOFFS.convention_hz,
                    s.period,
                )[mask]
                for s, mask in zip(signals, self._masks, strict=True)
            ]
        )
        self.height = float(np.median(height)) if height.size else 0.0  # m, as the log has it

    @property
    def inertia(self) -> Array:
        """Inertia (3, 3) of the vehicle, kg m2."""
        return self._vehicle.inertia

    @property
    def samples(self) -> int:
        """Number of samples compared."""
        return int(sum(mask.size for mask in self._masks))

    def motion(self, order: tuple[int, int, int, int] = (0, 1, 2, 3)) -> _Motion:
        """Return the motion by the quaternion whose w, x, y, z are these columns of the log's."""
        if order not in self._motion:
            signals = log_signals(
                replace(self._log, quaternion=self._log.quaternion[:, list(order)])
            )
            self._motion[order] = _motion(signals, self._masks, self._vehicle)
        return self._motion[order]

    def fit(self, reading: Reading) -> Fit:
        """Return how well a reading of pose columns explains the log."""
        motion = self.motion(reading.quaternion)
        up = np.array([0.0, 0.0, self._vehicle.gravity])
        force = motion.acceleration @ reading.position.T * reading.scale + up
        frame = motion.thrust_frame.transpose(0, 2, 1) if reading.conjugate else motion.thrust_frame
        thrust = np.einsum("ij,njk,k->ni", reading.world, frame, reading.body[:, 2])
        mean = thrust.mean(axis=0)
        upright = float(mean[2] / max(float(np.linalg.norm(mean)), 1e-9))
        return Fit(
            _share(force, thrust, _FORCE_GAIN),
            _share(force[:, 2:], thrust[:, 2:], _FORCE_GAIN),
            self.torques(self.needed_torque(reading), reading),
            upright,
        )

    def fit_position(self, declared: Fit, reading: Reading) -> Fit:
        """Return the fit of a reading of the position alone; other shares are as declared."""
        motion = self.motion()
        force = motion.acceleration @ reading.position.T  # shares know no mean, nor gravity
        thrust = motion.thrust_frame[:, :, 2]
        return replace(
            declared,
            force=_share(force, thrust, _FORCE_GAIN),
            vertical=_share(force[:, 2:], thrust[:, 2:], _FORCE_GAIN),
        )

    def needed_torque(self, reading: Reading) -> Array:
        """Return the torque (n, 3) in Nm, body, that the motion needs."""
        motion = self.motion(reading.quaternion)
        pair = (
            (motion.inverse_rate, motion.inverse_angular_acceleration)
            if reading.conjugate
            else (motion.rate, motion.angular_acceleration)
        )
        # the angular velocity is a pseudovector: a mirrored body frame turns its sign as well
        turn = reading.body * np.linalg.det(reading.body)
        rate, alpha = pair[0] @ turn, pair[1] @ turn
        J = self._vehicle.inertia
        torque: Array = alpha @ J.T + np.cross(rate, rate @ J.T)
        return torque

    def torques(self, needed: Array, reading: Reading) -> tuple[float, float, float]:
        """Return the shares of the torques ``needed`` (n, 3) that the rotors leave, at the delay
        that suits them best.
        """
        best = (_WORST, _WORST, _WORST)
        for squares in self._delayed:
            shares = self._shares(needed, squares, reading)
            if sum(shares) < sum(best):
                best = shares
        return best

    def _shares(
        self, needed: Array, squares: Array, reading: Reading
    ) -> tuple[float, float, float]:
        there = np.isfinite(squares[:, 0])
        given = squares[there][:, np.argsort(reading.order)] @ self._vehicle.mixing[1:].T
        if reading.mirrored:
            given[:, 2] *= -1.0
        x, y, z = (
            _share(needed[there, i : i + 1], given[:, i : i + 1], _TORQUE_GAIN) for i in range(3)
        )
        return x, y, z

    def pulled_back(self, needed: Array) -> float:
        """Return the share of the yaw torque of ``needed`` (n, 3) that rotors as declared leave
        beside a pull on the heading.

        Rotors that work against what turns the nose back give the opposite of what slow turns need.
        """
        best = _WORST
        for squares in self._delayed:
            there = np.isfinite(squares[:, 0])
            yaw = np.column_stack(
                [squares[there] @ self._vehicle.mixing[3], -self._turned[there], needed[there, 2]]
            )
            yaw -= yaw.mean(axis=0)
            given, back, wanted = (yaw / np.maximum(yaw.std(axis=0), 1e-30)).T
            least, most = (
                np.array(_TORQUE_GAIN)
                * max(float(yaw[:, 0].std()), 1e-30)
                / max(float(yaw[:, 2].std()), 1e-30)
            )
            found = lsq_linear(
                np.column_stack([given, back]), wanted, bounds=([least, 0.0], [most, np.inf])
            )
            best = min(best, 2.0 * float(found.cost) / len(wanted))
        return best

    def shift(self) -> tuple[float, float, float]:
        """Return the shift of rotors against pose (s, positive: rotors late) that fits best, its
        share and that within 0.1 s.

        The share is the mean of the three torques' and that of the thrust along its own axis.
        """
        needed = self.needed_torque(Reading("", ""))
        motion = self.motion()
        axis = motion.thrust_frame[:, :, 2] / np.linalg.norm(
            motion.thrust_frame[:, :, 2], axis=1, keepdims=True
        )
        along = np.sum(
            axis * (motion.acceleration + np.array([0.0, 0.0, self._vehicle.gravity])), axis=1
        )[:, None]
        shifts = np.arange(-_LONGEST_SHIFT, _LONGEST_SHIFT + 0.5 * _SHIFT_STEP, _SHIFT_STEP)
        shares = []
        for shift in shifts:
            squares = self._rotors.at(-shift)
            there = np.isfinite(squares[:, 0])
            if there.sum() < _LEAST_SAMPLES:
                shares.append(_WORST)
                continue
            thrust = squares[there] @ self._vehicle.k[:, None]
            thrust *= self._vehicle.gravity / float(np.median(thrust))
            parts = (
                *self._shares(needed, squares, Reading("", "")),
                _share(along[there], thrust, _FORCE_GAIN),
            )
            shares.append(float(np.mean(parts)))
        left = np.array(shares)
        best = int(np.argmin(left))
        return (
            float(shifts[best]),
            float(left[best]),
            float(left[np.abs(shifts) <= _SHIFT + 1e-9].min()),
        )


def _flying(signals: Sequence[Signals], vehicle: Vehicle) -> list[NDArray[np.intp]]:
    """Return for each piece the indices to compare: in flight, away from the ends, about 20 a
    second.
    """
    thrusts = [
        low_pass(np.square(s.rotor_speeds) @ vehicle.k, CUTOFFS.convention_hz, s.period)
        for s in signals
    ]
    every = np.concatenate(thrusts)
    turning = every[every > 0.1 * float(np.quantile(every, 0.9))]
    least = _FLYING * float(np.median(turning)) if turning.size else np.inf
    out = []
    for s, thrust in zip(signals, thrusts, strict=True):
        edge, step = round(_EDGE / s.period), max(1, round(1.0 / (_RATE_HZ * s.period)))
        index = np.arange(edge, len(s.t) - edge, step)
        out.append(index[thrust[index] > least])
    return out


def _motion(
    signals: Sequence[Signals], masks: Sequence[NDArray[np.intp]], vehicle: Vehicle
) -> _Motion:
    columns: list[list[Array]] = [[] for _ in range(6)]
    for s, mask in zip(signals, masks, strict=True):
        thrust = np.square(s.rotor_speeds) @ vehicle.k
        inverse = -np.einsum("nij,nj->ni", s.rotation, s.angular_velocity)
        for column, x in zip(
            columns,
            (
                s.acceleration,
                s.rotation * thrust[:, None, None],
                s.angular_velocity,
                s.angular_acceleration,
                inverse,
                central_difference(inverse, s.period),
            ),
            strict=True,
        ):
            column.append(low_pass(x, CUTOFFS.convention_hz, s.period)[mask])
    acceleration, frame, *turning = (np.concatenate(column) for column in columns)
    level = float(np.median(np.linalg.norm(frame[:, :, 2], axis=1))) if len(frame) else 1.0
    return _Motion(acceleration, frame * (vehicle.gravity / max(level, 1e-9)), *turning)


def _share(needed: Array, given: Array, gain: tuple[float, float]) -> float:
    """Return the share of the variance of ``needed`` (n, m) that ``given`` (n, m), times a gain in
    range, leaves.
    """
    needed, given = needed - needed.mean(axis=0), given - given.mean(axis=0)
    total, power = float(np.sum(needed * needed)), float(np.sum(given * given))
    if total <= 0.0 or power <= 0.0:
        return 1.0
    factor = float(np.clip(np.sum(needed * given) / power, *gain))
    return min(float(np.sum(np.square(needed - factor * given))) / total, _WORST)


def recognise(balances: Balances) -> tuple[Reading, ...]:
    """Return the readings that explain a log where the log as declared does not: none, one, or
    several that fit alike.
    """
    if balances.samples < _LEAST_SAMPLES:
        return ()
    declared = balances.fit(Reading("", ""))
    needed = balances.needed_torque(Reading("", ""))
    fits = [(reading, balances.fit(reading)) for reading in POSE_READINGS]
    fits += [
        (reading, replace(declared, torques=balances.torques(needed, reading)))
        for reading in ROTOR_READINGS
    ]
    fits += [(reading, balances.fit_position(declared, reading)) for reading in AXES_READINGS]
    winners = [(reading, fit) for reading, fit in fits if _wins(fit, declared)]
    if any(_only_mirrored(reading) for reading, _ in winners):
        pulled = balances.pulled_back(needed)
        winners = [
            (reading, fit)
            for reading, fit in winners
            if not _only_mirrored(reading) or fit.torques[2] < pulled
        ]
    if not winners:
        return ()

    def left(fit: Fit) -> float:
        return min(fit.force, 1.0) + min(fit.vertical, 1.0) + min(fit.torque, 1.0)

    limit = _TIE[0] * min(left(fit) for _, fit in winners) + _TIE[1]
    alike = [reading for reading, fit in winners if left(fit) <= limit]
    # the usual readings first
    alike = [reading for reading in alike if reading not in AXES_READINGS] or alike
    # a vehicle seldom flies below its origin
    above = [reading for reading in alike if (reading.position[2, 2] < 0) == (balances.height < 0)]
    return tuple(above if above else alike)


class TorqueBalance:
    """How well rotors as declared turn the body, and which other readings do clearly better."""

    def __init__(self, balances: Balances) -> None:
        self.enough = balances.samples >= _LEAST_SAMPLES
        plain = Reading("", "")
        self.shares = (
            balances.torques(balances.needed_torque(plain), plain)
            if self.enough
            else (0.0, 0.0, 0.0)
        )

    @property
    def contradicts(self) -> bool:
        """Whether the log as declared fits badly."""
        return float(np.mean(self.shares)) >= _BAD or max(self.shares) >= _CONTRADICTS

    def alike(self, found: Sequence[tuple[tuple[float, float, float], str]]) -> list[str]:
        """Return the words of the readings that win clearly, the best and those that fit alike."""
        limit = min(_GOOD, _CLEAR * float(np.mean(self.shares)))
        good = [
            (float(np.mean(shares)), words)
            for shares, words in found
            if np.mean(shares) <= limit and max(shares) <= 1.5 * _GOOD
        ]
        good.sort()
        return [words for share, words in good if share <= _TIE[0] * good[0][0] + _TIE[1]]


def _only_mirrored(reading: Reading) -> bool:
    return reading.mirrored and reading.order == (0, 1, 2, 3)


def _wins(fit: Fit, declared: Fit) -> bool:
    """Return whether a reading wins clearly in one balance and loses in neither."""
    if fit.upright < _UPRIGHT:
        return False
    if declared.upright < _NOT_UPRIGHT and fit.force <= _BAD:
        return True
    by_force = declared.force >= _BAD and fit.force <= min(_GOOD_FORCE, _CLEAR * declared.force)
    by_force |= declared.force >= _SOME_FORCE and fit.force <= _DECISIVE * declared.force
    by_height = declared.vertical >= _UPSIDE_DOWN and fit.vertical <= _GOOD
    contradicted = declared.torque >= _BAD or max(declared.torques) >= _CONTRADICTS
    by_torque = (
        contradicted
        and fit.torque <= min(_GOOD, _CLEAR * declared.torque)
        and max(fit.torques) <= 1.5 * _GOOD
    )
    loses = any(
        new > old + _WORSE and old <= _SAYS_NOTHING
        for new, old in ((fit.force, declared.force), (fit.torque, declared.torque))
    )
    return (by_force or by_height or by_torque) and not loses


def time_shift(balances: Balances) -> float | None:
    """Return the time offset of the rotor speeds against the pose (s, positive: they come late),
    where it is clearly over 0.1 s; None elsewhere.

    Motor lag, latency and radio make rotor speeds early by less.
    """
    if balances.samples < _LEAST_SAMPLES:
        return None
    shift, share, near = balances.shift()
    clear = abs(shift) > _SHIFT_CLEAR and share <= min(_GOOD, _CLEAR * near) and near >= _SHIFT_BAD
    return shift if clear else None
