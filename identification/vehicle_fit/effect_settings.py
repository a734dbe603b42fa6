"""The library's effects as a vehicle's own: which is known in which role, what its coefficients are
called, and what a vehicle has of it.
"""

from ...dynamics.effects import Role, get, playing
from ...dynamics.vehicle import Vehicle


def effect_of(role: Role) -> str:
    """Return the first effect of the library that plays a role."""
    return playing(role)[0]


def estimate_name(role: Role, index: int) -> str:
    """Return what the estimate of a role's coefficient is called: effect and coefficient."""
    effect = effect_of(role)
    return f"{effect} {get(effect).coefficients[index].name}"


def coefficient_of(vehicle: Vehicle, role: Role, index: int) -> float:
    """Return a coefficient of a vehicle's effects of a role; 0 where it has none."""
    settings = [e for e in vehicle.effects if get(e.name).role == role]
    return sum(float(get(e.name).vector(e.coefficients)[index]) for e in settings)


def linear_drag(vehicle: Vehicle) -> tuple[float, float, float]:
    """Return the drag along body x, y and z at hover, of rotors and body together, N/(m/s)."""
    turning = 4.0 * vehicle.hover_rate
    along = ((Role.ROTOR_DRAG, 0), (Role.ROTOR_DRAG, 1), (Role.INFLOW_THRUST, 0))
    x, y, z = (
        turning * coefficient_of(vehicle, role, index) + coefficient_of(vehicle, Role.BODY_DRAG, i)
        for i, (role, index) in enumerate(along)
    )
    return x, y, z
