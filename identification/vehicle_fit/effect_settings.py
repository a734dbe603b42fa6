"""The library's effects by their roles: names, coefficients, and a vehicle's own values."""

from ...dynamics.effects import Role, get, playing
from ...dynamics.vehicle import Vehicle


def effect_of(role: str) -> str:
    """Return the library's first effect of a role."""
    return playing(Role(role))[0]


LAG = effect_of(Role.LAG)


def coefficient_of(vehicle: Vehicle, role: Role, index: int) -> float:
    """Return a coefficient of a vehicle's effects of a role; 0 without one."""
    return sum(
        float(get(e.name).vector(e.coefficients)[index])
        for e in vehicle.effects
        if get(e.name).role == role
    )


def linear_drag(vehicle: Vehicle) -> list[float]:
    """Return the drag along body x, y and z at hover, of rotors and body together, N/(m/s)."""
    turning = 4.0 * vehicle.hover_rate
    along = ((Role.ROTOR_DRAG, 0), (Role.ROTOR_DRAG, 1), (Role.INFLOW_THRUST, 0))
    return [
        turning * coefficient_of(vehicle, role, index) + coefficient_of(vehicle, Role.BODY_DRAG, i)
        for i, (role, index) in enumerate(along)
    ]
