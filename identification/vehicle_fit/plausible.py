"""Rotor speeds that no quadrotor has: an impossible thrust."""

import math

from ...runtime.errors import InputError

# thrust over air density, disc area and squared tip speed: propellers of 0.03 to 5 kg have 0.005 to
# 0.03; a radius known by the arm alone may be off by a factor of 1.4, thrust then by 4
_THRUST_COEFFICIENTS = (0.002, 0.1)
_AIR_DENSITY = 1.225  # kg/m3


def check_thrust(k: float, radius: float, log: str) -> None:
    """Check a thrust coefficient ``k`` in N/(rad/s)^2 of a rotor with a radius in m.

    Raises:
        InputError: no propeller has such a thrust coefficient.
    """
    coefficient = k / (_AIR_DENSITY * math.pi * radius**4)
    low, high = _THRUST_COEFFICIENTS
    if low <= coefficient <= high:
        return
    usual = math.sqrt(coefficient / math.sqrt(low * high))
    raise InputError(
        f"{log}: rotor speeds: thrust coefficient {coefficient:.3g} with a rotor radius of "
        f"{radius:.3g} m; expected {low:g} to {high:g}. The speeds are about {usual:.2g} times too "
        f"{'small' if usual > 1.0 else 'large'} to be rad/s: check their unit in the log or the map"
    )
