"""Latency: the rotors follow their logged speeds after a pure delay.

The delivered rotor speeds at t are the logged speeds at t - d. A cubic interpolates between
samples. Before the first sample, the first speeds hold.
"""

from .base import Coefficient, Effect
from .declaration import Family, Need, Role

EFFECT = Effect(
    name="latency",
    kind="rotor input",
    coefficients=(Coefficient("d", "s", (0.03, 0.02), "delay", minimum=0.0, maximum=0.1),),
    source="definition; radio link and electronic speed controllers take 5 to 30 ms",
    excitation="quick manoeuvres: a lag smooths what a latency only moves. A log of rotor speeds "
    "and poses cannot tell it from poses that are stamped late (clock_offset): that takes a second "
    "clock",
    model="latency",
    family=Family.ROTOR_DYNAMICS,
    role=Role.DELAY,
    needs=(Need.FAST_MOTION, Need.FINE_ROTOR_SPEEDS),
)
