"""Rate damping: a torque against the body rate, tau = -diag(dx, dy, dz) omega in body axes."""

from numba import cfunc

from .base import EFFECT_MODEL, RATE, Coefficient, Effect


@cfunc(EFFECT_MODEL, cache=True)
def effect_model(c, vehicle, state, wrench):  # type: ignore[no-untyped-def]
    for i in range(3):
        wrench[3 + i] -= c[i] * state[RATE + i]


EFFECT = Effect(
    name="rate_damping",
    kind="wrench",
    coefficients=tuple(
        Coefficient(f"d{axis}", "Nm/(rad/s)", (5e-3, 3e-5), f"about body {axis}", minimum=0.0)
        for axis in "xyz"
    ),
    source="linear damping; sizes: what typical rotor drag and inflow make at the rotors' arms",
    confused_with=("inflow_thrust", "rotor_drag", "inertia", "motor_lag"),
    excitation="steady yaw rates of 1 rad/s and more, and quick roll and pitch, with little "
    "translation",
    model=effect_model,
)
