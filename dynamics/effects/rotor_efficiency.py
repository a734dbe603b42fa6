"""Rotor efficiency: single rotors deliver more or less than declared at the same rotor speed.

Thrust and reaction torque of rotor i scale by 1 + e_i: the delivered rotor speed is W_i sqrt(1 +
e_i).
"""

from .base import Coefficient, Effect
from .declaration import Family, Need, Role

EFFECT = Effect(
    name="rotor_efficiency",
    kind="rotor input",
    coefficients=tuple(
        Coefficient(
            f"e{i}",
            "1",
            (-0.08 if i == 1 else 0.0,) * 2,
            f"relative change of rotor {i}",
            minimum=-1.0,
            maximum=2.0,
            # no propeller delivers far more than declared; all four together may
            plausible=0.05,
        )
        for i in (1, 2, 3, 4)
    ),
    source="definition; a chipped or badly seated propeller loses several per cent",
    excitation="climbs and hard manoeuvres: its torque grows with that rotor's thrust, a steady "
    "torque stays, and an offset centre of mass makes no yaw torque",
    model="rotor_efficiency",
    family=Family.THRUST,
    role=Role.ROTOR_THRUSTS,
    needs=(Need.SINGLE_ROTORS,),
)
