"""Motor lag: the rotors follow the logged (commanded) rotor speeds as a first-order system.

dW/dt = (W_logged - W) / tau, integrated exactly over a step at constant W_logged; the rotors start
at the first W_logged.
"""

import math

from .base import STEP, Coefficient, Effect, compiled_model
from .declaration import Family, Need, Role


@compiled_model
def effect_model(c, vehicle, rotors, memory):  # type: ignore[no-untyped-def]
    # memory: 0 whether the rotors have started, 1-4 their rotor speeds
    blend = 1.0 - math.exp(-rotors[STEP] / c[0]) if c[0] > 0.0 and memory[0] > 0.0 else 1.0
    memory[0] = 1.0
    for i in range(4):
        memory[1 + i] += blend * (rotors[i] - memory[1 + i])
        rotors[i] = memory[1 + i]


EFFECT = Effect(
    name="motor_lag",
    kind="rotor input",
    coefficients=(
        Coefficient("tau", "s", (0.035, 0.05), "time constant", minimum=0.0, maximum=0.5),
    ),
    source="Foerster, System Identification of the Crazyflie 2.0, ETH Zurich 2015; Faessler et "
    "al., Thrust Mixing, Saturation, and Body-Rate Control, RA-L 2017",
    excitation="quick roll, pitch and climbs: a lag smooths what a latency only moves; slow flight "
    "shows neither",
    model=effect_model,
    memory=5,
    family=Family.ROTOR_DYNAMICS,
    role=Role.LAG,
    needs=(Need.FAST_MOTION, Need.FINE_ROTOR_SPEEDS),
)
