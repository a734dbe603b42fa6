"""Coefficients of a vehicle's own effects."""

from ...dynamics.vehicle import Vehicle


def coefficient_of(vehicle: Vehicle, effect: str, coefficient: str) -> float:
    """Return a coefficient of a vehicle's effect; 0 where it has none."""
    return sum(e.coefficients.get(coefficient, 0.0) for e in vehicle.effects if e.name == effect)
