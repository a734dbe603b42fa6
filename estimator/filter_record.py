"""The memory of one wrench filter, as a record that compiled code works on."""

import numpy as np
from numba import njit

from ..dynamics.effects import Bundle, compile_effects
from ..dynamics.effects.base import ROTORS_SIZE, VEHICLE_SIZE
from ..dynamics.effects.base import STATE_SIZE as EFFECT_STATE_SIZE
from ..dynamics.effects.call import deliver
from ..dynamics.errors import InputError
from ..dynamics.motion import BODY, Array, accelerations, body_record, effect_wrench, rotor_wrench
from ..dynamics.rotation import quaternion_to_matrix, turn_body
from ..dynamics.vehicle import Vehicle
from .estimate import STATE_SIZE
from .tuning import UKFTuning

N = 18  # error state (rho, omega, x, v, torque, force)
MAX_EFFECTS = 16
MEMORY = 96  # numbers that a rotor-input effect may keep

FILTER = np.dtype([
    ("body", BODY),
    # the estimate
    ("x", "f8", (STATE_SIZE,)),
    ("P", "f8", (N, N)),
    # tuning, as variances
    ("motor_torque", "f8", (3,)),
    ("torque_walk", "f8", (3,)),
    ("thrust", "f8", (3,)),
    ("force_walk", "f8", (3,)),
    ("noise", "f8", (6,)),  # of the measurement (rho, x)
    ("kappa", "f8"),
    ("period", "f8"),
    ("gate", "f8"),  # largest NIS of a measurement that is taken in; 0: any
    ("patience", "i8"),  # measurements that may be refused in a row
    ("refused", "i8"),
    # effects that the model declares
    ("constants", "f8", (VEHICLE_SIZE,)),
    ("wrench_laws", "i8", (MAX_EFFECTS,)),
    ("wrench_coefficients", "f8", (MAX_EFFECTS, 8)),
    ("wrench_count", "i8"),
    ("rotor_laws", "i8", (MAX_EFFECTS,)),
    ("rotor_coefficients", "f8", (MAX_EFFECTS, 8)),
    ("rotor_count", "i8"),
    ("memory", "f8", (MAX_EFFECTS, MEMORY)),
    ("time", "f8"),
    ("voltage", "f8"),
    # the step in progress
    ("rotors", "f8", (ROTORS_SIZE,)),  # delivered turn rates
    ("rotor_wrench", "f8", (4,)),
    ("effect_state", "f8", (EFFECT_STATE_SIZE,)),
    ("effect_wrench", "f8", (6,)),
    ("wind", "f8", (3,)),
    ("acceleration", "f8", (6,)),
    ("rotation", "f8", (3, 3)),  # of the sigma point in hand
    ("centre_rotation", "f8", (3, 3)),
    ("last_speeds", "f8", (4,)),
    ("S", "f8", (12, N)),  # columns of the root of P, one a row
    ("M", "f8", (12, 12)),
    ("Y", "f8", (N, 12)),
    ("Z", "f8", (12, N)),
    ("D", "f8", (24, N)),  # sigma points after the step, from the central one
    ("mean", "f8", (N,)),
    ("column", "f8", (N,)),  # of the noise input matrix B
    ("point", "f8", (STATE_SIZE,)),  # the sigma point in hand
    ("next", "f8", (STATE_SIZE,)),  # where it is after the step
    ("centre", "f8", (STATE_SIZE,)),  # the same of the central one
    ("q", "f8", (4,)),
    ("rho", "f8", (3,)),
    ("L", "f8", (6, 6)),
    ("W", "f8", (6, N)),
    ("innovation", "f8", (6,)),
])


def filter_record(vehicle: Vehicle, tuning: UKFTuning, period: float, gate: float, patience: int) -> np.ndarray:
    """Return the memory (1,) of a filter for a vehicle with its declared effects; ``period`` in s.

    Raises:
        InputError: more effects than a filter holds, or a rotor-input effect with more memory than there is.
    """
    bundle: Bundle = compile_effects(vehicle)
    if max(len(bundle.wrench_laws), len(bundle.rotor_laws)) > MAX_EFFECTS or bundle.rotor_memory > MEMORY:
        raise InputError(f"{vehicle.name}: effects: a filter holds at most {MAX_EFFECTS} of a kind")
    record = np.zeros(1, dtype=FILTER)
    f = record[0]
    f["body"] = body_record(bundle.vehicle)[0]
    for name, deviation in (("motor_torque", tuning.motor_torque_noise), ("torque_walk", tuning.torque_walk),
                            ("thrust", tuning.thrust_noise), ("force_walk", tuning.force_walk)):
        f[name] = np.square(deviation)
    f["noise"][:3] = np.square(np.asarray(tuning.attitude_noise, dtype=np.float64) / 4.0)  # (16)
    f["noise"][3:] = np.square(tuning.position_noise)
    f["kappa"], f["period"], f["gate"], f["patience"] = tuning.kappa, period, gate, patience
    f["constants"] = bundle.constants
    f["last_speeds"] = bundle.vehicle.hover_rate
    for kind, laws, coefficients in (("wrench", bundle.wrench_laws, bundle.wrench_coefficients),
                                     ("rotor", bundle.rotor_laws, bundle.rotor_coefficients)):
        count = len(laws)
        f[f"{kind}_count"] = count
        f[f"{kind}_laws"][:count] = laws
        f[f"{kind}_coefficients"][:count] = coefficients
    return record


@njit(cache=True)
def drive(f: np.ndarray, rotor_speeds: Array, dt: float, voltage: float) -> None:
    """Work out what the rotors delivered over a step of ``dt`` s at the logged turn rates (4,)."""
    f.voltage = voltage
    for i in range(4):
        f.rotors[i] = rotor_speeds[i]
    if f.rotor_count > 0:
        deliver(f.rotor_laws[: f.rotor_count], f.rotor_coefficients, f.constants, f.memory, dt, voltage, f.rotors)
    rotor_wrench(f.body, f.rotors, f.rotor_wrench)


@njit(cache=True)
def propagate(f: np.ndarray, x: Array, dt: float, out: Array) -> None:
    """Write the state that follows ``x`` after ``dt`` s into ``out``: (2)-(5), (11)-(14)."""
    quaternion_to_matrix(x[3:7], f.rotation)
    if f.wrench_count > 0:
        effect_wrench(f.wrench_laws[: f.wrench_count], f.wrench_coefficients, f.constants, f.body, x[0:3], f.rotation,
                      x[7:10], x[10:13], f.rotors, f.wind, f.voltage, f.time, f.effect_state, f.effect_wrench)
    accelerations(f.body, f.rotation, x[10:13], f.rotor_wrench, x[13:16], x[16:19], f.effect_wrench, f.acceleration)
    for i in range(3):
        out[i] = x[i] + dt * (x[7 + i] + 0.5 * dt * f.acceleration[i])
        out[7 + i] = x[7 + i] + dt * f.acceleration[i]
        out[10 + i] = x[10 + i] + dt * f.acceleration[3 + i]
        out[13 + i] = x[13 + i]
        out[16 + i] = x[16 + i]
    turn_body(x[3:7], x[10], x[11], x[12], dt, out[3:7])
