"""Clock offset: pose and rotor speeds of one row of the log are not of the same instant.

With dt > 0 the pose is that of dt earlier than the rotor speeds; with dt < 0 the rotor speeds are
those of -dt earlier than the pose. Between samples by a cubic. An estimator that knows of it delays
the other of the two, and so estimates the flight of dt ago.
"""

from .base import (
    DIRECTION,
    HAS_POSITION,
    HAS_QUATERNION,
    HAS_SPEED,
    SAMPLE_POSITION,
    SAMPLE_QUATERNION,
    SAMPLE_SPEED,
    SAMPLE_STEP,
    Coefficient,
    Effect,
    compiled_model,
)
from .declaration import Family, Need, Role
from .parts import delay

_POSES = 13  # kept, 0.06 s at 200 Hz
_SPEEDS = 22


@compiled_model
def effect_model(c, vehicle, sample, memory):  # type: ignore[no-untyped-def]
    wanted = c[0] * sample[DIRECTION]
    memory[1] += sample[SAMPLE_STEP]
    if wanted > 0.0:
        if sample[HAS_POSITION] > 0.0 and sample[HAS_QUATERNION] > 0.0:
            # a quaternion and its negative are one attitude: keep to the side of the last one
            dot = 0.0
            for i in range(4):
                dot += memory[6 + i] * sample[SAMPLE_QUATERNION + i]
            if memory[0] > 0.0 and dot < 0.0:
                for i in range(4):
                    sample[SAMPLE_QUATERNION + i] *= -1.0
            delay(memory, 7, _POSES, wanted, sample, SAMPLE_POSITION)
            square = 0.0
            for i in range(4):
                square += sample[SAMPLE_QUATERNION + i] ** 2
            for i in range(4):
                sample[SAMPLE_QUATERNION + i] /= square**0.5
    elif wanted < 0.0 and sample[HAS_SPEED] > 0.0:
        delay(memory, 4, _SPEEDS, -wanted, sample, SAMPLE_SPEED)


EFFECT = Effect(
    name="clock_offset",
    kind="sensing",
    coefficients=(
        Coefficient(
            "dt",
            "s",
            (0.03, 0.02),
            "by which the pose is older than the rotor speeds",
            minimum=-0.06,
            maximum=0.06,
        ),
    ),
    source="definition; motion capture reaches the vehicle's clock 5 to 30 ms late",
    excitation="quick manoeuvres tell it from a motor lag, which smooths; dt > 0 and a latency "
    "leave the same log",
    model=effect_model,
    memory=2 + max(8 * _POSES, 5 * _SPEEDS),
    family=Family.ALIGNMENT,
    role=Role.DELAY,
    needs=(Need.FAST_MOTION, Need.FINE_ROTOR_SPEEDS),
)
