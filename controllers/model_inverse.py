"""A declared model in the flight loop: the coming wrench of its effects, and commands for wanted
rotor speeds.

Each of the three kinds of effects enters in its own way. *Wrench* effects: their force and torque
at the reference's velocity are taken off the rotors' share (``foresee``). *Rotor-input* effects:
commands are found for the wanted delivered rotor speeds (``through_the_rotors``). *Sensing*
effects: the filter has taken them out of its estimate already. Effects on the *rigid body* are
mass, inertia and centre of mass of the flight loop. No effect is known here by its name: the same
models are called as plant and filter call.
"""

from ..dynamics.effects.base import ROTOR_ACCELERATION, ROTOR_TIME
from ..dynamics.effects.call import deliver
from ..dynamics.motion import Array, effect_wrench
from ..dynamics.rotation import quaternion_to_matrix
from ..runtime.compiled import Record, compiled

# s after which the rotors shall deliver what is wanted if the command were held so long. A lag tau
# is then led by 1 / (1 - exp(-HORIZON / tau)): 2.3 for 35 ms. A shorter one asks more of the motors
# and of the estimate's noise.
HORIZON = 0.02
_PROBE = 1.02  # of a rotor speed, at which its effect on the delivered speed is tried
# a delivered speed that changes less than this with its command is led no further: five times
_LEAST_SLOPE = 0.2
_NO_SLOPE = 1e-3  # what arrives only after the horizon, as behind a latency, cannot be led
_ROUNDS = 2  # of Newton's method: one is exact where the delivered speed is linear in the command


@compiled
def foresee(c: Record, model: Record, x: Array) -> None:
    """Write the wrench of the model's effects that the rotors have to balance into ``c.foreseen``
    (6,): force in the world, torque in the body frame.

    The wrench is taken at the set point's position and velocity, without body rates. So does
    flatness-based control of vehicles with drag (Faessler, Franchi and Scaramuzza, RA-L 3(2),
    2018). An effect's further part at the vehicle's own velocity is damping: a loop without this
    damping would oscillate more. Attitude: as estimated. Rotor speeds: as wanted last.
    """
    if model.wrench_count == 0:
        return
    quaternion_to_matrix(x[3:7], c.rotation)
    for i in range(4):
        c.effect_state[ROTOR_ACCELERATION + i] = model.effect_state[ROTOR_ACCELERATION + i]
    effect_wrench(
        model.wrench_models[: model.wrench_count],
        model.wrench_coefficients,
        model.constants,
        model.body,
        c.setpoint[0:3],
        c.rotation,
        c.setpoint[3:6],
        c.still,
        c.wanted,
        model.wind,
        model.voltage,
        model.time,
        c.effect_state,
        c.foreseen,
    )


@compiled
def _delivered(c: Record, model: Record, commands: Array) -> None:
    """Write what the rotors deliver after the horizon at held commands into ``c.rotors``; the
    model's own memory stays as it is.
    """
    count = model.rotor_count
    for i in range(count):
        for j in range(c.memory.shape[1]):
            c.memory[i, j] = model.memory[i, j]
    for i in range(4):
        c.rotors[i] = commands[i]
    c.rotors[ROTOR_TIME] = model.time
    deliver(
        model.rotor_models[:count],
        model.rotor_coefficients,
        model.constants,
        c.memory,
        HORIZON,
        model.voltage,
        c.rotors,
    )


@compiled
def through_the_rotors(c: Record, model: Record) -> None:
    """Turn ``c.command``, the wanted rotor speeds (4,) rad/s, into commands that deliver them."""
    for i in range(4):
        c.wanted[i] = c.command[i]
    if model.rotor_count == 0:
        return
    for _ in range(_ROUNDS):
        _delivered(c, model, c.command)
        for i in range(4):
            c.missing[i] = c.wanted[i] - c.rotors[i]
            c.probe[i] = _PROBE * c.command[i] + 1.0
        _delivered(c, model, c.probe)
        for i in range(4):
            gained = c.rotors[i] - (c.wanted[i] - c.missing[i])
            slope = gained / (c.probe[i] - c.command[i])
            if slope > _NO_SLOPE:
                lead = c.missing[i] / max(slope, _LEAST_SLOPE)
                c.command[i] = min(max(c.command[i] + lead, 0.0), c.omega_max)
