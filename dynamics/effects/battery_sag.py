"""Battery sag: at a given logged rotor speed the rotors deliver less as the battery voltage falls.

Thrust and reaction torque scale by (V / voltage_ref)^n: the delivered rotor speed is W (V /
voltage_ref)^(n/2). The effect applies to commands, and to rotor speeds computed from
commands at the reference voltage. Without a voltage nothing changes.
"""

from .base import Coefficient, Effect
from .declaration import Family, Role

EFFECT = Effect(
    name="battery_sag",
    kind="rotor input",
    coefficients=(
        Coefficient(
            "n", "1", (1.0, 1.0), "exponent of the voltage ratio", minimum=0.0, maximum=3.0
        ),
    ),
    source="thrust goes with the square of the voltage at constant duty cycle (n = 2), less behind "
    "a regulated drive",
    excitation="a whole battery, with loads that come and go, and the voltage in the log",
    model="battery_sag",
    family=Family.THRUST,
    role=Role.THRUST_OVER_VOLTAGE,
)
