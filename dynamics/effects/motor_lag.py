"""Motor lag: the rotors follow the logged (commanded) rotor speeds as a first-order system.

dW/dt = (W_logged - W) / tau, integrated exactly over a step at constant W_logged; the rotors start
at the first W_logged.
"""

from .base import Coefficient, Effect
from .declaration import Family, Need, Role

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
    model="motor_lag",
    family=Family.ROTOR_DYNAMICS,
    role=Role.LAG,
    needs=(Need.FAST_MOTION, Need.FINE_ROTOR_SPEEDS),
)
