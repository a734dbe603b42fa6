"""Is an IMU that has no pose beside it what its columns claim? Asked of gravity and of the rotors.

A flight's mean specific force is gravity, upwards in body axes: that shows the accelerometer's unit
and axes. The rotors turn the body, ``J alpha + omega x J omega = tau``: that shows the gyro's unit
and axes, and the rotors' order. What neither shows (an accelerometer turned about z) stays the
log's word.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...dynamics.vehicle import Vehicle
from ...runtime.errors import InputError
from ..motion.inertial_signals import inertial_pieces, inertial_signals
from .conventions import ROTOR_READINGS, Balances, Reading, TorqueBalance
from .flight_log import FlightLog

Array = NDArray[np.float64]


@dataclass(frozen=True)
class InertialScreening:
    """What an IMU must show."""

    least_hz: float = 45.0  # a quadrotor turns within a tenth of a second
    # of gravity, between which the median specific force of a flight lies
    force: tuple[float, float] = (0.6, 1.7)
    upright: float = 0.7  # cosine of the mean specific force's angle from body z
    samples: int = 20  # that decide whether a sensor was read


SCREENING = InertialScreening()
_UNITS = {"g": (9.80665, "multiply by 9.80665"), "milli-g": (9.80665e-3, "multiply by 0.00980665")}
_FRD = np.diag([1.0, -1.0, -1.0])
_GYRO_READINGS = (
    (np.pi / 180.0, np.eye(3), "in degrees per second; expected rad/s: multiply by 0.0174533"),
    (1.0, _FRD, "of body axes forward, right, down; expected forward, left, up: negate gy and gz"),
    (
        np.pi / 180.0,
        _FRD,
        "in degrees per second and of body axes forward, right, down; expected rad/s and forward, "
        "left, up: multiply by 0.0174533 and negate gy and gz",
    ),
    (1.0, -np.eye(3), "inverted: negate all three"),
)


def check_imu(log: FlightLog, vehicle: Vehicle, least: float | None, where: str) -> None:
    """Check rate, length, unit and axes of a log's IMU.

    Args:
        log: with gyro and accelerometer.
        vehicle: as declared.
        least: s of unbroken IMU that the log must have; None: any.
        where: the file, for messages.

    Raises:
        InputError: one is wrong; the message says what it looks like.
    """
    assert log.gyro is not None
    assert log.accelerometer is not None
    read = np.isfinite(log.gyro[:, 0]) & np.isfinite(log.accelerometer[:, 0])
    rows = np.flatnonzero(read)
    if len(rows) < SCREENING.samples:
        raise InputError(
            f"{where}: ax, ay, az and gx, gy, gz are read together in {len(rows)} row(s); expected "
            "them in the same rows, and a whole flight"
        )
    for names, x in (("ax, ay, az", log.accelerometer), ("gx, gy, gz", log.gyro)):
        if np.all(np.ptp(x[rows], axis=0) == 0.0):
            raise InputError(f"{where}: {names} never change: the sensor was not read")
    rate = 1.0 / float(np.median(np.diff(log.t[rows])))
    if rate < SCREENING.least_hz:
        raise InputError(
            f"{where}: {rate:.3g} IMU readings a second and no pose as fast; expected at least "
            f"{SCREENING.least_hz:g}: a quadrotor turns within a tenth of a second"
        )
    pieces = inertial_pieces(log)
    if least is not None:
        there = sum(float(log.t[p[-1]] - log.t[p[0]]) for p in pieces)
        if there < least - 1e-9:
            raise InputError(
                f"{where}: {there:.3g} s of unbroken gyro and accelerometer; expected at least "
                f"{least:g} s of flight, in runs of more than 3 s"
            )
    _check_gravity(log.accelerometer[rows], log.rotor_speeds[rows], vehicle, where)


def _check_gravity(force: Array, speeds: Array, vehicle: Vehicle, where: str) -> None:
    """Check that the specific force (n, 3) of a flight is gravity, upwards."""
    thrust = np.square(speeds) @ vehicle.k
    flying = thrust > 0.5 * float(np.quantile(thrust, 0.9))
    middle = np.median(force[flying], axis=0)
    size = float(np.median(np.linalg.norm(force[flying], axis=1)))
    low, high = SCREENING.force
    if not low <= size / vehicle.gravity <= high:
        for unit, (factor, how) in _UNITS.items():
            if low <= size * factor / vehicle.gravity <= high:
                raise InputError(
                    f"{where}: ax, ay, az look like {unit}: in flight they are {size:.3g} in the "
                    f"median; expected m/s2, {vehicle.gravity:.3g} in a hover: {how}"
                )
        raise InputError(
            f"{where}: ax, ay, az are {size:.3g} m/s2 in the median of a flight; expected the "
            f"specific force, which gravity makes about {vehicle.gravity:.3g}"
            + (" (an acceleration without gravity is none)" if size < vehicle.gravity else "")
        )
    upright = float(middle[2] / max(float(np.linalg.norm(middle)), 1e-9))
    if upright < -SCREENING.upright:
        raise InputError(
            f"{where}: az is {middle[2]:.3g} m/s2 in the median of a flight: the axes look like "
            "forward, right, down, or inverted; expected forward, left, up and +9.81 in a hover: "
            "negate ay and az (and gy and gz)"
        )
    if upright < SCREENING.upright:
        axis = "xyz"[int(np.argmax(np.abs(middle)))]
        raise InputError(
            f"{where}: gravity lies along a{axis} in the median of a flight; expected it along az: "
            "axes forward, left, up, of the vehicle and not of the sensor's board"
        )


def inertial_balances(log: FlightLog, vehicle: Vehicle) -> Balances:
    """Return the balances of a log's IMU, ready to be tried under any reading."""
    return Balances(log, vehicle, inertial_signals(log, vehicle.gravity))


def check_rotation(balances: Balances, where: str) -> None:
    """Check that the rotors, as logged, turn the body as the gyro shows.

    Raises:
        InputError: they do not, and clearly do under another reading of the columns.
    """
    balance = TorqueBalance(balances)
    if not balance.contradicts:
        return
    motion = balances.motion()
    J = balances.inertia
    found = []
    for scale, turn, words in _GYRO_READINGS:
        rate, alpha = scale * motion.rate @ turn, scale * motion.angular_acceleration @ turn
        needed = alpha @ J.T + np.cross(rate, rate @ J.T)
        shares = balances.torques(needed, Reading("", ""))
        found.append((shares, f"gx, gy, gz look {words}"))
    needed = balances.needed_torque(Reading("", ""))
    found += [(balances.torques(needed, reading), reading.says) for reading in ROTOR_READINGS]
    good = balance.alike([(shares, words) for shares, words in found])
    if good:
        says = "; or ".join(dict.fromkeys(good[:3]))
        raise InputError(f"{where}: {says}. As logged, the gyro contradicts the rotors' torques")
