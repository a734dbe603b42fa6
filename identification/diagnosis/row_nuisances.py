"""Nuisances of any flight beside effects: columns in standard deviations of their priors, to be
integrated out.
"""

import math
from collections.abc import Sequence

import numpy as np

from ...dynamics.effects import Role, get
from ..logs.table import Array, NamedArrays
from .coefficients import coefficient, unit_of_change
from .column import Column
from .commanded_rotors import THRUST_FACTORS
from .log_offsets import ROTOR_TIME_OFFSET
from .priors import MODEL_ERROR
from .regression import RegressedFlights
from .rows import Rows

# standard deviations of the differences from flight to flight
THRUST_STD = 0.02  # relative, of a flight to the usual thrust: cells, propellers, air
DRIFT_STD = 0.003  # relative, of thrust over a flight, beside the fade and the battery's sag
DELAY_STD = 0.02  # s, of commands: 32 to 102 ms of one vehicle
TILT_STD = 0.01  # rad, of the motion capture's vertical, and of the rotors' mean axis
BIAS_STD = 0.3  # m/s2, of a MEMS accelerometer between warm and cold
SCALE_STD = 0.02  # relative, of an accelerometer
# relative, of the thrust of measured rotors: measured sessions differed by .6 to 2.4 %
SESSION_STD = 0.012
# relative, of the swing of a load: by a load's own track a cable of .51 m swung like .46 to .56 m
SWING_STD = 0.08
STOPPED_WITHIN = 0.1  # s, in which a flight loop stops an unwanted angular velocity
# signals (n,) by name, each with the channels of the disturbances that it follows
Followers = dict[str, tuple[Array, Sequence[int]]]
AXES = dict(zip("xyz", np.eye(3), strict=True))  # of the body


def between_flights(column: Column, value: float, flights: RegressedFlights) -> float:
    """Return the standard deviation of a coefficient from flight to flight, of the mean of these
    flights, in its unit; 0 if unknown. With measured rotors these flights may be of one session.
    """
    role = get(column.effect).role
    each = math.sqrt(len(flights.logs))
    load = role == Role.SUSPENDED_LOAD
    unit = coefficient(column).unit
    if role in THRUST_FACTORS or (load and unit == "kg"):  # thrust carries the load
        share = THRUST_STD / each if flights.commanded else SESSION_STD
        return share * unit_of_change(column, flights.vehicle)
    if load:
        return SWING_STD * abs(value) / each
    return DELAY_STD / each if flights.commanded and role == Role.DELAY else 0.0


def row_nuisances(rows: Rows) -> NamedArrays:
    """Return columns (n, channels) by name, each in standard deviations of its prior.

    For thrust at a command they are the differences between flights. The common part is the
    thrust's own coefficient; beside it, a nearly equal column would become a lag or a drag.
    """
    flights = rows.flights
    out: NamedArrays = {}
    rotors = flights.rotor_wrench({}) / flights.inertias[2:]
    of_thrust = _of_commands if flights.commanded else _of_rotors
    numbers = np.unique(flights.log).tolist()
    for i in numbers:
        here = (flights.log == i)[:, None].astype(float)
        own = _of_accelerometers(rows, here, here * rotors[:, :1]) if rows.has_accelerometer else {}
        own |= of_thrust(rows, here, here * rotors)
        out |= {f"{name} {i}": x for name, x in own.items()}
    if flights.commanded:
        shared = np.mean([out[f"thrust {i}"] for i in numbers], axis=0)
        out |= {f"thrust {i}": out[f"thrust {i}"] - shared for i in numbers}
    offsets = rows.columns({}, flights.offsets)
    return out | {c.coefficient: flights.offsets[c].size * x for c, x in offsets.items()}


def _of_accelerometers(rows: Rows, here: Array, thrust: Array) -> NamedArrays:
    """Return the possible errors of sensors in one flight.

    Args:
        rows: the flights' rows.
        here: (samples, 1) 1 in this flight, 0 in others.
        thrust: (samples, 1) specific, m/s2, by the declared vehicle; 0 in other flights.
    """
    read = {f"bias {name}": BIAS_STD * here * along for name, along in AXES.items()}
    read["scale"] = SCALE_STD * thrust * AXES["z"]
    none = np.zeros((len(here), 3))
    return {f"accelerometer {name}": rows.from_body(none, x) for name, x in read.items()}


