"""A mass and rotor speeds that no quadrotor has."""

import math

from ...dynamics.vehicle import Vehicle
from ...runtime.errors import InputError
from .geometry import AIR_DENSITY

# N/m2, weight over the rotors' discs: the shipped vehicles have 36 to 40, a racer 143
_LOADINGS = (3.0, 3000.0)
# thrust over air density, disc area and squared tip speed: propellers of 0.03 to 5 kg have 0.005 to
# 0.03; a radius known by the arm alone may be off by a factor of 1.4, thrust then by 4
_THRUST_COEFFICIENTS = (0.002, 0.1)


def check_thrust(vehicle: Vehicle, measured: bool, log: str) -> None:
    """Check weight and thrust of a vehicle against its rotors' size; ``measured``: its rotor speeds
    are those of a log.

    Raises:
        InputError: no quadrotor has such a mass, or no propeller such a thrust coefficient.
    """
    disc = math.pi * vehicle.rotor_radius**2
    loading, (low, high) = vehicle.weight / (4.0 * disc), _LOADINGS
    if not low <= loading <= high:
        raise InputError(
            f"--mass {vehicle.mass:g} with rotors {vehicle.arm_l:.3g} m from the body axes: "
            f"{loading:.3g} N on a square metre of their discs; expected {low:g} to {high:g}: "
            "the mass in kg, the distance in m"
        )
    radius, (low, high) = vehicle.rotor_radius, _THRUST_COEFFICIENTS
    coefficient = vehicle.k[0] / (AIR_DENSITY * disc * radius**2)
    if measured and not low <= coefficient <= high:
        usual = math.sqrt(coefficient / math.sqrt(low * high))
        raise InputError(
            f"{log}: rotor speeds: thrust coefficient {coefficient:.3g} with a rotor radius of "
            f"{radius:.3g} m; expected {low:g} to {high:g}. With this mass and geometry, speeds "
            f"in rad/s would be about {usual:.2g} times as large: check their unit in the log or "
            "the map, --mass and --geometry"
        )
