"""Latency: what the rotors do is what was logged a while ago, a pure delay.

The delivered rotor speeds at t are the logged ones at t - d, between samples by a cubic. In front
of the first sample the first one holds.
"""

from .base import STEP, Coefficient, Effect, compiled_model
from .declaration import Family, Need, Role
from .parts import delay

_KEPT = 22  # samples, 0.105 s at 200 Hz


@compiled_model
def effect_model(c, vehicle, rotors, memory):  # type: ignore[no-untyped-def]
    memory[1] += rotors[STEP]
    delay(memory, 4, _KEPT, c[0], rotors, 0)


EFFECT = Effect(
    name="latency",
    kind="rotor input",
    coefficients=(Coefficient("d", "s", (0.03, 0.02), "delay", minimum=0.0, maximum=0.1),),
    source="definition; radio link and electronic speed controllers take 5 to 30 ms",
    excitation="quick manoeuvres: a lag smooths what a latency only moves. A log of rotor speeds "
    "and poses cannot tell it from poses that are stamped late (clock_offset): that takes a second "
    "clock",
    model=effect_model,
    memory=2 + 5 * _KEPT,
    family=Family.ROTOR_DYNAMICS,
    role=Role.DELAY,
    needs=(Need.FAST_MOTION, Need.FINE_ROTOR_SPEEDS),
)