def _of_commands(rows: Rows, here: Array, wrench: Array) -> NamedArrays:
    """Return the differences between flights with rotors known by commands.

    From one sample to the next rotors may be held or not, and lag: half a period is not known. The
    turns may show the delay of commands. Even then the delay of thrust may differ: the flight loop
    answers vertical motion.
    """
    flights = rows.flights
    thrust = wrench[:, :1]
    up = thrust * AXES["z"]
    t = flights.t[here[:, 0] > 0.0]
    w = 2.0 * (flights.t[:, None] - t[0]) / max(np.ptp(t), 1e-9) - 1.0
    out = {
        "thrust": rows.from_body(THRUST_STD * up),
        "drift": rows.from_body(DRIFT_STD * w * up),
        "bend": rows.from_body(DRIFT_STD * (1.5 * w * w - 0.5) * up),
    }
    late = rows.columns({}, [ROTOR_TIME_OFFSET])[ROTOR_TIME_OFFSET]
    delay = DELAY_STD if rows.fixed else 0.5 * flights.pieces({})[0].signals.period
    out["delay"] = delay * rows.at_rows(here) * late
    for axis, name in enumerate("xy"):
        if not flights.inertial:
            tilted = TILT_STD * flights.vehicle.gravity * here * rows.rotation[:, axis, :]
            out[f"frame tilt {name}"] = rows.from_body(tilted, np.zeros_like(tilted))
        out[f"thrust axis {name}"] = rows.from_body(TILT_STD * thrust * AXES[name])
    return out


def _of_rotors(rows: Rows, here: Array, wrench: Array) -> NamedArrays:
    """Return the errors of the model of measured rotors; ``wrench`` (samples, 4): accelerations by
    the rotors, m/s2 and rad/s2.

    Noise of the rotor speeds biases a torque's gain low, by its share of the column (errors in
    variables).
    """
    noise = rows.flights.rotor_noise
    thrust = wrench[:, :1]
    varying = noise[0] * (thrust - here * thrust[here > 0.0].mean())
    out = {"model error of thrust's changes": rows.from_body(varying * AXES["z"])}
    gains = np.hypot(MODEL_ERROR, noise[1:]).tolist()
    for (name, along), gain in zip(AXES.items(), gains, strict=True):
        force = MODEL_ERROR * thrust * along
        torque = gain * wrench[:, 1:] * along
        out[f"model error of force {name}"] = rows.from_body(force)
        out[f"model error of torque {name}"] = rows.from_body(np.zeros_like(force), torque=torque)
    return out


def followers(rows: Rows) -> Followers:
    """Return the signals of rotors and of the motion that follow disturbances, as an answer of the
    flight loop or as the disturbed motion itself: each (n,) in m/s2 or rad/s2, and the channels of
    the disturbances.

    A flight loop answers a sideways disturbance by tilting, and the noise of a measured tilt looks
    like such an answer: in hover, tilt is hardly anything else. The loop answers a vertical
    disturbance by thrust. An angular velocity is taken as the acceleration to make it within the
    loop's stopping time. With commands only tilt is a follower: with thrust beside it, NanoBench
    flights were predicted worse than by constant thrust (.28 for .14 m/s2).
    """
    flights = rows.flights
    torque = rows.channels - 3 * rows.with_torques
    forces = [range(axis, torque, 3) for axis in range(3)]
    tilt = rows.at_rows(flights.vehicle.gravity * rows.rotation[:, 2, :2])
    out: Followers = {f"tilt {x}": (tilt[:, i], forces[i]) for i, x in enumerate("xy")}
    if not rows.with_torques:
        return out
    wrench = rows.at_rows(flights.rotor_wrench({}) / flights.inertias[2:])
    turned = [p.smooth(p.signals.angular_velocity) for p in flights.pieces({})]
    rates = rows.at_rows(np.concatenate(turned) / STOPPED_WITHIN)
    out["thrust"] = wrench[:, 0], forces[2]
    for i, x in enumerate("xyz"):
        out[f"torque {x}"] = wrench[:, 1 + i], [torque + i]
        out[f"rate {x}"] = rates[:, i], [torque + i]
    return out


def answered(rows: Rows, signals: Followers, disturbance: Array) -> NamedArrays:
    """Return the disturbances in signals that follow them: a share of each signal.

    With measured rotors a rate loop answers with a gain and a phase of its own at each frequency:
    the signal and its change are in bands. A signal explains no more than all of a disturbance,
    ``std(d) / std(signal)`` of itself: by an IMU the coherence of torques with gusts was .9 from 0
    to 3 Hz, with a gain of up to 2. With commands a tilt is the answer itself: the share is
    ``var(d) / var(signal)``.

    Args:
        rows: the flights' rows.
        signals: ``followers``.
        disturbance: (n, channels) the known disturbance.
    """
    out = {}
    own = [x[rows.fit].var(axis=0) for x in rows.bands(disturbance)]
    for name, (signal, channels) in signals.items():
        for i, band in enumerate(rows.bands(signal - signal[rows.fit].mean())):
            over = own[i][channels].max() / max(band[rows.fit].var(), 1e-12)
            change = np.concatenate([np.gradient(x) for x in rows.pieces(band)])
            change *= band.std() / max(change.std(), 1e-12)
            share = math.sqrt(over) if rows.with_torques else min(over, 1.0)
            parts = {"": band, "change of ": change} if rows.with_torques else {"": band}
            for what, x in parts.items():
                column = out[f"answer by {what}{name} {i}"] = np.zeros((len(x), rows.channels))
                column[:, channels] = share * x[:, None]
    return out
